//! Tests of the analysis of laws in wrappers, without their bounds, and with weights that vary.

use super::{Question, analyze, divergence, overreach, refuse_divergent};
use crate::learning::gate::{Gate, GateRule};
use crate::learning::ladder::{Ladder, LadderRule};
use crate::learning::law::adjoint::Adjoint;
use crate::learning::law::constrained::{Bound, Bounds, Constrained};
use crate::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use crate::learning::law::model_inverse::ModelInverse;
use crate::learning::law::norm_optimal::{Cost, NormOptimal, Weights};
use crate::learning::law::pd::{Pd, PdGains};
use crate::learning::law::q_filter::QFilter;
use crate::learning::weights::Weight;
use crate::learning::{Law, LearningError};
use crate::model::{Method, StateSpace, discretize, from_transfer_function, second_order};
use crate::signal::{Segment, SwitchedFilter, butterworth};

const DT_S: f64 = 2e-3;

fn one_axis(hz: f64) -> StateSpace {
    let model = second_order(std::f64::consts::TAU * hz, 0.8).unwrap();
    discretize(&model, DT_S, Method::ZeroOrderHold).unwrap().delayed(2).unwrap()
}

fn low_pass(cutoff_hz: f64) -> QFilter {
    QFilter::ZeroPhase(butterworth(2, cutoff_hz, DT_S).unwrap())
}

/// A diverging law and a converging one.
fn pair(n: usize) -> [Pd; 2] {
    [2.5, 0.5]
        .map(|kp| Pd::new(PdGains { kp, kd: 0.0, lead_samples: 9 }, n, 1, low_pass(8.0)).unwrap())
}

#[test]
fn a_gate_and_a_ladder_do_not_hide_the_law_inside() {
    let (model, n) = (one_axis(15.0), 400);
    let gate = GateRule { tolerance: 10.0, ..GateRule::default() };
    let ladder = LadderRule::new(3);
    let [wild, sound] = pair(n);
    let plain = divergence(&mut pair(n)[1], &model, n).unwrap();
    assert!(plain.as_ref().is_some_and(|verdict| verdict.converges));
    let mut around = Gate::new(Ladder::new(sound, ladder).unwrap(), gate).unwrap();
    assert_eq!(divergence(&mut around, &model, n).unwrap(), plain);
    let mut around = Gate::new(Ladder::new(wild, ladder).unwrap(), gate).unwrap();
    let refused = refuse_divergent(&mut around, &model, n).unwrap_err();
    assert!(matches!(refused, LearningError::Divergent { .. }), "{refused}");
    let short = 80;
    let [_, mut sound] = pair(short);
    let alone = analyze(&mut sound, &model, short, &Question::default()).unwrap();
    let mut around = Ladder::new(Gate::new(sound, gate).unwrap(), ladder).unwrap();
    assert_eq!(analyze(&mut around, &model, short, &Question::default()).unwrap(), alone);
}

#[test]
fn bounds_are_left_out_and_said_to_be() {
    let (model, n) = (one_axis(15.0), 120);
    let weights = Weights { rate: 3.0, ..Weights::default() };
    let bounds = Bounds { input: Some(Bound::within(-1e-6, 1e-6)), ..Bounds::default() };
    let mut bounded = Constrained::new(&model, n, weights, bounds).unwrap();
    let mut free = NormOptimal::new(&model, n, weights).unwrap();
    let question = Question::default();
    let found = analyze(&mut bounded, &model, n, &question).unwrap();
    let expected = analyze(&mut free, &model, n, &question).unwrap();
    assert_eq!(found.spectral_radius, expected.spectral_radius);
    assert!(found.why.starts_with("without its bounds") && found.why.ends_with(&expected.why));
    let verdict = divergence(&mut bounded, &model, n).unwrap().unwrap();
    assert!(verdict.converges && verdict.why.contains("without its bounds"), "{}", verdict.why);

    let law = |limit: f64| {
        let rule = Feedforward { gain_per_s: 0.5, lead_samples: 9, input_max: limit };
        ErrorFeedforward::new(rule, n, 1, low_pass(6.0)).unwrap()
    };
    let found = divergence(&mut law(1e-6), &model, n).unwrap().unwrap();
    let expected = divergence(&mut law(f64::INFINITY), &model, n).unwrap().unwrap();
    assert!((found.spectral_radius - expected.spectral_radius).abs() < 1e-15);
    assert!(found.why.contains("without its bounds"), "{}", found.why);
}

#[test]
fn model_laws_are_judged_on_their_own_model_and_on_another() {
    let (model, n) = (one_axis(15.0), 300);
    let gain = StateSpace::static_gain(nalgebra::dmatrix![-1.0], model.dt_s()).unwrap();
    let reversed = model.series(&gain).unwrap();
    let laws: [Box<dyn Law>; 3] = [
        Box::new(Adjoint::new(&model, n, None, QFilter::None).unwrap()),
        Box::new(Adjoint::new(&model, n, None, low_pass(20.0)).unwrap()),
        Box::new(ModelInverse::new(&model, n, 0.5, low_pass(4.0)).unwrap()),
    ];
    for mut law in laws {
        let found = divergence(law.as_mut(), &model, n).unwrap().unwrap();
        assert!(found.converges, "{}: {found:?}", law.describe());
        let refused = refuse_divergent(law.as_mut(), &reversed, n);
        assert!(matches!(refused, Err(LearningError::Divergent { .. })), "{}", law.describe());
    }
}

#[test]
fn weights_that_vary_do_not_cost_the_certainty_of_the_own_model() {
    let (model, n) = (one_axis(15.0), 80);
    let q: Vec<f64> = (0..n).map(|k| if k < 40 { 1.0 } else { 0.0 }).collect();
    let cost =
        Cost { q: Weight::PerSample(q), ..Weights { rate: 3.0, ..Weights::default() }.into() };
    let mut law = NormOptimal::new(&model, n, cost).unwrap();
    let verdict = divergence(&mut law, &model, n).unwrap().unwrap();
    assert!(verdict.converges && verdict.why.contains("cost of its own model"), "{}", verdict.why);
    let found = analyze(&mut law, &model, n, &Question::default()).unwrap();
    assert!(found.converges && found.spectral_radius.value < 1.0 + 1e-9, "{}", found.why);
}

/// A pure delay: `1 - gain z^(lead - delay)`, which reaches 1 at a known frequency.
#[test]
fn a_low_pass_above_the_critical_frequency_is_told_with_both() {
    // y[k] = u[k - 4], lead 1: |1 - g z^-3| = 1 where cos(3 w) = g / 2.
    let model = from_transfer_function(&[1.0], &[1.0, 0.0, 0.0, 0.0, 0.0], Some(DT_S)).unwrap();
    let (n, gain) = (400, 0.5_f64);
    let critical_hz = (0.5 * gain).acos() / (3.0 * std::f64::consts::TAU * DT_S);
    let pd =
        |filter| Pd::new(PdGains { kp: gain, kd: 0.0, lead_samples: 1 }, n, 1, filter).unwrap();
    let rule = Feedforward { gain_per_s: gain, lead_samples: 1, input_max: 1e-9 };
    let feedforward = |filter| ErrorFeedforward::new(rule, n, 1, filter).unwrap();
    let switched = |high_hz: f64| {
        let segments =
            [(0, 10.0), (200, high_hz)].map(|(start, cutoff_hz)| Segment { start, cutoff_hz });
        QFilter::Switched(SwitchedFilter::new(2, &segments, 20, DT_S).unwrap())
    };
    let (below_hz, above_hz) = (0.9 * critical_hz, 1.1 * critical_hz);
    let around = |law| Gate::new(law, GateRule::default()).unwrap();
    let laws: [(Box<dyn Law>, bool); 9] = [
        (Box::new(pd(QFilter::None)), false),
        (Box::new(pd(low_pass(below_hz))), false),
        (Box::new(pd(low_pass(above_hz))), true),
        (Box::new(pd(switched(below_hz))), false),
        (Box::new(pd(switched(above_hz))), true),
        (Box::new(feedforward(low_pass(below_hz))), false),
        (Box::new(feedforward(low_pass(above_hz))), true),
        (Box::new(feedforward(switched(above_hz))), true),
        (Box::new(around(pd(low_pass(above_hz)))), true),
    ];
    for (mut law, is_told) in laws {
        let found = overreach(law.as_mut(), &model, n).unwrap();
        assert_eq!(found.is_some(), is_told, "{} {found:?}", law.describe());
        if let Some(found) = found {
            assert!((found.critical_hz - critical_hz).abs() < 0.01 * critical_hz, "{found:?}");
            assert!((found.cutoff_hz - above_hz).abs() < 1e-6, "{found:?}");
            let line = found.to_string();
            for hz in [found.critical_hz, found.cutoff_hz] {
                assert!(line.contains(&format!("{hz:.3} Hz")), "{line}");
            }
        }
    }
    // The inverse of a correct model learns at every frequency.
    let mut inverse = ModelInverse::new(&model, n, 0.5, low_pass(200.0)).unwrap();
    assert_eq!(overreach(&mut inverse, &model, n).unwrap(), None);
}

//! Tests over all laws under model mismatch, against dense singular values.
//!
//! The dense matrices come from the law's own updates and the model's Markov parameters, and share
//! nothing else with the analysis.

use nalgebra::{DMatrix, DVector};

use super::question::structured;
use super::{Analysis, Method, Question, Uncertainty, analyze};
use crate::learning::analysis::iteration::Iteration;
use crate::learning::gate::{Gate, GateRule};
use crate::learning::ladder::{Ladder, LadderRule};
use crate::learning::law::adjoint::Adjoint;
use crate::learning::law::constrained::{Bound, Bounds, Constrained};
use crate::learning::law::dynamic::{DynamicNormOptimal, InputWeights};
use crate::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use crate::learning::law::model_inverse::ModelInverse;
use crate::learning::law::norm_optimal::{Cost, NormOptimal, Weights};
use crate::learning::law::pd::{Pd, PdGains};
use crate::learning::law::q_filter::QFilter;
use crate::learning::law::through_jacobian::ThroughJacobian;
use crate::learning::weights::{Dynamic, FilteredInput, Pass, Weight, band};
use crate::learning::{Law, Result, Surrogate};
use crate::model::{Method as Hold, StateSpace, TimeVarying, discretize, second_order};
use crate::signal::{FirFilter, GaussianFilter, Segment, SwitchedFilter, butterworth};

const DT_S: f64 = 1e-3;

fn axis(hz: f64, damping: f64) -> StateSpace {
    let model = second_order(std::f64::consts::TAU * hz, damping).unwrap();
    discretize(&model, DT_S, Hold::ZeroOrderHold).unwrap()
}

fn scaled(model: &StateSpace, gain: f64) -> StateSpace {
    let gain = StateSpace::static_gain(DMatrix::from_element(1, 1, gain), Some(DT_S)).unwrap();
    model.series(&gain).unwrap()
}

fn low_pass(cutoff_hz: f64) -> QFilter {
    QFilter::ZeroPhase(butterworth(2, cutoff_hz, DT_S).unwrap())
}

/// A law without declared structure.
struct Silent(Box<dyn Law>);

impl Law for Silent {
    fn update(&mut self, u: &[f64], e: &[f64], next: &mut [f64]) -> Result {
        self.0.update(u, e, next)
    }
    fn reset(&mut self) {}
    fn describe(&self) -> String {
        self.0.describe()
    }
}

/// The laws for one axis, each for runs of `n` samples.
fn laws(model: &StateSpace, n: usize) -> Vec<(&'static str, Box<dyn Law>)> {
    let w = |q, s, r, rate| Weights { q, s, r, rate };
    let optimal =
        |cost: Cost| -> Box<dyn Law> { Box::new(NormOptimal::new(model, n, cost).unwrap()) };
    let pd = |filter: QFilter| -> Box<dyn Law> {
        Box::new(Pd::new(PdGains { kp: 0.4, kd: 0.2, lead_samples: 2 }, n, 1, filter).unwrap())
    };
    let varying: Vec<f64> = (0..n).map(|k| if k % 97 < 60 { 1.0 } else { 0.05 }).collect();
    let effort: Vec<f64> = (0..n).map(|k| 0.02 + 0.3 * (k as f64 / n as f64)).collect();
    let along = TimeVarying::new(
        (0..n).map(|k| scaled(model, 1.0 + 0.3 * (k as f64 / n as f64))).collect(),
    )
    .unwrap();
    let sections =
        [(0, 30.0), (n / 3, 90.0)].map(|(start, cutoff_hz)| Segment { start, cutoff_hz });
    let weighing = Dynamic::new(axis(120.0, 0.9)).unwrap();
    let bounds = Bounds { input: Some(Bound::within(-1e-6, 1e-6)), ..Bounds::default() };
    vec![
        ("s and r", optimal(w(1.0, 0.05, 0.5, 0.0).into())),
        ("r", optimal(w(1.0, 0.0, 0.1, 0.0).into())),
        ("rate", optimal(w(1.0, 0.0, 0.0, 3.0).into())),
        ("all", optimal(w(2.0, 0.01, 0.05, 1.0).into())),
        (
            "weights that vary",
            optimal(Cost {
                q: Weight::PerSample(varying),
                s: Weight::Scalar(0.01),
                r: Weight::PerSample(effort),
                rate: 0.7,
            }),
        ),
        (
            "a model that varies",
            Box::new(NormOptimal::new(&along, n, w(1.0, 0.02, 0.2, 0.5)).unwrap()),
        ),
        (
            "dynamic",
            Box::new(DynamicNormOptimal::new(model, n, &weighing, w(1.0, 0.02, 0.3, 0.0)).unwrap()),
        ),
        ("dynamic, of input and change", filtered_inputs(model, n)),
        ("bounded", Box::new(Constrained::new(model, n, w(1.0, 0.02, 0.4, 0.0), bounds).unwrap())),
        (
            "gate and ladder",
            Box::new(
                Gate::new(
                    Ladder::new(optimal(w(1.0, 0.05, 0.5, 0.0).into()), LadderRule::new(1))
                        .unwrap(),
                    GateRule::default(),
                )
                .unwrap(),
            ),
        ),
        (
            "through a Jacobian",
            Box::new(
                ThroughJacobian::new(
                    optimal(w(1.0, 0.05, 0.5, 0.0).into()),
                    &[DMatrix::from_element(1, 1, -0.8)],
                )
                .unwrap(),
            ),
        ),
        ("adjoint", Box::new(Adjoint::new(model, n, None, QFilter::None).unwrap())),
        ("adjoint, filtered", Box::new(Adjoint::new(model, n, None, low_pass(60.0)).unwrap())),
        ("inverse", Box::new(ModelInverse::new(model, n, 0.3, low_pass(25.0)).unwrap())),
        ("pd", pd(QFilter::None)),
        ("pd, zero phase", pd(low_pass(30.0))),
        ("pd, causal", pd(QFilter::Causal(butterworth(2, 60.0, DT_S).unwrap()))),
        ("pd, Gaussian", pd(QFilter::Gaussian(GaussianFilter::new(40.0, DT_S).unwrap()))),
        ("pd, FIR", pd(QFilter::Fir(FirFilter::new(&[0.25, 0.5, 0.25]).unwrap()))),
        (
            "pd, switched",
            pd(QFilter::Switched(SwitchedFilter::new(2, &sections, 20, DT_S).unwrap())),
        ),
        (
            "feed-forward",
            Box::new(
                ErrorFeedforward::new(
                    Feedforward { gain_per_s: 0.4, lead_samples: 3, input_max: 1e-7 },
                    n,
                    1,
                    low_pass(40.0),
                )
                .unwrap(),
            ),
        ),
        ("silent", Box::new(Silent(optimal(w(1.0, 0.05, 0.5, 0.0).into())))),
    ]
}

/// A low-pass weight of the error, a high-pass weight of the input and another one of its change.
fn filtered_inputs(model: &StateSpace, n: usize) -> Box<dyn Law> {
    let n_axes = model.n_inputs();
    let high = |hz: f64, weight: f64| {
        let filter = band(Pass::High, (2, hz), DT_S, n_axes).unwrap();
        Some(FilteredInput::new(filter, Weight::Scalar(weight)).unwrap())
    };
    let error = Dynamic::new(band(Pass::Low, (1, 120.0), DT_S, n_axes).unwrap()).unwrap();
    let inputs = InputWeights { input: high(60.0, 0.2), change: high(25.0, 0.7) };
    let weights = Weights { q: 1.0, s: 0.01, r: 0.05, rate: 0.4 };
    Box::new(DynamicNormOptimal::with_inputs(model, n, (&error, &inputs), weights).unwrap())
}

/// Axes that differ from the model: gain, sign, frequency and damping, delay.
fn axes(model: &StateSpace) -> Vec<(&'static str, StateSpace)> {
    vec![
        ("itself", model.clone()),
        ("gain", scaled(model, 1.6)),
        ("sign", scaled(model, -0.7)),
        ("resonance", axis(40.0, 0.03)),
        ("delay", model.delayed(2).unwrap()),
    ]
}

/// `T = L_u - L_e P` from the law's updates, without the omitted inputs.
fn dense(law: &mut dyn Law, plant: &StateSpace, n: usize, free: &[usize]) -> DMatrix<f64> {
    const SMALL: f64 = 1e-9;
    let (m, p) = (plant.n_inputs(), plant.n_outputs());
    let markov = plant.markov(n).unwrap();
    let (n_u, n_e) = (n * m, n * p);
    let mut offset = vec![0.0; n_u];
    law.reset();
    law.update(&vec![0.0; n_u], &vec![0.0; n_e], &mut offset).unwrap();
    let kept: Vec<usize> = (0..n_u).filter(|i| !free.contains(i)).collect();
    let mut t = DMatrix::zeros(kept.len(), kept.len());
    let mut next = vec![0.0; n_u];
    for (col, index) in kept.iter().enumerate() {
        let mut input = vec![0.0; n_u];
        input[*index] = SMALL;
        let (at, channel) = (index / m, index % m);
        let mut error = vec![0.0; n_e];
        for k in at..n {
            for row in 0..p {
                error[k * p + row] = -SMALL * markov[k - at][(row, channel)];
            }
        }
        law.reset();
        law.update(&input, &error, &mut next).unwrap();
        for (row, place) in kept.iter().enumerate() {
            t[(row, col)] = (next[*place] - offset[*place]) / SMALL;
        }
    }
    t
}

/// The largest singular value, from products with the dense matrix alone.
fn largest_singular(t: &DMatrix<f64>) -> f64 {
    (t.transpose() * t).symmetric_eigenvalues().max().sqrt()
}

fn free_of(law: &mut dyn Law, plant: &StateSpace, n: usize) -> Vec<usize> {
    Iteration::new(law, plant, n).unwrap().free().to_vec()
}

fn check(name: &str, found: &Analysis, expected: f64, radius: f64) {
    let factor = found.monotonic_factor.unwrap_or_else(|| panic!("{name}: no factor"));
    let apart = (factor.value - expected).abs();
    assert!(apart <= 1e-6 * expected, "{name}: {factor:?}, dense {expected}");
    assert!(found.spectral_radius.value <= factor.value, "{name}: {found:?}");
    assert!(
        radius <= factor.value * (1.0 + 1e-6),
        "{name}: radius {radius} above the factor {factor:?}"
    );
    if expected > 1.0 + 1e-6 {
        assert!(!found.monotonic, "{name}: {}", found.why);
    }
}

#[test]
fn every_law_on_other_axes_has_the_norm_of_its_dense_matrix() {
    let (model, n) = (axis(46.0, 0.05), 100);
    for (which, plant) in axes(&model) {
        for (law_name, mut law) in laws(&model, n) {
            let name = format!("{law_name} on {which}");
            let free = analysed_free(law.as_mut(), &plant, n);
            let t = dense_of(law.as_mut(), &plant, n, &free);
            let expected = largest_singular(&t);
            let found = analyze(law.as_mut(), &plant, n, &Question::default()).unwrap();
            // On its own model a law without `rate` needs no matrix.
            assert!(found.method == Method::Dense || which == "itself", "{name}");
            check(&name, &found, expected, found.spectral_radius.value);
            // The method for long runs, applied to the same run.
            let products = by_products(law.as_mut(), &plant, n);
            let apart = (products - expected).abs();
            assert!(apart <= 1e-6 * expected, "{name}: {products}, dense {expected}");
        }
    }
}

/// Runs a closure on the law's linear surrogate.
fn with_stand_in<T>(law: &mut dyn Law, look: &mut dyn FnMut(&mut dyn Law) -> T) -> T {
    match law.linear_surrogate() {
        Surrogate::Itself => {}
        Surrogate::Inside(inside) => return with_stand_in(inside, look),
        Surrogate::Unbounded(mut other) => return with_stand_in(other.as_mut(), look),
        Surrogate::Gradient { .. } => panic!("the gradient is that of the plant, not of the law"),
    }
    look(law)
}

fn analysed_free(law: &mut dyn Law, plant: &StateSpace, n: usize) -> Vec<usize> {
    with_stand_in(law, &mut |law| free_of(law, plant, n))
}

fn dense_of(law: &mut dyn Law, plant: &StateSpace, n: usize, free: &[usize]) -> DMatrix<f64> {
    with_stand_in(law, &mut |law| dense(law, plant, n, free))
}

fn by_products(law: &mut dyn Law, plant: &StateSpace, n: usize) -> f64 {
    with_stand_in(law, &mut |law| {
        let mut iteration = Iteration::new(law, plant, n).unwrap();
        structured(&mut iteration).unwrap().1.unwrap().value
    })
}

#[test]
fn no_law_of_this_package_is_without_a_transpose() {
    let (model, n) = (axis(46.0, 0.05), 150);
    for (which, plant) in axes(&model) {
        for (name, mut law) in laws(&model, n) {
            let has = with_stand_in(law.as_mut(), &mut |law| {
                Iteration::new(law, &plant, n).unwrap().has_transpose()
            });
            assert_eq!(has, name != "silent", "{name} on {which}");
        }
    }
}

/// The longest run with dense matrices, and the next one.
#[test]
fn nothing_changes_where_whole_matrices_end() {
    let model = axis(46.0, 0.05);
    let plant = axis(40.0, 0.03);
    let weights = Weights { q: 1.0, s: 0.05, r: 0.5, rate: 0.0 };
    for (n, method) in [(640, Method::Dense), (641, Method::Structured)] {
        let makes: [Box<dyn Law>; 3] = [
            Box::new(NormOptimal::new(&model, n, weights).unwrap()),
            Box::new(Silent(Box::new(NormOptimal::new(&model, n, weights).unwrap()))),
            Box::new(Adjoint::new(&model, n, None, low_pass(60.0)).unwrap()),
        ];
        for mut law in makes {
            let name = law.describe();
            let free = free_of(law.as_mut(), &plant, n);
            let expected = largest_singular(&dense(law.as_mut(), &plant, n, &free));
            let found = analyze(law.as_mut(), &plant, n, &Question::default()).unwrap();
            assert_eq!(found.method, method);
            check(&name, &found, expected, found.spectral_radius.value);
        }
    }
}

/// Two coupled axes; the law's model has neither the coupling nor the delay.
#[test]
fn coupled_axes_that_the_law_takes_for_separate_ones_are_seen() {
    let model = axis(46.0, 0.2).append(&axis(25.0, 0.4)).unwrap();
    let skew = DMatrix::from_row_slice(2, 2, &[1.1, 0.4, -0.3, 0.8]);
    let gain = StateSpace::static_gain(skew, Some(DT_S)).unwrap();
    let plant = model.series(&gain).unwrap().delayed(1).unwrap();
    let block = DMatrix::from_row_slice(2, 2, &[1.0, 0.4, 0.4, 0.6]);
    for n in [90, 330] {
        let w = Weights { q: 1.0, s: 0.02, r: 0.1, rate: 0.5 };
        let coupled = Cost { q: Weight::Block(block.clone()), ..w.into() };
        let laws: [Box<dyn Law>; 5] = [
            Box::new(NormOptimal::new(&model, n, w).unwrap()),
            filtered_inputs(&model, n),
            Box::new(NormOptimal::new(&model, n, coupled).unwrap()),
            Box::new(Adjoint::new(&model, n, None, QFilter::None).unwrap()),
            Box::new(
                Pd::new(PdGains { kp: 0.3, kd: 0.0, lead_samples: 4 }, n, 2, low_pass(15.0))
                    .unwrap(),
            ),
        ];
        for mut law in laws {
            let free = free_of(law.as_mut(), &plant, n);
            let expected = largest_singular(&dense(law.as_mut(), &plant, n, &free));
            let found = analyze(law.as_mut(), &plant, n, &Question::default()).unwrap();
            check(&law.describe(), &found, expected, found.spectral_radius.value);
        }
    }
}

/// Weights over many powers of ten, for the correct model and for a wrong one.
#[test]
fn small_and_large_weights_keep_their_digits() {
    let (model, n) = (axis(46.0, 0.3), 120);
    let plant = axis(42.0, 0.25);
    for exponent in [-8, -4, 0, 4] {
        let size = 10_f64.powi(exponent);
        for w in [
            Weights { q: 1.0, s: 0.0, r: size, rate: 0.0 },
            Weights { q: 1.0, s: size, r: 0.0, rate: 0.0 },
            Weights { q: 1.0, s: size, r: size, rate: size.sqrt() },
            Weights { q: 1.0, s: 0.0, r: 0.0, rate: size.sqrt() },
            Weights { q: size, s: 1e-3, r: 1.0, rate: 0.0 },
        ] {
            for plant in [&model, &plant] {
                let mut law = NormOptimal::new(&model, n, w).unwrap();
                let free = free_of(&mut law, plant, n);
                let expected = largest_singular(&dense(&mut law, plant, n, &free));
                let products = by_products(&mut law, plant, n);
                let apart = (products - expected).abs();
                assert!(apart <= 1e-6 * expected.max(1e-3), "{w:?}: {products}, dense {expected}");
            }
        }
    }
}

/// Converged error, noise and robustness, all with the true axes.
#[test]
fn the_other_figures_are_those_of_the_axes_too() {
    let (model, n) = (axis(46.0, 0.3), 200);
    let plant = scaled(&axis(42.0, 0.25), 1.2);
    let weights = Weights { q: 1.0, s: 0.02, r: 0.3, rate: 0.0 };
    let reference: Vec<f64> = (0..n).map(|k| 1.0 - (k as f64 / 30.0).cos()).collect();
    let question = Question {
        reference: Some(reference.clone()),
        uncertainty: Some(Uncertainty::Scalar(0.1)),
        noise_std: Some(1e-2),
        n_runs: 3,
    };
    let mut law = NormOptimal::new(&model, n, weights).unwrap();
    let found = analyze(&mut law, &plant, n, &question).unwrap();
    assert!(found.converges, "{}", found.why);
    let (mut input, mut next) = (vec![0.0; n], vec![0.0; n]);
    let mut error = reference.clone();
    for _ in 0..4000 {
        law.update(&input, &error, &mut next).unwrap();
        std::mem::swap(&mut input, &mut next);
        let y = plant.simulate(&input, None).unwrap();
        error = reference.iter().zip(&y).map(|(r, y)| r - y).collect();
    }
    let ends = found.converged_error.unwrap();
    let apart = ends.iter().zip(&error).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{apart:e}");
    // `|T| + w |L_e P|` from dense matrices.
    let free = free_of(&mut law, &plant, n);
    let t = dense(&mut law, &plant, n, &free);
    let lifted = plant.lifted(n).unwrap();
    let mut learn = DMatrix::zeros(n, n);
    for col in 0..n {
        let mut unit = vec![0.0; n];
        unit[col] = 1.0;
        law.update(&vec![0.0; n], &unit, &mut next).unwrap();
        learn.set_column(col, &DVector::from_column_slice(&next));
    }
    let share = (learn * lifted).view((0, 0), t.shape()).into_owned();
    let expected = largest_singular(&t) + 0.1 * largest_singular(&share);
    let bound = found.robust_lifted.unwrap();
    assert!((bound - expected).abs() < 1e-6 * expected, "{bound} {expected}");
}

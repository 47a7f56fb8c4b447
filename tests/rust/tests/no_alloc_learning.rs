//! A learning update does not allocate, whatever the law: it may run while the axes return.

#![expect(clippy::unwrap_used, reason = "set-up shared by the tests must not fail")]

use ilc_rt::learning::Law;
use ilc_rt::learning::gate::{Gate, GateRule};
use ilc_rt::learning::ladder::{Ladder, LadderRule};
use ilc_rt::learning::law::adjoint::Adjoint;
use ilc_rt::learning::law::constrained::{Bound, Bounds, Constrained};
use ilc_rt::learning::law::dynamic::DynamicNormOptimal;
use ilc_rt::learning::law::error_feedforward::{ErrorFeedforward, Feedforward};
use ilc_rt::learning::law::model_inverse::ModelInverse;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal, Paired, Weights};
use ilc_rt::learning::law::pd::{Pd, PdGains};
use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::law::relevance::{Relevance, RelevanceWeights, RunShape};
use ilc_rt::learning::sweep::{Form, Gains};
use ilc_rt::learning::weights::{Dynamic, Weight};
use ilc_rt::model::{Method, StateSpace, TimeVarying, discretize, second_order};
use ilc_rt::signal::{FirFilter, GaussianFilter, Segment, SwitchedFilter, butterworth};
use ilc_tests::catalogue::{Built, every_law};
use ilc_tests::counting::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const N_SAMPLES: usize = 1500;

fn axis(damping: f64) -> StateSpace {
    let model = second_order(94.0, damping).unwrap();
    discretize(&model, 4e-3, Method::ZeroOrderHold).unwrap()
}

fn allocations_of_an_update(law: &mut dyn Law) -> u64 {
    let input: Vec<f64> = (0..2 * N_SAMPLES).map(|k| (k as f64 * 0.37).sin()).collect();
    let error: Vec<f64> = (0..2 * N_SAMPLES).map(|k| (k as f64 * 0.11).cos()).collect();
    let mut next = vec![0.0; 2 * N_SAMPLES];
    let before = allocations();
    law.update(&input, &error, &mut next).unwrap();
    law.reset();
    let after = allocations();
    assert!(next.iter().all(|value| value.is_finite()) && next != input);
    after - before
}

#[test]
fn the_counter_counts() {
    let before = allocations();
    drop(std::hint::black_box(vec![0_u8; 100]));
    assert_eq!(allocations(), before + 1);
}

/// Updates of each law.
const UPDATES: usize = 4;

/// A law that remembers runs stores each one, and may allocate for it.
#[test]
fn no_law_of_the_catalogue_allocates_in_an_update() {
    for Built { learning, mut law, n_values } in every_law() {
        let input: Vec<f64> = (0..n_values).map(|k| 1e-6 * (k as f64 * 0.37).sin()).collect();
        let error: Vec<f64> = (0..n_values).map(|k| 1e-5 * (k as f64 * 0.11).cos()).collect();
        let mut next = vec![0.0; n_values];
        let remembers = law.n_disturbances().is_some();
        for update in 0..UPDATES {
            law.set_disturbance(&[20.0]);
            let before = allocations();
            law.update(&input, &error, &mut next).unwrap();
            let count = allocations() - before;
            assert!(count == 0 || remembers, "{count} in {update}: {learning}");
        }
        assert!(next.iter().all(|value| value.is_finite()) && next != input, "{learning}");
    }
}

#[test]
fn no_form_of_a_law_allocates_in_an_update() {
    let separate = axis(1.0).append(&axis(0.6).delayed(1).unwrap()).unwrap();
    // The second axis is coupled into the first one's output, so neither can be solved alone.
    let mut c = separate.c().clone();
    c[(0, 2)] = 0.1;
    let coupled = StateSpace::discrete(
        separate.a().clone(),
        separate.b().clone(),
        c,
        separate.d().clone(),
        4e-3,
    )
    .unwrap();
    let weights = Weights { q: 1.0, s: 0.0, r: 1e-6, rate: 3.0 };
    let sections = || butterworth(2, 50.0, 4e-3).unwrap();
    let gains = PdGains { kp: 1.0, kd: 3.25, lead_samples: 1 };
    let samples = TimeVarying::new(vec![separate.clone(); N_SAMPLES]).unwrap();
    let filter = Dynamic::new(axis(0.8).append(&axis(0.9)).unwrap()).unwrap();
    let filter = filter.with_plain(Weight::Scalar(0.1));
    let turning = (0..N_SAMPLES).map(|k| nalgebra::DMatrix::identity(2, 2) * (k as f64).cos());
    let turned = filter.clone().with_coupling(turning.collect()).unwrap();
    let mut laws: Vec<Box<dyn Law>> = vec![
        Box::new(DynamicNormOptimal::new(&separate, N_SAMPLES, &filter, weights).unwrap()),
        Box::new(DynamicNormOptimal::new(&separate, N_SAMPLES, &turned, weights).unwrap()),
        Box::new(NormOptimal::new(&separate, N_SAMPLES, contour()).unwrap()),
        Box::new(NormOptimal::new(&samples, N_SAMPLES, weights).unwrap()),
        Box::new(NormOptimal::new(&separate, N_SAMPLES, weights).unwrap()),
        Box::new(NormOptimal::new(&coupled, N_SAMPLES, weights).unwrap()),
    ];
    // The current input is twice the bound, so that the search has work to do.
    for model in [&separate, &coupled] {
        let bounds = Bounds { input: Some(Bound::within(-0.5, 0.5)), ..Bounds::default() };
        laws.push(Box::new(Constrained::new(model, N_SAMPLES, weights, bounds).unwrap()));
    }
    let segments = [(0, 10.0), (600, 50.0)].map(|(start, cutoff_hz)| Segment { start, cutoff_hz });
    let filters = [
        QFilter::None,
        QFilter::ZeroPhase(sections()),
        QFilter::Causal(sections()),
        QFilter::Gaussian(GaussianFilter::new(20.0, 4e-3).unwrap()),
        QFilter::Switched(SwitchedFilter::new(2, &segments, 50, 4e-3).unwrap()),
        QFilter::Fir(FirFilter::new(&[0.25, 0.5, 0.25]).unwrap()),
    ];
    for filter in filters {
        laws.push(Box::new(Pd::new(gains, N_SAMPLES, 2, filter.clone()).unwrap()));
        let rule = Feedforward { gain_per_s: 0.5, lead_samples: 1, input_max: 0.8 };
        laws.push(Box::new(ErrorFeedforward::new(rule, N_SAMPLES, 2, filter.clone()).unwrap()));
        laws.push(Box::new(Adjoint::new(&coupled, N_SAMPLES, None, filter.clone()).unwrap()));
        laws.push(Box::new(ModelInverse::new(&coupled, N_SAMPLES, 0.5, filter).unwrap()));
    }
    for law in &mut laws {
        assert_eq!(allocations_of_an_update(law.as_mut()), 0, "{}", law.describe());
    }
}

/// A weight that couples the axes, different at every sample.
fn contour() -> Cost {
    let block = |k: usize| {
        let (s, c) = (k as f64 * 0.01).sin_cos();
        nalgebra::DMatrix::from_row_slice(2, 2, &[c * c + 0.1, c * s, c * s, s * s + 0.1])
    };
    let q = Weight::Blocks((0..N_SAMPLES).map(block).collect());
    Cost { q, ..Weights { q: 1.0, s: 1e-3, r: 1e-2, rate: 0.0 }.into() }
}

#[test]
fn factorising_again_allocates_nothing() {
    let model = axis(1.0).append(&axis(0.6).delayed(1).unwrap()).unwrap();
    let paired = Paired::new(&model, N_SAMPLES, contour()).unwrap();
    for form in [Form::Joseph, Form::Cholesky, Form::SquareRoot] {
        let mut gains = Gains::with_form(&paired, paired.free_samples(), form).unwrap();
        let before = allocations();
        gains.refactor(&paired).unwrap();
        assert_eq!(allocations() - before, 0, "{form:?}");
    }
}

#[test]
fn what_goes_round_a_law_allocates_in_its_first_update_only() {
    let law = || {
        let gains = PdGains { kp: 1.0, kd: 0.0, lead_samples: 1 };
        Pd::new(gains, N_SAMPLES, 2, QFilter::None).unwrap()
    };
    let signal = |size: f64| -> Vec<f64> {
        (0..2 * N_SAMPLES).map(|k| size * (k as f64 * 0.11).cos()).collect()
    };
    let rule = GateRule { tolerance: 0.1, patience: 1, ..GateRule::default() };
    let laws: [Box<dyn Law>; 3] = [
        Box::new(Gate::new(law(), rule).unwrap()),
        Box::new(Ladder::new(law(), LadderRule::new(2)).unwrap()),
        Box::new(Gate::new(Ladder::new(law(), LadderRule::new(3)).unwrap(), rule).unwrap()),
    ];
    for mut law in laws {
        let (mut input, mut next) = (signal(0.0), signal(0.0));
        // Learn, improve, grow, roll back, hold, leave the tolerance.
        for (run, size) in [1.0, 0.5, 0.4, 0.9, 0.4, 0.05, 0.05, 0.9, 0.8].into_iter().enumerate() {
            let error = signal(size);
            let before = allocations();
            law.update(&input, &error, &mut next).unwrap();
            let count = allocations() - before;
            assert!(count == 0 || run == 0, "{count} in run {run} of {}", law.describe());
            input.copy_from_slice(&next);
        }
    }
}

#[test]
fn recall_allocates_nothing_within_its_capacity() {
    let shape =
        RunShape { n_samples: N_SAMPLES, n_inputs: 2, n_outputs: 2, n_disturbances: 2, dt_s: 4e-3 };
    for top in [None, Some(5)] {
        let gains = PdGains { kp: 1.0, kd: 0.0, lead_samples: 1 };
        let core = Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::None).unwrap());
        let weights = RelevanceWeights::default();
        let mut law = Relevance::new(core, shape, weights, top).unwrap().with_capacity(40);
        let (mut input, mut next) = (vec![0.0; 2 * N_SAMPLES], vec![0.0; 2 * N_SAMPLES]);
        for again in [false, true] {
            for run in 0..40 {
                let phase = f64::from(run);
                let error: Vec<f64> =
                    (0..2 * N_SAMPLES).map(|k| (phase + k as f64).cos()).collect();
                let before = allocations();
                law.set_disturbance(&[phase.sin(), 0.1 * phase]);
                law.update(&input, &error, &mut next).unwrap();
                assert_eq!(allocations() - before, 0, "run {run} with {top:?}, {again}");
                input.copy_from_slice(&next);
            }
            assert!(law.len() >= 39 && input.iter().all(|value| value.is_finite()));
            law.reset();
        }
    }
}

//! A learning update allocates nothing, whatever the law: it may run while the axes return.

#![expect(clippy::unwrap_used, reason = "set-up shared by the tests must not fail")]

use ilc_rt::learning::Law;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal, Paired, Weights};
use ilc_rt::learning::law::pd::{Pd, PdGains, QFilter};
use ilc_rt::learning::sweep::{Form, Gains};
use ilc_rt::learning::weights::Weight;
use ilc_rt::model::{Method, StateSpace, TimeVarying, discretize, second_order};
use ilc_rt::signal::butterworth;
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

#[test]
fn no_law_allocates_in_an_update() {
    let separate = axis(1.0).append(&axis(0.6).delayed(1).unwrap()).unwrap();
    // The second axis shows in the first one's output, so that neither can be solved alone.
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
    let gains = PdGains { kp: 1.0, kd: 3.25, lead: 1 };
    let samples = TimeVarying::new(vec![separate.clone(); N_SAMPLES]).unwrap();
    let mut laws: Vec<Box<dyn Law>> = vec![
        Box::new(NormOptimal::new(&separate, N_SAMPLES, contour()).unwrap()),
        Box::new(NormOptimal::new(&samples, N_SAMPLES, weights).unwrap()),
        Box::new(NormOptimal::new(&separate, N_SAMPLES, weights).unwrap()),
        Box::new(NormOptimal::new(&coupled, N_SAMPLES, weights).unwrap()),
        Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::None).unwrap()),
        Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::ZeroPhase(sections())).unwrap()),
        Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::Causal(sections())).unwrap()),
    ];
    for law in &mut laws {
        assert_eq!(allocations_of_an_update(law.as_mut()), 0, "{}", law.describe());
    }
}

/// A weight that couples the axes, another at every sample.
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

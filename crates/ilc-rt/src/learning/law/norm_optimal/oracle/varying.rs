//! Tests of time-varying weights and models, against the dense reference.

#![allow(
    clippy::decimal_bitwise_operands,
    clippy::float_cmp,
    clippy::cast_possible_truncation,
    reason = "bits that switch features of a case on, exact results, small counts"
)]

use nalgebra::DMatrix;
use proptest::prelude::*;

use super::super::{Cost, NormOptimal, Plant, Weights};
use super::dense::dense;
use super::{axis, difference, noise};
use crate::learning::sweep::Form;
use crate::learning::weights::Weight;
use crate::learning::{Law, LearningError};
use crate::model::{StateSpace, TimeVarying};

const FORMS: [Form; 3] = [Form::Joseph, Form::Cholesky, Form::SquareRoot];

fn matrix(rows: usize, cols: usize, seed: u32) -> DMatrix<f64> {
    DMatrix::from_row_slice(rows, cols, &noise(rows * cols, seed))
}

/// A positive definite block.
fn block(size: usize, seed: u32) -> DMatrix<f64> {
    let root = matrix(size, size, seed);
    &root * root.transpose() + DMatrix::identity(size, size) * 0.05
}

fn blocks(size: usize, n_samples: usize, seed: u32) -> Weight {
    let seeds = (0..n_samples).map(|k| seed ^ (k as u32 * 97 + 5));
    Weight::Blocks(seeds.map(|seed| block(size, seed)).collect())
}

/// Returns the largest difference from the reference over all forms.
fn worst<'a>(plant: impl Into<Plant<'a>>, n_samples: usize, cost: &Cost, seed: u32) -> f64 {
    let plant = plant.into();
    let (m, p) = (plant.at(0).n_inputs(), plant.at(0).n_outputs());
    let (u, e) = (noise(n_samples * m, seed), noise(n_samples * p, seed ^ 7));
    let expected = dense(plant, n_samples, cost.clone(), &u, &e);
    let of_form = |form| {
        let mut law = NormOptimal::with_form(plant, n_samples, cost.clone(), form).unwrap();
        let mut next = vec![f64::NAN; u.len()];
        law.update(&u, &e, &mut next).unwrap();
        difference(&next, &expected)
    };
    FORMS.into_iter().map(of_form).fold(0.0, f64::max)
}

#[test]
fn an_error_is_weighed_where_it_is_seen_by_hand() {
    // y[1] = v[0], y[2] = v[1]; v[0] = q[1] e[1] / (q[1] + r), v[1] = q[2] e[2] / (q[2] + r).
    let model = crate::model::from_transfer_function(&[1.0], &[1.0, 0.0], Some(1.0)).unwrap();
    let q = Weight::PerSample(vec![7.0, 1.0, 3.0]);
    let cost = Cost { q, r: Weight::Scalar(1.0), ..Weights::default().into() };
    let mut next = [0.0; 3];
    let mut law = NormOptimal::new(&model, 3, cost).unwrap();
    law.update(&[0.0; 3], &[99.0, 4.0, 8.0], &mut next).unwrap();
    assert!((next[0] - 2.0).abs() < 1e-14 && (next[1] - 6.0).abs() < 1e-14);
    assert_eq!(next[2], 0.0);
}

#[test]
fn a_block_over_two_channels_by_hand() {
    let model = StateSpace::static_gain(DMatrix::identity(2, 2), Some(1.0)).unwrap();
    let q = Weight::Block(DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]));
    let r = Weight::Block(DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, 1.0]));
    let cost = Cost { q, r, ..Weights::default().into() };
    let mut next = [0.0; 2];
    let mut law = NormOptimal::new(&model, 1, cost).unwrap();
    law.update(&[0.0; 2], &[1.0, 0.0], &mut next).unwrap();
    // (Q + R) v = Q e: [2 1; 1 3] v = [2; 1], so v = [1; 0].
    assert!((next[0] - 1.0).abs() < 1e-14 && next[1].abs() < 1e-14);
}

#[test]
fn a_coupling_weight_over_different_delays_is_exact() {
    let both = axis(94.0, 1.0, 4e-3).append(&axis(94.0, 0.6, 4e-3).delayed(3).unwrap()).unwrap();
    let n_samples = 120;
    for rate in [0.0, 3.0] {
        let cost = Cost {
            q: blocks(2, n_samples, 3),
            s: Weight::Scalar(1e-3),
            r: Weight::PerSample((0..n_samples).map(|k| 1e-2 * (1.0 + k as f64)).collect()),
            rate,
        };
        let worst = worst(&both, n_samples, &cost, 5);
        assert!(worst < 1e-11, "{worst:e}");
    }
}

#[test]
fn an_output_that_nothing_reaches_counts_through_its_coupling() {
    let c = DMatrix::from_row_slice(2, 1, &[1.0, 0.0]);
    let one = |value: f64| DMatrix::from_element(1, 1, value);
    let model = StateSpace::discrete(one(0.5), one(1.0), c, DMatrix::zeros(2, 1), 1.0).unwrap();
    let cost =
        Cost { q: Weight::Block(block(2, 4)), ..Weights { r: 0.1, ..Weights::default() }.into() };
    assert!(worst(&model, 20, &cost, 5) < 1e-13);
}

#[test]
fn a_model_without_weights_that_varies_is_inverted() {
    let samples = (0..80).map(|k| axis(80.0 + f64::from(k), 0.5, 2e-3)).collect();
    let model = TimeVarying::new(samples).unwrap();
    let worst = worst(&model, 80, &Weights::default().into(), 5);
    assert!(worst < 1e-10, "{worst:e}");
}

#[test]
fn a_varying_problem_without_solution_is_refused() {
    let outside =
        crate::model::from_transfer_function(&[0.5, -0.65], &[1.0, -1.1, 0.3], Some(1e-3)).unwrap();
    let model = TimeVarying::new(vec![outside; 300]).unwrap();
    let refused =
        |cost: Cost, n_samples: usize| NormOptimal::new(&model, n_samples, cost).unwrap_err();
    let plain = Cost::from(Weights::default());
    let line = refused(plain.clone(), 300).to_string();
    assert!(line.contains("zero outside the unit circle"), "{line}");
    assert!(matches!(refused(plain.clone(), 299), LearningError::Model(_)));
    let mut weights = vec![1.0; 300];
    weights[100..140].fill(0.0);
    let axis = TimeVarying::new(vec![axis(157.0, 0.5, 2e-3); 300]).unwrap();
    let gap = Cost { q: Weight::PerSample(weights), ..plain.clone() };
    let line = NormOptimal::new(&axis, 300, gap).unwrap_err().to_string();
    assert!(line.contains("does not determine the input at sample 138"), "{line}");
    for (cost, word) in [
        (Cost { q: Weight::Block(DMatrix::identity(2, 2)), ..plain.clone() }, "q at sample 0"),
        (Cost { s: Weight::PerSample(vec![1.0; 9]), ..plain.clone() }, "s at sample 0: 9 samples"),
        (Cost { r: Weight::PerSample(vec![-1.0; 300]), ..plain.clone() }, "r at sample 0: -1"),
        (Cost { rate: f64::NAN, ..plain }, "rate = NaN"),
    ] {
        let line = refused(cost, 300).to_string();
        assert!(line.contains(word), "{line}");
    }
}

/// Returns a weight of any form.
fn weight(size: usize, n_samples: usize, kind: usize, seed: u32) -> Weight {
    match kind {
        0 => Weight::Scalar(0.3),
        1 => Weight::PerSample(noise(n_samples, seed).iter().map(|x| x.abs() + 0.01).collect()),
        2 => Weight::Block(block(size, seed)),
        _ => blocks(size, n_samples, seed),
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(96))]

    #[test]
    fn any_problem_agrees_with_dense_algebra(
        (n, m, p) in (0..=16_usize, 1..=4_usize, 1..=4_usize),
        n_samples in 1..20_usize,
        is_varying in any::<bool>(),
        is_direct in any::<bool>(),
        delay in 0..3_usize,
        kinds in (0..4_usize, 0..5_usize, 0..4_usize),
        rate in prop::sample::select(vec![0.0, 0.3]),
        seed in any::<u32>(),
    ) {
        let sample = |k: u32| {
            let a = matrix(n, n, seed ^ k) * (2.2 / (n as f64).max(1.0));
            let d = matrix(p, m, seed ^ k ^ 3) * f64::from(u8::from(is_direct));
            StateSpace::discrete(a, matrix(n, m, seed ^ k ^ 1), matrix(p, n, seed ^ k ^ 2), d, 1e-3)
                .unwrap()
                .delayed(if n + delay * m <= 16 { delay } else { 0 })
                .unwrap()
        };
        let s = if kinds.1 == 4 { Weight::Scalar(0.0) } else { weight(m, n_samples, kinds.1, seed ^ 21) };
        let cost = Cost {
            q: weight(p, n_samples, kinds.0, seed ^ 20),
            s,
            r: weight(m, n_samples, kinds.2, seed ^ 22),
            rate,
        };
        let worst = if is_varying {
            let samples = (0..n_samples as u32).map(|k| sample(k * 64)).collect();
            worst(&TimeVarying::new(samples).unwrap(), n_samples, &cost, seed)
        } else {
            worst(&sample(0), n_samples, &cost, seed)
        };
        prop_assert!(worst < 1e-10, "{worst:e}");
    }
}

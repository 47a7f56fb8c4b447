//! Tests of the law against independent dense linear algebra, and against hand calculations.

mod dense;
mod double_double;
mod varying;

use nalgebra::DMatrix;
use proptest::prelude::*;

use super::{NormOptimal, Weights};
use crate::learning::sweep::Form;
use crate::learning::{Law, LearningError};
use crate::model::{Method, StateSpace, discretize, from_transfer_function, second_order};
use dense::dense;

/// Largest difference relative to the largest value.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    let scale = expected.iter().fold(0.0_f64, |scale, value| scale.max(value.abs()));
    let worst = found.iter().zip(expected).map(|(f, e)| (f - e).abs()).fold(0.0, f64::max);
    worst / scale
}

fn update(model: &StateSpace, n_samples: usize, w: Weights, u: &[f64], e: &[f64]) -> Vec<f64> {
    let mut next = vec![f64::NAN; u.len()];
    NormOptimal::new(model, n_samples, w).unwrap().update(u, e, &mut next).unwrap();
    next
}

/// Returns pseudo-random numbers, the same in every run.
fn noise(count: usize, seed: u32) -> Vec<f64> {
    let mut word = seed.wrapping_mul(2_654_435_761) | 1;
    (0..count)
        .map(|_| {
            word ^= word << 13;
            word ^= word >> 17;
            word ^= word << 5;
            f64::from(word) / f64::from(u32::MAX) - 0.5
        })
        .collect()
}

fn axis(w0: f64, damping: f64, dt_s: f64) -> StateSpace {
    discretize(&second_order(w0, damping).unwrap(), dt_s, Method::ZeroOrderHold).unwrap()
}

fn weights(q: f64, s: f64, r: f64, rate: f64) -> Weights {
    Weights { q, s, r, rate }
}

#[test]
fn one_state_two_samples_by_hand() {
    // y[1] = 2 v[0]: v[0] = 2 q e[1] / (4 q + r); v[1] has no effect and r keeps it at 0.
    let model = from_transfer_function(&[2.0], &[1.0, -0.5], Some(1.0)).unwrap();
    let next = update(&model, 2, weights(3.0, 0.0, 4.0, 0.0), &[10.0, 20.0], &[99.0, 8.0]);
    assert!((next[0] - (10.0 + 48.0 / 16.0)).abs() < 1e-14 && (next[1] - 20.0).abs() < 1e-14);
}

#[test]
fn without_penalty_the_last_sample_stays_and_the_rest_inverts() {
    // y[1] = v[0], y[2] = v[1] + v[0] / 2.
    let model = from_transfer_function(&[1.0], &[1.0, -0.5], Some(1.0)).unwrap();
    let next = update(&model, 3, Weights::default(), &[0.0, 0.0, 7.0], &[99.0, 4.0, 3.0]);
    assert_eq!(next, [4.0, 1.0, 7.0]);
}

#[test]
fn a_rate_penalty_alone_holds_the_last_useful_change() {
    // y[1] = v[0] and nothing else is penalised: v[0] = e[1], v[1] = v[0] is free.
    let model = from_transfer_function(&[1.0], &[1.0, -0.5], Some(1.0)).unwrap();
    let next = update(&model, 2, weights(1.0, 0.0, 0.0, 3.0), &[0.0, 1.0], &[99.0, 4.0]);
    assert!((next[0] - 4.0).abs() < 1e-13 && (next[1] - 5.0).abs() < 1e-13);
}

#[test]
fn an_input_penalty_pulls_the_samples_that_reach_nothing_to_zero() {
    // min s (u + v)^2 + r v^2 at the last sample: v = -s u / (s + r).
    let model = from_transfer_function(&[1.0], &[1.0, -0.5], Some(1.0)).unwrap();
    let next = update(&model, 2, weights(1.0, 1.0, 3.0, 0.0), &[0.0, 8.0], &[0.0, 0.0]);
    assert!((next[1] - 6.0).abs() < 1e-14);
}

#[test]
fn the_named_cases_agree_with_dense_algebra() {
    let loop_1_ms = axis(157.0, 0.5, 1e-3);
    let late = axis(157.0, 0.5, 2e-3).delayed(3).unwrap();
    let zero_outside =
        from_transfer_function(&[0.5, -0.65], &[1.0, -1.1, 0.3], Some(1e-3)).unwrap();
    let triple = from_transfer_function(&[1.0], &[1.0, 0.0, 0.0, 0.0], None).unwrap();
    let triple = discretize(&triple, 1.0, Method::ZeroOrderHold).unwrap();
    let feedthrough = from_transfer_function(&[1.0, 0.2], &[1.0, -0.8], Some(1e-3)).unwrap();
    let unstable = from_transfer_function(&[0.1, 0.05], &[1.0, -1.9, 0.8925], Some(1e-3)).unwrap();
    // If almost only `r` determines a direction of the input, few digits are left: the tolerance is
    // the rounding of a double times the condition number of the problem.
    for (name, model, w, tolerance) in [
        ("second order, r 1e-2", &loop_1_ms, weights(1.0, 0.0, 1e-2, 0.0), 1e-13),
        ("second order, r 1e-6", &loop_1_ms, weights(1.0, 0.0, 1e-6, 0.0), 1e-12),
        ("second order, r 1e-14", &loop_1_ms, weights(1.0, 0.0, 1e-14, 0.0), 1e-11),
        ("second order, inverse", &loop_1_ms, weights(1.0, 0.0, 0.0, 0.0), 1e-11),
        ("second order, rate 3", &loop_1_ms, weights(1.0, 0.0, 0.0, 3.0), 1e-12),
        ("second order, all", &loop_1_ms, weights(2.0, 0.1, 0.3, 3.0), 1e-13),
        ("late, rate 3", &late, weights(1.0, 0.0, 0.0, 3.0), 1e-12),
        ("late, s and r", &late, weights(1.0, 1e-3, 1e-2, 0.0), 1e-12),
        ("zero at 1.3, r 1e-2", &zero_outside, weights(1.0, 0.0, 1e-2, 0.0), 1e-12),
        ("zero at 1.3, r 1e-6", &zero_outside, weights(1.0, 0.0, 1e-6, 0.0), 1e-9),
        ("zero at 1.3, r 1e-10", &zero_outside, weights(1.0, 0.0, 1e-10, 0.0), 1e-5),
        ("triple integrator, r 1e-2", &triple, weights(1.0, 0.0, 1e-2, 0.0), 1e-12),
        ("triple integrator, r 1e-6", &triple, weights(1.0, 0.0, 1e-6, 0.0), 1e-12),
        ("unstable, r 1e-2", &unstable, weights(1.0, 0.0, 1e-2, 0.0), 1e-12),
        ("unstable, inverse", &unstable, weights(1.0, 0.0, 0.0, 0.0), 1e-12),
        ("feedthrough, r 1e-2", &feedthrough, weights(1.0, 0.0, 1e-2, 0.0), 1e-13),
        ("feedthrough, inverse", &feedthrough, weights(1.0, 0.0, 0.0, 0.0), 1e-13),
    ] {
        let n_samples = 300;
        let (u, e) = (noise(n_samples, 1), noise(n_samples, 2));
        let expected = dense(model, n_samples, w, &u, &e);
        for form in [Form::Joseph, Form::Cholesky, Form::SquareRoot] {
            let mut found = vec![f64::NAN; n_samples];
            let mut law = NormOptimal::with_form(model, n_samples, w, form).unwrap();
            law.update(&u, &e, &mut found).unwrap();
            let worst = difference(&found, &expected);
            assert!(worst < tolerance, "{name}, {form:?}: {worst:e}");
        }
    }
    // The discrete triple integrator has a zero at -3.7: without penalty its inverse is unstable.
    let line = NormOptimal::new(&triple, 300, Weights::default()).unwrap_err().to_string();
    assert!(line.contains("zero outside the unit circle"), "{line}");
}

#[test]
fn axes_side_by_side_learn_as_if_alone() {
    let (x, y) = (axis(94.0, 1.0, 4e-3), axis(94.0, 0.6, 4e-3).delayed(1).unwrap());
    let both = x.append(&y).unwrap();
    let n_samples = 200;
    let w = weights(1.0, 1e-4, 1e-3, 3.0);
    let (u, e) = (noise(2 * n_samples, 3), noise(2 * n_samples, 4));
    let law = NormOptimal::new(&both, n_samples, w).unwrap();
    assert_eq!(law.n_parts(), 2);
    assert_eq!(law.n_states(), NormOptimal::new(&y, n_samples, w).unwrap().n_states());
    let found = update(&both, n_samples, w, &u, &e);
    assert!(difference(&found, &dense(&both, n_samples, w, &u, &e)) < 1e-11);
}

#[test]
fn learning_with_a_true_model_never_lets_the_error_grow() {
    let model = axis(157.0, 0.5, 2e-3);
    let n_samples = 400;
    let reference: Vec<f64> =
        (0..n_samples).map(|k| 0.05 * (1.0 - (k as f64 / 40.0).cos())).collect();
    let mut law = NormOptimal::new(&model, n_samples, weights(1.0, 0.0, 0.0, 3.0)).unwrap();
    let (mut input, mut next) = (vec![0.0; n_samples], vec![0.0; n_samples]);
    let mut norms = Vec::new();
    for _ in 0..30 {
        let command: Vec<f64> = reference.iter().zip(&input).map(|(r, u)| r + u).collect();
        let y = model.simulate(&command, None).unwrap();
        let error: Vec<f64> = reference.iter().zip(&y).map(|(r, y)| r - y).collect();
        norms.push(error.iter().map(|e| e * e).sum::<f64>().sqrt());
        law.update(&input, &error, &mut next).unwrap();
        std::mem::swap(&mut input, &mut next);
    }
    assert!(norms.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-12)), "{norms:?}");
    assert!(norms[29] < 0.02 * norms[0], "{norms:?}");
}

#[test]
fn problems_without_a_solution_are_refused_in_a_sentence() {
    let outside = from_transfer_function(&[0.5, -0.65], &[1.0, -1.1, 0.3], Some(1e-3)).unwrap();
    let line = NormOptimal::new(&outside, 300, Weights::default()).unwrap_err().to_string();
    assert!(line.contains("zero outside the unit circle"), "{line}");

    let wide = StateSpace::static_gain(DMatrix::from_element(1, 2, 1.0), Some(1.0)).unwrap();
    let line = NormOptimal::new(&wide, 300, Weights::default()).unwrap_err().to_string();
    assert!(line.contains("does not determine the input at sample"), "{line}");
    assert!(NormOptimal::new(&wide, 300, weights(1.0, 0.0, 1e-3, 0.0)).is_ok());

    // Reaches steady state within one sample, while the last samples may still be undetermined.
    let row = |values: &[f64]| DMatrix::from_row_slice(1, values.len(), values);
    let twins =
        StateSpace::discrete(row(&[0.5]), row(&[1.0, 1.0]), row(&[1.0]), row(&[0.0, 0.0]), 1.0);
    let line = NormOptimal::new(&twins.unwrap(), 300, Weights::default()).unwrap_err().to_string();
    assert!(line.contains("does not determine the input at sample"), "{line}");

    let model = axis(157.0, 0.5, 2e-3);
    for bad in [weights(-1.0, 0.0, 0.0, 0.0), weights(1.0, f64::NAN, 0.0, 0.0)] {
        assert!(matches!(NormOptimal::new(&model, 9, bad), Err(LearningError::Parameter { .. })));
    }
    assert!(matches!(
        NormOptimal::new(&model, 0, Weights::default()),
        Err(LearningError::Empty { what: "n_samples" })
    ));
    let continuous = second_order(157.0, 0.5).unwrap();
    assert!(NormOptimal::new(&continuous, 9, Weights::default()).is_err());
}

#[test]
fn wrong_signals_are_refused_one_at_a_time() {
    let mut law = NormOptimal::new(&axis(157.0, 0.5, 2e-3), 4, Weights::default()).unwrap();
    let (good, mut next) = ([0.0; 4], [0.0; 4]);
    assert!(law.update(&good[..3], &good, &mut next).is_err());
    assert!(law.update(&good, &good[..3], &mut next).is_err());
    assert!(law.update(&good, &good, &mut next[..3]).is_err());
    let bad = [0.0, f64::INFINITY, 0.0, 0.0];
    let line = law.update(&good, &bad, &mut next).unwrap_err().to_string();
    assert!(line.contains("error is inf at sample 1, channel 0"), "{line}");
    assert!(law.update(&bad, &good, &mut next).is_err());
    assert!(law.update(&good, &good, &mut next).is_ok());
}

/// A random stable model: coupled, with or without feedthrough, delayed or not.
fn random_model() -> impl Strategy<Value = StateSpace> {
    (1..5_usize, 1..4_usize, 1..4_usize, 0..3_usize, any::<bool>(), any::<u32>()).prop_map(
        |(n, m, p, delay, direct, seed)| {
            let matrix = |rows: usize, cols: usize, seed: u32| {
                DMatrix::from_row_slice(rows, cols, &noise(rows * cols, seed))
            };
            let a = matrix(n, n, seed) * (1.8 / n as f64);
            let d = if direct { matrix(p, m, seed ^ 3) } else { DMatrix::zeros(p, m) };
            StateSpace::discrete(a, matrix(n, m, seed ^ 1), matrix(p, n, seed ^ 2), d, 1e-3)
                .unwrap()
                .delayed(delay)
                .unwrap()
        },
    )
}

proptest! {
    #![proptest_config(ilc_cases::cases(96))]

    #[test]
    fn any_coupled_model_agrees_with_dense_algebra(
        model in random_model(),
        n_samples in 1..60_usize,
        s in prop::sample::select(vec![0.0, 1e-3, 1.0]),
        r in prop::sample::select(vec![1e-4, 1e-2, 1.0]),
        rate in prop::sample::select(vec![0.0, 0.3, 3.0]),
        seed in any::<u32>(),
    ) {
        let w = weights(1.0, s, r, rate);
        let u = noise(n_samples * model.n_inputs(), seed);
        let e = noise(n_samples * model.n_outputs(), seed ^ 7);
        let found = update(&model, n_samples, w, &u, &e);
        let worst = difference(&found, &dense(&model, n_samples, w, &u, &e));
        prop_assert!(worst < 1e-10, "{worst:e}");
    }
}

#[test]
fn whatever_is_not_finite_is_refused_wherever_it_is() {
    let (one, late) = (axis(157.0, 0.5, 1e-3), axis(157.0, 0.5, 1e-3).delayed(3).unwrap());
    let apart = one.append(&late).unwrap();
    let mixed = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.0, 1.0]);
    let coupled = apart.series(&StateSpace::static_gain(mixed, Some(1e-3)).unwrap()).unwrap();
    // The second output responds to no input: the law does not use its error.
    let deaf = DMatrix::from_row_slice(2, 1, &[1.0, 0.0]);
    let deaf = one.series(&StateSpace::static_gain(deaf, Some(1e-3)).unwrap()).unwrap();
    for (model, n_samples) in
        [(&one, 60), (&one, 2000), (&apart, 2000), (&coupled, 60), (&deaf, 60)]
    {
        for w in [weights(1.0, 0.0, 1e-2, 0.0), weights(1.0, 1e-3, 1e-2, 0.0)] {
            let mut law = NormOptimal::new(model, n_samples, w).unwrap();
            let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
            let mut next = vec![0.0; n_samples * n_inputs];
            let samples = (0..6).chain([n_samples / 2, n_samples - 2, n_samples - 1]);
            for (sample, value) in samples.zip([f64::NAN, f64::INFINITY, -f64::INFINITY].repeat(3))
            {
                for (what, n_channels) in [("input", n_inputs), ("error", n_outputs)] {
                    for channel in 0..n_channels {
                        let (mut u, mut e) =
                            (noise(n_samples * n_inputs, 1), noise(n_samples * n_outputs, 2));
                        let signal = if what == "input" { &mut u } else { &mut e };
                        signal[sample * n_channels + channel] = value;
                        let refused = law.update(&u, &e, &mut next).unwrap_err();
                        let told = format!("{refused:?}");
                        let expected = LearningError::NotFinite { what, sample, channel, value };
                        assert_eq!(told, format!("{expected:?}"));
                    }
                }
            }
            let (u, e) = (noise(n_samples * n_inputs, 1), noise(n_samples * n_outputs, 2));
            law.update(&u, &e, &mut next).unwrap();
        }
    }
}

//! Random problems with bounds of every kind.

#![allow(clippy::decimal_bitwise_operands, reason = "bits that switch features of a case on")]

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};

use super::super::{Bound, Bounds, Limit, Status};
use super::lifted::{differences, lift};
use super::{Case, cost, difference, noise};
use crate::learning::Law;
use crate::model::StateSpace;

/// A random stable model: coupled, with or without feedthrough, delayed or not.
fn random_model() -> impl Strategy<Value = StateSpace> {
    (1..4_usize, 1..3_usize, 1..3_usize, 0..3_usize, any::<bool>(), any::<u32>()).prop_map(
        |(n, m, p, delay, direct, seed)| {
            let matrix = |rows: usize, cols: usize, seed: u32| {
                DMatrix::from_row_slice(rows, cols, &noise(rows * cols, seed))
            };
            let a = matrix(n, n, seed) * (1.8 / n as f64);
            let d = if direct { matrix(p, m, seed ^ 3) } else { DMatrix::zeros(p, m) };
            StateSpace::discrete(a, matrix(n, m, seed ^ 1), matrix(p, n, seed ^ 2), d, 0.1)
                .unwrap()
                .delayed(delay)
                .unwrap()
        },
    )
}

/// Returns a random feasible problem: each bound is placed around the values of a random input.
fn random_case() -> impl Strategy<Value = Case> {
    (
        random_model(),
        2..40_usize,
        prop::sample::select(vec![0.0, 1e-2, 1.0]),
        prop::sample::select(vec![1e-3, 1e-1]),
        prop::sample::select(vec![0.0, 0.3]),
        any::<[bool; 6]>(),
        0.02..0.5_f64,
        any::<u32>(),
    )
        .prop_map(|(model, n_samples, s, r, rate, on, slack, seed)| {
            let (m, p, dt) = (model.n_inputs(), model.n_outputs(), model.dt_s().unwrap());
            let size = n_samples * m;
            let smooth = |seed: u32, count: usize, width: usize| {
                let rough = noise(count, seed);
                (0..count)
                    .map(|i| (0..4).map(|j| rough[i.saturating_sub(j * width)]).sum::<f64>() / 4.0)
                    .collect::<Vec<f64>>()
            };
            let inner = smooth(seed ^ 0xb, size, m);
            let u = smooth(seed ^ 0xc, size, m);
            let e = noise(n_samples * p, seed ^ 0xd);
            let reference = smooth(seed ^ 0xe, size, m);
            let output_reference = noise(n_samples * p, seed ^ 0xf);
            let around = |on: bool, values: DVector<f64>, room: f64| {
                let side = |sign: f64| {
                    Limit::Full(values.iter().map(|value| value + sign * room).collect())
                };
                on.then(|| Bound { lower: side(-1.0), upper: side(1.0) })
            };
            let inside = DVector::from_column_slice(&inner);
            let change = DVector::from_fn(size, |i, _| inner[i] - u[i]);
            let setpoint =
                DVector::from_fn(size, |i, _| inner[i] + reference[i] - reference[i % m]);
            let output = model.lifted(n_samples).unwrap() * &change
                + DVector::from_fn(n_samples * p, |i, _| output_reference[i] - e[i]);
            let bounds = Bounds {
                input: around(on[0], inside.clone(), slack),
                change: around(on[1], change, 1.5 * slack),
                step: around(on[2], differences(n_samples, m, 1) * inside, slack),
                velocity: around(
                    on[3],
                    differences(n_samples, m, 1) * &setpoint / dt,
                    1.2 * slack / dt,
                ),
                acceleration: around(
                    on[4],
                    differences(n_samples, m, 2) * &setpoint / (dt * dt),
                    slack / (dt * dt),
                ),
                output: around(on[5], output, slack),
                reference: Some(reference),
                output_reference: Some(output_reference),
                ..Bounds::default()
            };
            Case { model, n_samples, cost: cost(1.0, s, r, rate), bounds, u, e }
        })
}

/// Draws the problem of a number.
fn drawn(number: u64) -> Case {
    let mut seed = [0; 32];
    seed[..8].copy_from_slice(&number.to_le_bytes());
    let rng = TestRng::from_seed(RngAlgorithm::ChaCha, &seed);
    let mut runner = TestRunner::new_with_rng(ProptestConfig::default(), rng);
    random_case().new_tree(&mut runner).unwrap().current()
}

#[test]
fn problems_that_lead_corrections_round_in_a_circle_are_solved() {
    // Found among half a million random ones: the first eight never converge with Mehrotra's steps
    // alone, the others did not with a guard against short steps only.
    for number in [
        15_714, 17_897, 35_956, 37_593, 48_515, 60_030, 73_952, 96_413, 103_315, 286_875, 420_362,
        478_582, 498_384,
    ] {
        let next = drawn(number).prove(&format!("problem {number}"));
        assert!(next.iter().all(|value| value.is_finite()));
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(400))]

    #[test]
    fn no_bound_is_ever_exceeded(case in random_case()) {
        let (next, law) = case.update();
        let Case { model, n_samples, cost, bounds, u, e } = &case;
        prop_assert_eq!(law.status(), Status::Solved);
        let lifted = lift(model, *n_samples, cost, bounds, u, e);
        let v = DVector::from_fn(u.len(), |i, _| next[i] - u[i]);
        prop_assert!(lifted.excess(&v) < 1e-9, "{:e}", lifted.excess(&v));
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(100))]

    #[test]
    fn random_problems_agree_with_the_other_solver(case in random_case()) {
        let (next, law) = case.update();
        prop_assert_eq!(law.status(), Status::Solved);
        let Case { model, n_samples, cost, bounds, u, e } = &case;
        let lifted = lift(model, *n_samples, cost, bounds, u, e);
        let v = DVector::from_fn(u.len(), |i, _| next[i] - u[i]);
        let other = lifted.solve();
        prop_assume!(other.is_some());
        let other = other.unwrap();
        let expected: Vec<f64> = other.iter().zip(u).map(|(v, u)| u + v).collect();
        let (j, best) = (lifted.cost(&v), lifted.cost(&other));
        prop_assert!((j - best).abs() < 1e-7 * best, "cost {j:e} {best:e}");
        prop_assert!(difference(&next, &expected) < 1e-7, "{:e}", difference(&next, &expected));
        prop_assert!(lifted.stationarity(&v) < 1e-6, "{:e}", lifted.stationarity(&v));
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(200))]

    #[test]
    fn from_the_last_solution_the_next_problem_is_solved_as_well(
        case in random_case(),
        sizes in proptest::collection::vec(-3.0..0.0_f64, 4),
    ) {
        let mut law = case.law();
        let Case { model, n_samples, cost, bounds, u, e } = &case;
        let mut next = u.clone();
        law.update(u, e, &mut next).unwrap();
        let mut error = e.clone();
        for (seed, size) in (1..).zip(sizes) {
            // From nearly the same problem to another one.
            let noise = noise(e.len(), seed);
            let scale = 10.0_f64.powf(size) * e.iter().fold(0.0_f64, |most, e| most.max(e.abs()));
            for (error, noise) in error.iter_mut().zip(&noise) {
                *error += scale * noise;
            }
            law.update(u, &error, &mut next).unwrap();
            let mut fresh = case.law();
            let mut expected = u.clone();
            fresh.update(u, &error, &mut expected).unwrap();
            prop_assert_eq!(law.status(), fresh.status());
            if law.status() != Status::Solved {
                // Another error moves the bounds of the output: there may be no input within them.
                continue;
            }
            let lifted = lift(model, *n_samples, cost, bounds, u, &error);
            let v = DVector::from_fn(u.len(), |i, _| next[i] - u[i]);
            prop_assert!(lifted.excess(&v) < 1e-9, "{:e}", lifted.excess(&v));
            prop_assert!(lifted.stationarity(&v) < 1e-6, "{:e}", lifted.stationarity(&v));
            let other = DVector::from_fn(u.len(), |i, _| expected[i] - u[i]);
            let (j, best) = (lifted.cost(&v), lifted.cost(&other));
            prop_assert!((j - best).abs() < 1e-7 * best, "cost {j:e} {best:e}");
            prop_assert!(difference(&next, &expected) < 1e-6, "{:e}", difference(&next, &expected));
        }
    }
}

//! Tests of the law against an active-set method on the dense, lifted problem, against its
//! optimality (KKT) conditions, and against hand calculations.

#![allow(
    clippy::unnecessary_wraps,
    clippy::manual_range_contains,
    reason = "as the bounds are given"
)]

mod active_set;
mod lifted;
mod random;

use nalgebra::{DMatrix, DVector};

use super::{Bound, Bounds, BoundsError, Constrained, Limit, Status};
use crate::learning::law::norm_optimal::{Cost, NormOptimal, Weights};
use crate::learning::weights::Weight;
use crate::learning::{Law, LearningError};
use crate::model::{Method, StateSpace, discretize, from_transfer_function, second_order};

use lifted::lift;

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

fn cost(q: f64, s: f64, r: f64, rate: f64) -> Cost {
    Cost { q: Weight::Scalar(q), s: Weight::Scalar(s), r: Weight::Scalar(r), rate }
}

#[expect(clippy::unnecessary_wraps, reason = "bounds are optional wherever it is called")]
fn within(size: f64) -> Option<Bound> {
    Some(Bound::within(-size, size))
}

/// Largest difference relative to the largest value.
fn difference(found: &[f64], expected: &[f64]) -> f64 {
    let scale = expected.iter().fold(1e-300_f64, |scale, value| scale.max(value.abs()));
    found.iter().zip(expected).map(|(f, e)| (f - e).abs()).fold(0.0, f64::max) / scale
}

#[derive(Debug)]
struct Case {
    model: StateSpace,
    n_samples: usize,
    cost: Cost,
    bounds: Bounds,
    u: Vec<f64>,
    e: Vec<f64>,
}

impl Case {
    fn law(&self) -> Constrained {
        Constrained::new(&self.model, self.n_samples, self.cost.clone(), self.bounds.clone())
            .unwrap()
    }

    fn update(&self) -> (Vec<f64>, Constrained) {
        let mut law = self.law();
        let mut next = vec![f64::NAN; self.u.len()];
        law.update(&self.u, &self.e, &mut next).unwrap();
        (next, law)
    }

    /// Compares with the other solver and checks the optimality conditions; returns the input.
    fn prove(&self, name: &str) -> Vec<f64> {
        let (next, law) = self.update();
        assert_eq!(law.status(), Status::Solved, "{name}");
        let lifted = lift(&self.model, self.n_samples, &self.cost, &self.bounds, &self.u, &self.e);
        let v = DVector::from_fn(next.len(), |i, _| next[i] - self.u[i]);
        let other = lifted.solve().unwrap_or_else(|| panic!("{name}: no other solution"));
        let expected: Vec<f64> = other.iter().zip(&self.u).map(|(v, u)| u + v).collect();
        let (j, best) = (lifted.cost(&v), lifted.cost(&other));
        let worst = difference(&next, &expected);
        let slope = lifted.stationarity(&v);
        assert!((j - best).abs() < 1e-7 * best, "{name}: cost {j:e} against {best:e}");
        assert!(worst < 1e-6, "{name}: input differs by {worst:e}");
        assert!(lifted.excess(&v) < 1e-9, "{name}: excess {:e}", lifted.excess(&v));
        assert!(slope < 1e-6, "{name}: slope {slope:e}");
        next
    }
}

fn haas(n_samples: usize, bounds: Bounds) -> Case {
    let r: Vec<f64> = (0..n_samples).map(|k| 0.02 * (1.0 - (k as f64 / 9.0).cos())).collect();
    let e: Vec<f64> = (0..n_samples).map(|k| 3e-3 * (k as f64 / 9.0).sin()).collect();
    let bounds = Bounds { reference: Some(r), ..bounds };
    let u = vec![0.0; n_samples];
    let model = axis(157.0, 0.5, 2e-3);
    Case { model, n_samples, cost: cost(1.0, 0.0, 0.0, 3.0), bounds, u, e }
}

#[test]
fn one_sample_by_hand() {
    // y[1] is outside a run of one sample: min s (u + v)^2 + r v^2 = (4 + v)^2 + 3 v^2 gives v = -1
    // and u' = 3, unless a bound is tighter.
    let model = from_transfer_function(&[1.0], &[1.0, -0.5], Some(1.0)).unwrap();
    let cost = cost(1.0, 1.0, 3.0, 0.0);
    for (bounds, expected) in [
        (Bounds::default(), 3.0),
        (Bounds { input: within(2.5), ..Bounds::default() }, 2.5),
        (Bounds { change: within(0.25), ..Bounds::default() }, 3.75),
        (Bounds { step: within(2.0), ..Bounds::default() }, 2.0),
        (Bounds { position: within(3.5), reference: Some(vec![1.0]), ..Bounds::default() }, 2.5),
        (Bounds { velocity: within(1.5), reference: Some(vec![9.0]), ..Bounds::default() }, 1.5),
        (
            Bounds { acceleration: within(1.25), reference: Some(vec![9.0]), ..Bounds::default() },
            1.25,
        ),
    ] {
        let (u, e) = (vec![4.0], vec![99.0]);
        let case = Case { model: model.clone(), n_samples: 1, cost: cost.clone(), bounds, u, e };
        let (next, law) = case.update();
        assert_eq!(law.status(), Status::Solved, "{}", law.describe());
        assert!((next[0] - expected).abs() < 1e-8, "{}: {}", law.describe(), next[0]);
    }
}

#[test]
fn two_samples_by_hand() {
    // y[1] = v[0]: (e[1] - v[0])^2 asks for 4, the bound leaves 3; r holds the last one at 0.
    let model = from_transfer_function(&[1.0], &[1.0, -0.5], Some(1.0)).unwrap();
    let cost = cost(1.0, 0.0, 1e-9, 0.0);
    let case = |bounds| Case {
        model: model.clone(),
        n_samples: 2,
        cost: cost.clone(),
        bounds,
        u: vec![0.0; 2],
        e: vec![9.0, 4.0],
    };
    let (next, _) = case(Bounds { input: within(3.0), ..Bounds::default() }).update();
    assert!((next[0] - 3.0).abs() < 1e-8 && next[1].abs() < 1e-5, "{next:?}");
    // The predicted output at sample 1 is r - e + v[0] = 10 - 4 + v[0], at most 8.
    let output = Some(Bound::within(f64::NEG_INFINITY, 8.0));
    let reference = Some(vec![10.0; 2]);
    let (next, _) = case(Bounds { output, reference, ..Bounds::default() }).update();
    assert!((next[0] - 2.0).abs() < 1e-8, "{next:?}");
}

#[test]
fn bounds_that_are_not_reached_change_nothing() {
    let model = axis(157.0, 0.5, 2e-3).delayed(2).unwrap();
    let n_samples = 300;
    let (u, e) = (noise(n_samples, 1), noise(n_samples, 2));
    for w in [(1.0, 0.0, 0.0, 3.0), (1.0, 1e-3, 1e-2, 0.0), (2.0, 0.1, 0.3, 3.0)] {
        let weights = Weights { q: w.0, s: w.1, r: w.2, rate: w.3 };
        let mut expected = vec![0.0; n_samples];
        let mut plain = NormOptimal::new(&model, n_samples, weights).unwrap();
        plain.update(&u, &e, &mut expected).unwrap();
        for bounds in [
            Bounds::default(),
            Bounds {
                input: within(1e3),
                change: within(1e3),
                step: within(1e3),
                acceleration: within(1e9),
                output: within(1e3),
                reference: Some(vec![0.0; n_samples]),
                ..Bounds::default()
            },
        ] {
            let cost = cost(w.0, w.1, w.2, w.3);
            let (u, e) = (u.clone(), e.clone());
            let (next, law) = Case { model: model.clone(), n_samples, cost, bounds, u, e }.update();
            assert_eq!((law.status(), law.iterations()), (Status::Solved, 0));
            assert!(difference(&next, &expected) < 1e-8);
        }
    }
}

#[test]
fn wide_bounds_in_the_search_lead_to_the_plain_solution() {
    // One sample's bound is active, so that the search runs; the others are far away.
    let mut lower = vec![-1e3; 60];
    lower[59] = 0.0;
    let bound = Bound { lower: Limit::PerSample(lower), upper: Limit::Scalar(1e3) };
    let case = haas(60, Bounds { input: Some(bound), ..Bounds::default() });
    case.prove("one active bound");
}

#[test]
fn each_bound_alone_agrees_with_the_other_solver() {
    let open = Bounds::default;
    let plain = haas(80, open()).update().0;
    let largest = plain.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    for (name, bounds) in [
        ("input", Bounds { input: within(0.6 * largest), ..open() }),
        ("change", Bounds { change: within(0.3 * largest), ..open() }),
        ("step", Bounds { step: within(0.05 * largest), ..open() }),
        ("position", Bounds { position: Some(Bound::within(0.0, 0.0385)), ..open() }),
        ("velocity", Bounds { velocity: within(1.05), ..open() }),
        ("acceleration", Bounds { acceleration: within(120.0), ..open() }),
        ("output", Bounds { output: Some(Bound::within(-1e-3, 0.0395)), ..open() }),
    ] {
        let case = haas(80, bounds);
        let next = case.prove(name);
        assert!(difference(&next, &plain) > 1e-4, "{name} was never reached");
    }
}

#[test]
fn all_bounds_together_agree_with_the_other_solver() {
    let plain = haas(80, Bounds::default()).update().0;
    let largest = plain.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let case = haas(
        80,
        Bounds {
            input: within(0.8 * largest),
            change: within(0.7 * largest),
            step: within(0.2 * largest),
            position: Some(Bound::within(-1e-3, 0.0405)),
            velocity: within(1.1),
            acceleration: within(150.0),
            output: Some(Bound::within(-1e-3, 0.0402)),
            ..Bounds::default()
        },
    );
    case.prove("all");
}

#[test]
fn an_input_that_is_fixed_in_places_is_honoured() {
    let fixed = |k: usize| !(3..=70).contains(&k) || k == 40;
    let size = |k: usize| if fixed(k) { 0.0 } else { 0.01 };
    let bound = Bound {
        lower: Limit::PerSample((0..80).map(|k| -size(k)).collect()),
        upper: Limit::PerSample((0..80).map(size).collect()),
    };
    let next = haas(80, Bounds { input: Some(bound), ..Bounds::default() }).prove("fixed");
    assert!((0..80).filter(|k| fixed(*k)).all(|k| next[k].abs() <= 0.0));
}

#[test]
fn coupled_axes_with_weights_along_the_run_agree_with_the_other_solver() {
    let two = axis(94.0, 1.0, 4e-3).append(&axis(94.0, 0.6, 4e-3)).unwrap();
    let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.2, -0.1, 1.0]);
    let model = two.series(&StateSpace::static_gain(skew, Some(4e-3)).unwrap()).unwrap();
    let n_samples = 40;
    let contour: Vec<DMatrix<f64>> = (0..n_samples)
        .map(|k| {
            let (s, c) = (k as f64 * 0.1).sin_cos();
            DMatrix::from_row_slice(2, 2, &[s * s + 0.1, -s * c, -s * c, c * c + 0.1])
        })
        .collect();
    let cost = Cost { q: Weight::Blocks(contour), rate: 0.5, ..cost(1.0, 1e-3, 1e-3, 0.0) };
    let e: Vec<f64> = (0..2 * n_samples).map(|k| 0.1 * (k as f64 * 0.17).sin()).collect();
    let u = noise(2 * n_samples, 5).iter().map(|x| 0.02 * x).collect();
    let bounds = Bounds {
        input: Some(Bound {
            lower: Limit::PerChannel(vec![-0.05, -0.03]),
            upper: Limit::PerChannel(vec![0.04, f64::INFINITY]),
        }),
        acceleration: within(1500.0),
        output: within(0.12),
        reference: Some(vec![0.0; 2 * n_samples]),
        ..Bounds::default()
    };
    Case { model, n_samples, cost, bounds, u, e }.prove("coupled");
}

#[test]
fn starting_from_the_last_solution_is_faster_and_as_good() {
    let n_samples = 200;
    let plain = haas(n_samples, Bounds::default()).update().0;
    let largest = plain.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let bounds = Bounds {
        input: within(0.8 * largest),
        step: within(0.1 * largest),
        acceleration: within(150.0),
        ..Bounds::default()
    };
    let case = haas(n_samples, bounds);
    let mut law = case.law();
    let mut input = case.u.clone();
    let mut error = case.e.clone();
    let mut next = input.clone();
    let mut counts = Vec::new();
    for _ in 0..5 {
        law.update(&input, &error, &mut next).unwrap();
        let mut fresh = case.law();
        let mut expected = input.clone();
        fresh.update(&input, &error, &mut expected).unwrap();
        counts.push((law.iterations(), fresh.iterations()));
        assert!(difference(&next, &expected) < 1e-7);
        let change: Vec<f64> = next.iter().zip(&input).map(|(n, u)| n - u).collect();
        let effect = case.model.simulate(&change, None).unwrap();
        for (e, y) in error.iter_mut().zip(&effect) {
            *e -= 0.9 * y;
        }
        std::mem::swap(&mut input, &mut next);
    }
    let (warm, cold) = counts[2..].iter().fold((0, 0), |sums, (warm, cold)| {
        assert!(warm <= cold, "{counts:?}");
        (sums.0 + warm, sums.1 + cold)
    });
    assert!(3 * warm <= cold, "{counts:?}");
}

#[test]
fn bounds_that_contradict_each_other_are_refused_by_name() {
    let refused = |bounds: Bounds| {
        let case = haas(9, bounds);
        let told = Constrained::new(&case.model, 9, case.cost, case.bounds).unwrap_err();
        told.to_string()
    };
    let crossed = Some(Bound::within(1.0, -1.0));
    let told = refused(Bounds { velocity: crossed, ..Bounds::default() });
    assert!(
        told.contains("lower velocity bound 1 lies above the upper one -1 at sample 0"),
        "{told}"
    );
    let mut upper = vec![1.0; 9];
    upper[4] = f64::NAN;
    let nan = Bound { lower: Limit::Scalar(-1.0), upper: Limit::PerSample(upper) };
    let told = refused(Bounds { step: Some(nan), ..Bounds::default() });
    assert!(told.contains("upper step bound is NaN at sample 4"), "{told}");
    let told = refused(Bounds {
        input: Some(Bound::within(f64::INFINITY, f64::INFINITY)),
        ..Bounds::default()
    });
    assert!(told.contains("lower input bound is inf at sample 0"), "{told}");
    let told = refused(Bounds {
        input: within(1e-3),
        position: Some(Bound::within(-1.0, 0.005)),
        ..Bounds::default()
    });
    assert!(told.contains("input and position bounds leave no value"), "{told}");
    let short = Bound { lower: Limit::PerSample(vec![0.0; 8]), upper: Limit::Scalar(1.0) };
    let told = refused(Bounds { change: Some(short), ..Bounds::default() });
    assert!(told.contains("change holds 8 values; 9 samples"), "{told}");

    // From 0 before the run the input reaches 0.1 at sample 1 but not 0.3.
    let mut lower = vec![-1.0; 9];
    lower[1] = 0.3;
    let far = Bound { lower: Limit::PerSample(lower), upper: Limit::Scalar(1.0) };
    let told = refused(Bounds { input: Some(far), step: within(0.1), ..Bounds::default() });
    assert!(told.contains("at sample 1, channel 0") && told.contains("[-0.2, 0.2]"), "{told}");

    let case = haas(9, Bounds::default());
    let bounds = Bounds { output: within(1.0), ..Bounds::default() };
    let told = Constrained::new(&case.model, 9, case.cost, bounds).unwrap_err().to_string();
    assert!(told.contains("output bound needs the reference"), "{told}");
}

#[test]
fn an_input_from_which_the_bounds_cannot_be_honoured_is_kept() {
    let case = haas(9, Bounds { input: within(0.1), change: within(0.01), ..Bounds::default() });
    let mut law = case.law();
    let u = [0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut next = vec![f64::NAN; 9];
    law.update(&u, &case.e, &mut next).unwrap();
    assert!(
        matches!(law.status(), Status::Infeasible(BoundsError::OutOfReach { sample: 3, .. })),
        "{:?}",
        law.status()
    );
    assert_eq!(next, u);
    // Unreachable outputs are detected by the search.
    let case = haas(
        30,
        Bounds { output: Some(Bound::within(5.0, 6.0)), input: within(0.1), ..Bounds::default() },
    );
    let (next, law) = case.update();
    assert_eq!((law.status(), next), (Status::MaxIterations, case.u));
}

#[test]
fn wrong_signals_are_refused_one_at_a_time() {
    let mut law = haas(4, Bounds { input: within(1.0), ..Bounds::default() }).law();
    let (good, mut next) = ([0.0; 4], [0.0; 4]);
    assert!(law.update(&good[..3], &good, &mut next).is_err());
    assert!(law.update(&good, &good[..3], &mut next).is_err());
    assert!(law.update(&good, &good, &mut next[..3]).is_err());
    let bad = [0.0, f64::NAN, 0.0, 0.0];
    assert!(law.update(&bad, &good, &mut next).is_err());
    assert!(law.update(&good, &bad, &mut next).is_err());
    assert!(law.update(&good, &good, &mut next).is_ok());
    let twins = StateSpace::static_gain(DMatrix::from_element(1, 2, 1.0), Some(1.0)).unwrap();
    let told = Constrained::new(&twins, 9, Weights::default(), Bounds::default()).unwrap_err();
    assert!(matches!(told, LearningError::Undetermined { .. }), "{told}");
}

#[test]
fn the_law_describes_itself_as_json() {
    let bounds = Bounds {
        input: Some(Bound::within(-0.5, f64::INFINITY)),
        acceleration: within(20.0),
        ..Bounds::default()
    };
    let told: serde_json::Value = serde_json::from_str(&haas(9, bounds).law().describe()).unwrap();
    assert_eq!(told["law"], "constrained");
    assert_eq!(told["bounds"]["input"], serde_json::json!([-0.5, null]));
    assert_eq!(told["bounds"]["acceleration"], serde_json::json!([-20, 20]));
    assert_eq!(told["n_samples"], 9);
}

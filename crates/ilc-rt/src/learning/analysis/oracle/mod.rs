//! Tests of the figures against independent dense linear algebra, and against simulation.

mod refusals;

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::iteration::Iteration;
use super::question::structured;
use super::*;
use crate::learning::krylov::noise;
use crate::learning::law::norm_optimal::{NormOptimal, Weights};
use crate::learning::law::pd::{Pd, PdGains};
use crate::learning::law::q_filter::QFilter;
use crate::learning::{Law, Result};
use crate::model::{Method as Hold, StateSpace, discretize, from_transfer_function, second_order};
use crate::signal::butterworth;

fn axis(dt_s: f64) -> StateSpace {
    discretize(&second_order(94.2, 0.7).unwrap(), dt_s, Hold::ZeroOrderHold).unwrap()
}

/// The servo of \[barton2010\], Sec. 3.4: `P = G / (1 + 0.425 G)`.
fn servo() -> StateSpace {
    from_transfer_function(&[1.0, -0.5], &[1.0, -1.5, 0.7125], Some(1.0)).unwrap()
}

fn triangle() -> Vec<f64> {
    (0..401_i32).map(|k| f64::from(if k <= 200 { k } else { 400 - k }) / 200.0).collect()
}

fn weights(q: f64, s: f64, r: f64, rate: f64) -> Weights {
    Weights { q, s, r, rate }
}

fn close(found: f64, expected: f64, tolerance: f64) -> bool {
    (found - expected).abs() <= tolerance * expected.abs().max(1e-3)
}

/// `L_u`, `L_e` and `P` of a norm-optimal law in closed form; only inputs with an effect.
fn lifted_optimal(model: &StateSpace, n: usize, w: Weights) -> [DMatrix<f64>; 3] {
    let m = model.n_inputs();
    let p = model.lifted(n).unwrap();
    let n_u = p.ncols();
    let mut difference = DMatrix::zeros(n_u - m, n_u);
    for i in 0..n_u - m {
        difference[(i, i)] = -w.rate;
        difference[(i, i + m)] = w.rate;
    }
    let eye = DMatrix::<f64>::identity(n_u, n_u);
    let kept = p.transpose() * &p * w.q + &eye * w.r + difference.transpose() * difference;
    let h = (&kept + &eye * w.s).cholesky().unwrap();
    let learn = h.solve(&(p.transpose() * w.q));
    [h.solve(&kept), learn, p]
}

/// `L_u` and `L_e` of a law, by columns.
fn columns(law: &mut dyn Law, n_u: usize, n_e: usize) -> [DMatrix<f64>; 2] {
    let mut next = vec![0.0; n_u];
    let mut part = |count: usize, is_input: bool| {
        let mut matrix = DMatrix::zeros(n_u, count);
        for col in 0..count {
            let mut unit = vec![0.0; count];
            unit[col] = 1.0;
            if is_input {
                law.update(&unit, &vec![0.0; n_e], &mut next).unwrap();
            } else {
                law.update(&vec![0.0; n_u], &unit, &mut next).unwrap();
            }
            matrix.set_column(col, &DVector::from_column_slice(&next));
        }
        matrix
    };
    [part(n_u, true), part(n_e, false)]
}

fn largest_singular(matrix: &DMatrix<f64>) -> f64 {
    matrix.singular_values().max()
}

fn smallest_singular(matrix: &DMatrix<f64>) -> f64 {
    matrix.singular_values().min()
}

fn largest_eigenvalue(matrix: &DMatrix<f64>) -> f64 {
    matrix.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max)
}

/// Removes the last `late` inputs.
fn without(matrix: &DMatrix<f64>, late: usize) -> DMatrix<f64> {
    let n = matrix.nrows() - late;
    matrix.view((0, 0), (n, n)).into_owned()
}

#[test]
fn the_servo_example_agrees_with_its_equations() {
    let (model, n) = (servo(), 401);
    let reference = triangle();
    for w in
        [weights(1.0, 1.0, 1.0, 0.0), weights(0.1, 1.0, 1.0, 0.0), weights(1.0, 0.01, 5.0, 0.0)]
    {
        let question = Question {
            reference: Some(reference.clone()),
            noise_std: Some(1e-3),
            uncertainty: Some(Uncertainty::Scalar(0.3)),
            n_runs: 6,
        };
        let mut law = NormOptimal::new(&model, n, w).unwrap();
        let found = analyze(&mut law, &model, n, &question).unwrap();
        assert_eq!(found.method, Method::Dense);
        let [keep, learn, p] = lifted_optimal(&model, n, w);
        let t = &keep - &learn * &p;
        // s > 0: inputs without effect decay to zero, decoupled from the others.
        let cut = without(&t, 1);
        let factor = found.monotonic_factor.unwrap().value;
        assert!(close(factor, largest_singular(&cut), 1e-9));
        // Similar to the symmetric matrix M^(1/2) H^-1 M^(1/2), here with M = r I.
        let symmetric = (&cut + cut.transpose()) * 0.5;
        assert!(close(found.spectral_radius.value, symmetric.symmetric_eigenvalues().max(), 1e-9));
        assert!(found.converges && found.monotonic, "{}", found.why);
        // Eq. (3.22).
        let r = DVector::from_column_slice(&reference);
        let h = (p.transpose() * &p * w.q + DMatrix::identity(n, n) * w.s).cholesky().unwrap();
        let stays = &r - &p * h.solve(&(p.transpose() * &r * w.q));
        let error = found.converged_error.unwrap();
        let worst = stays.iter().zip(&error).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst:e}");
        // Covariance, run by run.
        let (mut sigma, mut u) = (DMatrix::zeros(n, n), DVector::zeros(n));
        for run in 0..6 {
            let e = &r - &p * &u;
            let variance = (&p * &sigma * p.transpose()).trace() * 1e-6;
            let rms = ((e.norm_squared() + variance) / n as f64 + 1e-6).sqrt();
            assert!(close(found.expected_rms[run], rms, 1e-9), "{run}");
            sigma = &t * &sigma * t.transpose() + &learn * learn.transpose();
            u = &t * u + &learn * &r;
        }
        let lifted = factor + 0.3 * largest_singular(&without(&(&learn * &p), 1));
        assert!(close(found.robust_lifted.unwrap(), lifted, 1e-9));
    }
}

#[test]
fn more_weight_of_the_error_and_less_of_the_input_leave_less_error() {
    // The results of figures 3.5 and 3.6 of the source.
    let (model, n) = (servo(), 401);
    let stays = |w: Weights| {
        let question = Question { reference: Some(triangle()), ..Question::default() };
        let mut law = NormOptimal::new(&model, n, w).unwrap();
        analyze(&mut law, &model, n, &question).unwrap().converged_error_rms.unwrap()
    };
    let by_q: Vec<f64> = [1.0, 0.5, 0.1, 0.001].map(|q| stays(weights(q, 1.0, 1.0, 0.0))).to_vec();
    assert!(by_q.windows(2).all(|pair| pair[0] < pair[1]), "{by_q:?}");
    let by_s: Vec<f64> = [0.01, 0.1, 1.0].map(|s| stays(weights(1.0, s, 1.0, 0.0))).to_vec();
    assert!(by_s.windows(2).all(|pair| pair[0] < pair[1]), "{by_s:?}");
    let slow = stays(weights(1.0, 1.0, 50.0, 0.0));
    assert!(close(slow, stays(weights(1.0, 1.0, 1.0, 0.0)), 1e-9), "r does not matter in the end");
}

#[test]
fn expected_errors_agree_with_many_simulated_campaigns() {
    let (model, n, std) = (servo(), 60, 0.05);
    let reference: Vec<f64> = triangle()[..n].to_vec();
    let mut law = NormOptimal::new(&model, n, weights(1.0, 0.1, 2.0, 0.0)).unwrap();
    let question = Question {
        reference: Some(reference.clone()),
        noise_std: Some(std),
        n_runs: 8,
        ..Question::default()
    };
    let found = analyze(&mut law, &model, n, &question).unwrap();
    let (n_campaigns, n_runs) = (1500, 60);
    let mut sums = [[0.0_f64; 2]; 60];
    for campaign in 0..n_campaigns {
        let (mut input, mut next) = (vec![0.0; n], vec![0.0; n]);
        for (run, sum) in sums.iter_mut().enumerate().take(n_runs) {
            // Twelve uniform numbers between -1 and 1 have variance 4.
            let draws = noise(12 * n, 1 + campaign * 100 + run as u64);
            let y = model.simulate(&input, None).unwrap();
            let error: Vec<f64> = (0..n)
                .map(|k| {
                    let d: f64 = draws[12 * k..12 * (k + 1)].iter().sum();
                    reference[k] - y[k] - std * d / 2.0
                })
                .collect();
            let square = error.iter().map(|e| e * e).sum::<f64>() / n as f64;
            sum[0] += square;
            sum[1] += square * square;
            law.update(&input, &error, &mut next).unwrap();
            std::mem::swap(&mut input, &mut next);
        }
    }
    let count = n_campaigns as f64;
    let check = |run: usize, expected: f64| {
        let mean = sums[run][0] / count;
        let spread = ((sums[run][1] / count - mean * mean) / count).sqrt();
        let off = (expected * expected - mean) / spread;
        assert!(off.abs() < 4.5, "run {run}: {off} standard errors");
    };
    for (run, expected) in found.expected_rms.iter().enumerate() {
        check(run, *expected);
    }
    check(n_runs - 1, found.expected_rms_limit.unwrap());
}

#[test]
fn the_usual_condition_does_not_make_the_error_fall() {
    let (model, n) = (axis(2e-3), 200);
    let first = model.markov(2).unwrap()[1][(0, 0)];
    let gains = PdGains { kp: 0.5 / first, kd: 0.4 / first, lead_samples: 1 };
    let mut law = Pd::new(gains, n, 1, QFilter::None).unwrap();
    let found = analyze(&mut law, &model, n, &Question::default()).unwrap();
    let condition = found.pd_condition.as_ref().unwrap();
    assert!(close(condition.factor, 0.1, 1e-9));
    assert!(close(condition.gain_range.unwrap().1, 2.0 / first, 1e-12));
    // The eigenvalues are the diagonal, yet single runs multiply the error.
    assert!(close(found.spectral_radius.value, 0.1, 1e-9));
    assert!(found.monotonic_factor.unwrap().value > 1.0);
    assert!(!found.monotonic);
    assert!(!found.converges && found.transient_growth > 1e3, "{}", found.why);
    assert!(found.critical_frequency_hz.is_some());
}

/// One law for each source of the adjoint.
fn laws(model: &StateSpace, n: usize) -> Vec<(&'static str, Box<dyn Law>)> {
    let m = model.n_inputs();
    let dt_s = model.dt_s().unwrap();
    let gains = PdGains { kp: 0.4, kd: 1.5, lead_samples: 2 };
    let filter = || butterworth(2, 0.05 / dt_s, dt_s).unwrap();
    let pd = |filter: QFilter| -> Box<dyn Law> { Box::new(Pd::new(gains, n, m, filter).unwrap()) };
    let optimal = |w: Weights| -> Box<dyn Law> { Box::new(NormOptimal::new(model, n, w).unwrap()) };
    vec![
        ("pd", pd(QFilter::None)),
        ("pd, zero phase", pd(QFilter::ZeroPhase(filter()))),
        ("pd, causal", pd(QFilter::Causal(filter()))),
        ("rate", optimal(weights(1.0, 0.0, 0.0, 3.0))),
        ("r", optimal(weights(1.0, 0.0, 0.05, 0.0))),
        ("s, r and rate", optimal(weights(2.0, 0.01, 0.05, 1.0))),
        ("s", optimal(weights(2.0, 0.01, 0.0, 0.0))),
    ]
}

#[test]
fn products_with_signals_give_what_whole_matrices_give() {
    let model = axis(2e-3).append(&axis(2e-3).delayed(1).unwrap()).unwrap();
    let n = 90;
    for (name, mut law) in laws(&model, n) {
        let [keep, learn] = columns(law.as_mut(), 2 * n, 2 * n);
        let t = keep - learn * model.lifted(n).unwrap();
        let mut iteration = Iteration::new(law.as_mut(), &model, n).unwrap();
        let kept: Vec<usize> = (0..2 * n).filter(|i| !iteration.free().contains(i)).collect();
        let cut = DMatrix::from_fn(kept.len(), kept.len(), |i, j| t[(kept[i], kept[j])]);
        let (radius, factor, _) = structured(&mut iteration).unwrap();
        let factor = factor.unwrap();
        let expected = largest_singular(&cut);
        assert!(close(factor.value, expected, 1e-9), "{name}: {factor:?} {expected}");
        assert!((factor.value - expected).abs() <= factor.error + 1e-12, "{name}: {factor:?}");
        if name != "pd" && name != "pd, causal" {
            // The others are far from normal: their computed eigenvalues are dominated by rounding.
            let expected = largest_eigenvalue(&cut);
            assert!(
                (radius.value - expected).abs() <= (10.0 * radius.error).max(1e-9),
                "{name}: {radius:?} {expected}"
            );
        }
        let dense = analyze(law.as_mut(), &model, n, &Question::default()).unwrap();
        assert!(close(dense.monotonic_factor.unwrap().value, expected, 1e-9), "{name}");
    }
}

#[test]
fn long_runs_agree_with_short_ones_of_the_same_law() {
    // Beyond the limit of dense matrices the same law has nearly the same figures.
    let model = axis(2e-3);
    let reference =
        |n: usize| -> Vec<f64> { (0..n).map(|k| 0.01 * (1.0 - (k as f64 / 60.0).cos())).collect() };
    let figures = |n: usize, w: Weights| {
        let mut law = NormOptimal::new(&model, n, w).unwrap();
        let question = Question {
            reference: Some(reference(n)),
            noise_std: Some(1e-3),
            ..Question::default()
        };
        analyze(&mut law, &model, n, &question).unwrap()
    };
    let w = weights(1.0, 1e-3, 0.2, 0.0);
    let (short, long) = (figures(600, w), figures(1200, w));
    assert_eq!((short.method, long.method), (Method::Dense, Method::Structured));
    let pair = |figure: fn(&Analysis) -> f64| (figure(&short), figure(&long));
    for (name, tolerance, (left, right)) in [
        ("radius", 1e-3, pair(|a| a.spectral_radius.value)),
        ("factor", 1e-3, pair(|a| a.monotonic_factor.unwrap().value)),
        ("noise", 1e-2, pair(|a| a.expected_rms_limit.unwrap())),
        ("stays", 0.1, pair(|a| a.converged_error_rms.unwrap() * (a.n_samples as f64).sqrt())),
    ] {
        assert!(close(left, right, tolerance), "{name}: {left} {right}");
    }
    // The result for the long run is a fixed point.
    let mut law = NormOptimal::new(&model, 1200, w).unwrap();
    let (input, error) = (long.converged_input.unwrap(), long.converged_error.unwrap());
    let mut next = vec![0.0; 1200];
    law.update(&input, &error, &mut next).unwrap();
    let moved = input.iter().zip(&next).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(moved < 1e-12, "{moved:e}");
}

#[test]
fn the_error_grows_at_least_as_much_as_in_the_worst_single_run() {
    // Both sides of the limit of dense matrices, for laws whose random errors fall at once.
    let model = axis(2e-3);
    for n in [90, 650] {
        for (name, mut law) in laws(&model, n) {
            let found = analyze(law.as_mut(), &model, n, &Question::default()).unwrap();
            let (growth, factor) = (found.transient_growth, found.monotonic_factor.unwrap());
            assert!(growth >= factor.value.max(1.0), "{name}, {n}: {growth} {factor:?}");
            assert!(name != "rate" || factor.value > 1.01, "{n}: {factor:?}");
        }
    }
}

#[test]
fn a_long_run_of_a_filtered_law_ends_where_its_fixed_point_says() {
    let (model, n) = (axis(2e-3), 1300);
    let gains = PdGains { kp: 0.5, kd: 0.0, lead_samples: 8 };
    let filter = QFilter::ZeroPhase(butterworth(2, 8.0, 2e-3).unwrap());
    let mut law = Pd::new(gains, n, 1, filter).unwrap();
    let reference: Vec<f64> = (0..n).map(|k| 0.01 * (1.0 - (k as f64 / 90.0).cos())).collect();
    let question = Question { reference: Some(reference.clone()), ..Question::default() };
    let found = analyze(&mut law, &model, n, &question).unwrap();
    assert!(found.converges, "{}", found.why);
    let (mut input, mut next) = (vec![0.0; n], vec![0.0; n]);
    let mut error = vec![0.0; n];
    for _ in 0..400 {
        let y = model.simulate(&input, None).unwrap();
        for k in 0..n {
            error[k] = reference[k] - y[k];
        }
        law.update(&input, &error, &mut next).unwrap();
        std::mem::swap(&mut input, &mut next);
    }
    let last = (error.iter().map(|e| e * e).sum::<f64>() / n as f64).sqrt();
    let expected = found.converged_error_rms.unwrap();
    assert!(close(expected, last, 1e-4), "{expected:e} {last:e}");
}

#[test]
fn the_critical_frequency_is_where_the_equation_crosses_one() {
    let (model, n, dt_s) = (axis(2e-3), 600, 2e-3);
    let gains = PdGains { kp: 0.5, kd: 0.0, lead_samples: 4 };
    let mut law = Pd::new(gains, n, 1, QFilter::None).unwrap();
    let found = analyze(&mut law, &model, n, &Question::default()).unwrap();
    // The first of |1 - kp z^lead P| > 1, from the impulse response.
    let parameters = model.markov(400).unwrap();
    let contraction = |hz: f64| {
        let z = nalgebra::Complex::from_polar(1.0, std::f64::consts::TAU * hz * dt_s);
        let p: nalgebra::Complex<f64> = parameters
            .iter()
            .enumerate()
            .map(|(k, h)| z.powi(-(i32::try_from(k).unwrap())) * h[(0, 0)])
            .sum();
        (nalgebra::Complex::new(1.0, 0.0) - z.powi(4) * p * 0.5).norm()
    };
    let low = (1..500).map(|k| 0.5 * f64::from(k)).find(|hz| contraction(*hz) > 1.0).unwrap();
    assert!(low > 5.0);
    let critical = found.critical_frequency_hz.unwrap();
    assert!((low - 0.6..low + 0.1).contains(&critical), "{critical} {low}");
    // With a filter below it the law is safe, and the learnable frequency is unchanged.
    let filter = QFilter::ZeroPhase(butterworth(2, 0.4 * low, dt_s).unwrap());
    let mut law = Pd::new(gains, n, 1, filter).unwrap();
    let filtered = analyze(&mut law, &model, n, &Question::default()).unwrap();
    assert_eq!(filtered.critical_frequency_hz, None);
    assert!((filtered.learnable_frequency_hz.unwrap() - critical).abs() < 0.1);
    assert!(filtered.converges, "{}", filtered.why);
}

#[test]
fn a_law_seen_from_outside_has_the_spectrum_of_its_equation() {
    let (one, dt_s) = (axis(2e-3), 2e-3);
    let model = one.append(&one.delayed(1).unwrap()).unwrap();
    let n = 700;
    for w in [weights(1.0, 0.01, 0.1, 0.0), weights(1.0, 0.05, 0.02, 0.5)] {
        let mut law = NormOptimal::new(&model, n, w).unwrap();
        let mut iteration = Iteration::new(&mut law, &model, n).unwrap();
        let seen = Spectrum::new(&mut iteration, &model).unwrap().unwrap();
        let equation = Spectrum::optimal(&model, w).unwrap();
        let expected: Vec<(f64, f64)> =
            equation.bins.iter().map(|bin| bin.frequency_hz).zip(equation.contraction()).collect();
        for (bin, found) in seen.bins.iter().zip(seen.contraction()) {
            let nearest = expected
                .iter()
                .min_by(|a, b| {
                    (a.0 - bin.frequency_hz).abs().total_cmp(&(b.0 - bin.frequency_hz).abs())
                })
                .unwrap();
            if (nearest.0 - bin.frequency_hz).abs() < 1e-6 / dt_s {
                assert!((found - nearest.1).abs() < 1e-3, "{}: {found}", bin.frequency_hz);
            }
        }
    }
}

#[test]
fn uncertainty_is_bounded_as_the_equations_say() {
    let (model, n) = (servo(), 200);
    let mut law = NormOptimal::new(&model, n, weights(1.0, 0.5, 2.0, 0.0)).unwrap();
    let ask = |law: &mut NormOptimal, w: Uncertainty| {
        let question = Question { uncertainty: Some(w), ..Question::default() };
        analyze(law, &model, n, &question).unwrap()
    };
    let none = ask(&mut law, Uncertainty::Scalar(0.0));
    let peak = none.contraction.iter().copied().fold(0.0, f64::max);
    assert!(close(none.robust_factor.unwrap(), peak, 1e-12));
    // (r + q |P|^2 w) / (q |P|^2 + s + r) < 1 for q |P|^2 (w - 1) < s: the peak of |P| decides.
    let allowed = none.uncertainty_allowed.unwrap();
    let inside = ask(&mut law, Uncertainty::Scalar(0.99 * allowed));
    let outside = ask(&mut law, Uncertainty::Scalar(1.01 * allowed));
    assert!(inside.robust_factor.unwrap() < 1.0 && outside.robust_factor.unwrap() > 1.0);
    let z = |omega: f64| nalgebra::Complex::from_polar(1.0, omega);
    let gain = |k: u32| {
        let z = z(f64::from(k) * std::f64::consts::PI / 20_000.0);
        ((z - 0.5) / (z * z - z * 1.5 + 0.7125)).norm_sqr()
    };
    let largest = (0..=20_000).map(gain).fold(0.0, f64::max);
    assert!((allowed - (1.0 + 0.5 / largest)).abs() < 1e-3 * allowed, "{allowed} {largest}");
    let shaped = ask(&mut law, Uncertainty::Shaped(vec![0.0, 0.0]));
    assert!(close(shaped.robust_factor.unwrap(), peak, 1e-12));
    assert!(close(Uncertainty::Shaped(vec![0.0, 1.0, 3.0]).at(0.375, 1.0), 2.0, 1e-12));
}

//! The dynamic weight against the lifted problem as a dense system of equations.

use super::*;
use crate::learning::law::norm_optimal::Weights;
use crate::learning::weights::{Contour, FilteredInput, Pass, Weight, band};
use crate::model::{StateSpace, from_transfer_function};
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

const N: usize = 24;

fn low_pass(pole: f64) -> StateSpace {
    from_transfer_function(&[1.0 - pole], &[1.0, -pole], Some(0.1)).unwrap()
}

/// A fast axis and a slow one, the slow one delayed by a sample.
fn plant() -> StateSpace {
    let fast = from_transfer_function(&[0.5, 0.2], &[1.0, -0.5, 0.1], Some(0.1)).unwrap();
    fast.append(&low_pass(0.9).delayed(1).unwrap()).unwrap()
}

fn input_weights(input: Option<FilteredInput>, change: Option<FilteredInput>) -> InputWeights {
    InputWeights { input, change }
}

/// Solves the lifted problem with filters of error, input and change: `Q`, `F_u' W_u F_u` and `F_v' W_v F_v`
/// are given as whole matrices.
fn dense_inputs(
    lifted: &DMatrix<f64>,
    [q, input, change]: [&DMatrix<f64>; 3],
    (s, r): (f64, f64),
    (u, e): (&[f64], &[f64]),
) -> DVector<f64> {
    let size = lifted.ncols();
    let (u, e) = (DVector::from_row_slice(u), DVector::from_row_slice(e));
    let held = input + DMatrix::identity(size, size) * s;
    let h = lifted.transpose() * q * lifted + &held + change + DMatrix::identity(size, size) * r;
    let right = lifted.transpose() * q * e - held * &u;
    &u + h.cholesky().unwrap().solve(&right)
}

/// Solves the normal equations of the lifted problem.
fn dense(
    (lifted, filter): (&DMatrix<f64>, &DMatrix<f64>),
    (q, plain): (&DMatrix<f64>, &DMatrix<f64>),
    (s, r, rate): (f64, f64, f64),
    (u, e): (&[f64], &[f64]),
) -> DVector<f64> {
    let (n_u, m) = (lifted.ncols(), lifted.ncols() / N);
    let difference = DMatrix::from_fn(n_u - m, n_u, |i, j| {
        f64::from(i8::from(j == i + m) - i8::from(j == i)) * rate
    });
    let weight = filter.transpose() * q * filter + plain;
    let (u, e) = (DVector::from_row_slice(u), DVector::from_row_slice(e));
    let h = lifted.transpose() * &weight * lifted
        + DMatrix::identity(n_u, n_u) * (s + r)
        + difference.transpose() * difference;
    let right = lifted.transpose() * weight * e - &u * s;
    &u + h.cholesky().unwrap().solve(&right)
}

fn lifted_blocks(at: impl Fn(usize) -> DMatrix<f64>) -> DMatrix<f64> {
    let (rows, cols) = at(0).shape();
    DMatrix::from_fn(N * rows, N * cols, |i, j| {
        if i / rows == j / cols { at(i / rows)[(i % rows, j % cols)] } else { 0.0 }
    })
}

#[test]
fn an_integrator_weighs_the_sum_of_the_errors() {
    // y[k+1] = u[k]; w[1] = e[1] - v[0], w[2] = w[1] + e[2] - v[1]: r = 1 and q = 1 by hand.
    let plant = from_transfer_function(&[1.0], &[1.0, 0.0], Some(1.0)).unwrap();
    let sum = from_transfer_function(&[1.0, 0.0], &[1.0, -1.0], Some(1.0)).unwrap();
    let weights = Weights { r: 1.0, ..Weights::default() };
    let dynamic = Dynamic::new(sum).unwrap();
    let mut law = DynamicNormOptimal::new(&plant, 3, &dynamic, weights).unwrap();
    let mut next = [0.0; 3];
    law.update(&[0.0; 3], &[0.0, 3.0, 2.0], &mut next).unwrap();
    // [3 1; 1 2] v = [3 + 5; 5].
    assert!((next[0] - 11.0 / 5.0).abs() < 1e-14 && (next[1] - 7.0 / 5.0).abs() < 1e-14);
    assert!(next[2].abs() < 1e-14);
}

#[test]
fn a_filter_of_one_is_no_filter() {
    let one = StateSpace::static_gain(DMatrix::identity(2, 2), Some(0.1)).unwrap();
    let weights = Weights { s: 1e-3, r: 1e-2, rate: 0.3, ..Weights::default() };
    let dynamic = Dynamic::new(one).unwrap();
    let e: Vec<f64> = (0..2 * N).map(|i| (i as f64 * 0.7).sin()).collect();
    let u: Vec<f64> = e.iter().map(|e| 0.3 - e).collect();
    let (mut with, mut without) = (vec![0.0; 2 * N], vec![0.0; 2 * N]);
    let mut law = DynamicNormOptimal::new(&plant(), N, &dynamic, weights).unwrap();
    law.update(&u, &e, &mut with).unwrap();
    NormOptimal::new(&plant(), N, weights).unwrap().update(&u, &e, &mut without).unwrap();
    for (with, without) in with.iter().zip(without) {
        assert!((with - without).abs() < 1e-14);
    }
}

#[test]
fn a_filter_that_does_not_fit_the_plant_is_refused() {
    let told = |filter: StateSpace, q: Weight| {
        let dynamic = Dynamic::new(filter).unwrap();
        let cost = Cost { q, ..Weights { r: 1.0, ..Weights::default() }.into() };
        DynamicNormOptimal::new(&plant(), N, &dynamic, cost).unwrap_err().to_string()
    };
    assert!(told(low_pass(0.5), Weight::Scalar(1.0)).contains("signals meet"));
    let late = from_transfer_function(&[1.0], &[1.0, -0.5], Some(0.2)).unwrap();
    assert!(told(late.append(&late).unwrap(), Weight::Scalar(1.0)).contains("dt_s"));
    let two = low_pass(0.5).append(&low_pass(0.2)).unwrap();
    assert!(told(two.clone(), Weight::Block(DMatrix::identity(3, 3))).contains("3 x 3"));
    let dynamic = Dynamic::new(two).unwrap();
    let none = DynamicNormOptimal::new(&plant(), 0, &dynamic, Weights::default());
    assert!(none.unwrap_err().to_string().contains("n_samples"));
    let weights = Weights { r: 1.0, ..Weights::default() };
    let mut law = DynamicNormOptimal::new(&plant(), N, &dynamic, weights).unwrap();
    let mut next = vec![0.0; 2 * N];
    let short = law.update(&[0.0; 2 * N], &[0.0; N], &mut next).unwrap_err();
    assert!(short.to_string().starts_with("error holds"));
}

#[test]
fn input_filters_that_do_not_fit_are_refused() {
    let one = StateSpace::static_gain(DMatrix::identity(2, 2), Some(0.1)).unwrap();
    let dynamic = Dynamic::new(one).unwrap();
    let told = |filter: StateSpace, weight: Weight| {
        let inputs = input_weights(None, Some(FilteredInput::new(filter, weight).unwrap()));
        DynamicNormOptimal::with_inputs(&plant(), N, (&dynamic, &inputs), Weights::default())
            .unwrap_err()
            .to_string()
    };
    let both = low_pass(0.5).append(&low_pass(0.5)).unwrap();
    for (line, parts) in [
        (told(low_pass(0.5), Weight::Scalar(1.0)), ["change_weight", "takes 1 signals; 2"]),
        (told(both.clone(), Weight::Scalar(-1.0)), ["change_weight", "negative"]),
        (told(both, Weight::PerSample(vec![1.0; N + 1])), ["change_weight", "25 samples given"]),
    ] {
        assert!(parts.iter().all(|part| line.contains(part)), "{line}");
    }
    let away = from_transfer_function(&[1.0], &[1.0, -1.2], Some(0.1)).unwrap();
    assert!(FilteredInput::new(away, Weight::Scalar(1.0)).is_err());
    // An input that is not finite is named as such, not as the signal behind its filter.
    let both = band(Pass::High, (2, 1.0), 0.1, 2).unwrap();
    let inputs = input_weights(Some(FilteredInput::new(both, Weight::Scalar(1.0)).unwrap()), None);
    let mut law =
        DynamicNormOptimal::with_inputs(&plant(), N, (&dynamic, &inputs), Weights::default())
            .unwrap();
    let (mut u, mut next) = (vec![0.0; 2 * N], vec![0.0; 2 * N]);
    u[7] = f64::NAN;
    let line = law.update(&u, &[0.0; 2 * N], &mut next).unwrap_err().to_string();
    assert!(line.contains("input is NaN at sample 3, channel 1"), "{line}");
}

#[test]
fn axes_apart_stay_apart_with_filters_of_the_input() {
    let axis = low_pass(0.6);
    let both = axis.append(&axis).unwrap();
    let dynamic = Dynamic::new(band(Pass::Low, (2, 1.0), 0.1, 2).unwrap()).unwrap();
    let high = band(Pass::High, (3, 2.0), 0.1, 2).unwrap();
    let weight = FilteredInput::new(high, Weight::Scalar(0.3)).unwrap();
    let inputs = input_weights(Some(weight.clone()), Some(weight));
    let all = (&dynamic, &inputs);
    let law = DynamicNormOptimal::with_inputs(&both, N, all, Weights::default()).unwrap();
    assert_eq!(law.inner().n_parts(), 2);
    let told = law.describe();
    assert!(told.contains(r#""filtered_inputs":2,"filtered_changes":2"#), "{told}");
}

proptest! {
    #![proptest_config(ilc_cases::cases(40))]

    #[test]
    fn filters_of_error_input_and_change_are_the_dense_solution(
        n_samples in 1..70_usize,
        (order_e, order_u, order_d) in (1..4_usize, 1..4_usize, 1..5_usize),
        (hz_e, hz_u, hz_d) in (0.3..4.5_f64, 0.3..4.5_f64, 0.3..4.5_f64),
        (is_high_u, is_high_d) in (any::<bool>(), any::<bool>()),
        (has_u, has_d, varies) in (any::<bool>(), any::<bool>(), any::<bool>()),
        (s, r) in (prop::sample::select(vec![0.0, 1e-3, 0.3]), 1e-3..1.0_f64),
        half in prop::array::uniform4(-1.0..1.0_f64),
        seed in any::<u32>(),
    ) {
        let pass = |is_high| if is_high { Pass::High } else { Pass::Low };
        // Coupled, and of unlike delay.
        let skew = DMatrix::from_row_slice(2, 2, &[1.0, 0.3, -0.2, 0.9]);
        let plant = StateSpace::static_gain(skew, Some(0.1)).unwrap().series(&plant()).unwrap();
        let error = band(Pass::Low, (order_e, hz_e), 0.1, 2).unwrap();
        let input = band(pass(is_high_u), (order_u, hz_u), 0.1, 2).unwrap();
        let change = band(pass(is_high_d), (order_d, hz_d), 0.1, 2).unwrap();
        let half = DMatrix::from_row_slice(2, 2, &half);
        let block = half.transpose() * half;
        let along: Vec<f64> = (0..n_samples).map(|k| 0.1 + (k as f64 * 0.3).sin().abs()).collect();
        let of_input = if varies {
            Weight::PerSample(along)
        } else {
            Weight::Block(block)
        };
        let whole = |filter: &StateSpace, weight: &Weight, is_used: bool| {
            let lifted = filter.lifted(n_samples).unwrap();
            let weights = DMatrix::from_fn(2 * n_samples, 2 * n_samples, |i, j| {
                if i / 2 == j / 2 { weight.entry(i / 2, i % 2, j % 2) } else { 0.0 }
            });
            lifted.transpose() * weights * lifted * f64::from(u8::from(is_used))
        };
        let q = whole(&error, &Weight::Scalar(2.0), true)
            + DMatrix::identity(2 * n_samples, 2 * n_samples) * 0.1;
        let matrices = [
            &q,
            &whole(&input, &of_input, has_u),
            &whole(&change, &Weight::Scalar(0.7), has_d),
        ];
        let inputs = input_weights(
            has_u.then(|| FilteredInput::new(input, of_input).unwrap()),
            has_d.then(|| FilteredInput::new(change, Weight::Scalar(0.7)).unwrap()),
        );
        let noise = |seed: u32| -> Vec<f64> {
            let mut state = u64::from(seed) << 1 | 1;
            (0..2 * n_samples).map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
            }).collect()
        };
        let (u, e) = (noise(seed), noise(seed ^ 7));
        let dynamic = Dynamic::new(error).unwrap().with_plain(Weight::Scalar(0.1));
        let weights = Weights { q: 2.0, s, r, rate: 0.0 };
        let all = (&dynamic, &inputs);
        let mut law = DynamicNormOptimal::with_inputs(&plant, n_samples, all, weights).unwrap();
        let mut next = vec![f64::NAN; 2 * n_samples];
        law.update(&u, &e, &mut next).unwrap();
        let lifted = plant.lifted(n_samples).unwrap();
        let expected = dense_inputs(&lifted, matrices, (s, r), (&u, &e));
        for (found, expected) in next.iter().zip(expected.iter()) {
            prop_assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        // The same with a model that is given sample by sample.
        let varying = crate::model::TimeVarying::new(vec![plant; n_samples]).unwrap();
        let mut law = DynamicNormOptimal::with_inputs(&varying, n_samples, all, weights).unwrap();
        law.update(&u, &e, &mut next).unwrap();
        for (found, expected) in next.iter().zip(expected.iter()) {
            prop_assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }

    #[test]
    fn a_filter_is_the_dense_solution(
        (pole_1, pole_2) in (-0.9..0.95_f64, -0.9..0.95_f64),
        (s, r, rate) in (1e-4..1.0_f64, 1e-3..1.0_f64, 0.0..2.0_f64),
        signals in prop::collection::vec(-1.0..1.0_f64, 4 * N),
        half in prop::array::uniform4(-1.0..1.0_f64),
        plain in prop::collection::vec(0.0..2.0_f64, N),
    ) {
        let filter = low_pass(pole_1).append(&low_pass(pole_2)).unwrap();
        let half = DMatrix::from_row_slice(2, 2, &half);
        let q = half.transpose() * half;
        let (u, e) = signals.split_at(2 * N);
        let mut next = vec![f64::NAN; 2 * N];
        let cost = Cost {
            q: Weight::Block(q.clone()),
            s: Weight::Scalar(s),
            r: Weight::Scalar(r),
            rate,
        };
        let operators = (&plant().lifted(N).unwrap(), &filter.lifted(N).unwrap());
        let blocks = lifted_blocks(|_| q.clone());
        let dynamic = Dynamic::new(filter.clone()).unwrap();
        let mut law = DynamicNormOptimal::new(&plant(), N, &dynamic, cost.clone()).unwrap();
        law.update(u, e, &mut next).unwrap();
        let none = DMatrix::zeros(2 * N, 2 * N);
        let expected = dense(operators, (&blocks, &none), (s, r, rate), (u, e));
        for (found, expected) in next.iter().zip(expected.iter()) {
            prop_assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }

        let dynamic = dynamic.with_plain(Weight::PerSample(plain.clone()));
        let mut law = DynamicNormOptimal::new(&plant(), N, &dynamic, cost).unwrap();
        law.update(u, e, &mut next).unwrap();
        let own = lifted_blocks(|k| DMatrix::identity(2, 2) * plain[k]);
        let expected = dense(operators, (&blocks, &own), (s, r, rate), (u, e));
        for (found, expected) in next.iter().zip(expected.iter()) {
            prop_assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
    }

    #[test]
    fn the_contour_of_unlike_axes_is_the_dense_solution(
        angles in prop::collection::vec(-3.1..3.1_f64, N),
        (s, r, rate) in (1e-4..1.0_f64, 1e-3..1.0_f64, 0.0..2.0_f64),
        signals in prop::collection::vec(-1.0..1.0_f64, 4 * N),
        q in prop::collection::vec(0.0..5.0_f64, N),
    ) {
        let path: Vec<f64> = angles.iter().scan([0.0, 0.0], |at, angle| {
            at[0] += angle.cos();
            at[1] += angle.sin();
            Some(*at)
        }).flatten().collect();
        let gains = Contour::new(&path, 2).unwrap().couplings();
        // The fast axis through T_fast / T_slow with a low-pass, the slow one unfiltered.
        let fast = from_transfer_function(&[3.0, -2.4], &[1.0, -0.4], Some(0.1)).unwrap();
        let fast = fast.series(&low_pass(0.6703)).unwrap();
        let one = StateSpace::static_gain(DMatrix::identity(1, 1), Some(0.1)).unwrap();
        let dynamic = Dynamic::unlike_axes(&[fast.clone(), one], &gains).unwrap();
        let cost = Cost {
            q: Weight::PerSample(q.clone()),
            s: Weight::Scalar(s),
            r: Weight::Scalar(r),
            rate,
        };
        let (u, e) = signals.split_at(2 * N);
        let mut next = vec![f64::NAN; 2 * N];
        let mut law = DynamicNormOptimal::new(&plant(), N, &dynamic, cost).unwrap();
        law.update(u, e, &mut next).unwrap();

        // Eq. (J.19), entry by entry: impulse response of the filter times the gain.
        let response = fast.markov(N).unwrap();
        let coupling = DMatrix::from_fn(N, 2 * N, |i, j| {
            let (sample, gain) = (j / 2, gains[j / 2][(0, j % 2)]);
            match (sample <= i, j % 2) {
                (true, 0) => response[i - sample][(0, 0)] * gain,
                (true, _) if sample == i => gain,
                _ => 0.0,
            }
        });
        let blocks = DMatrix::from_diagonal(&DVector::from_vec(q));
        let none = DMatrix::zeros(2 * N, 2 * N);
        let lifted = plant().lifted(N).unwrap();
        let expected = dense((&lifted, &coupling), (&blocks, &none), (s, r, rate), (u, e));
        for (found, expected) in next.iter().zip(expected.iter()) {
            prop_assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
    }
}

//! The inverse against a dense solution and a known gain, and on plants that differ from the model.

use nalgebra::DVector;

use super::*;
use crate::model::{Method, discretize, from_transfer_function, second_order};

const DT_S: f64 = 2e-3;

/// Returns a plant with one zero outside the unit circle, one inside, complex poles and a delay.
fn non_minimum(gain: f64, [out, inside, re, im]: [f64; 4]) -> StateSpace {
    let num = [gain, -gain * (out + inside), gain * out * inside];
    let pair = [1.0, -2.0 * re, re * re + im * im];
    let den = [1.0, pair[1] - 0.3, pair[2] - 0.3 * pair[1], -0.3 * pair[2]];
    from_transfer_function(&num, &den, Some(DT_S)).unwrap().delayed(2).unwrap()
}

fn model() -> StateSpace {
    non_minimum(0.3, [1.4, -0.5, 0.8, 0.2])
}

fn law(model: &StateSpace, n: usize, method: InverseMethod, gain: f64) -> StableInverse {
    let rule = InverseRule { gain, method, zero_radius: 1.0 };
    StableInverse::new(model, n, rule, QFilter::None).unwrap()
}

use InverseMethod::{StableInversion, Zpetc};

#[test]
fn stable_inversion_reproduces_the_error_by_the_dense_model() {
    let n = 400;
    let bump = |k: usize| (std::f64::consts::PI * (k as f64 - 150.0) / 100.0).sin().powi(2);
    let e = DVector::from_fn(n, |k, _| if (150..250).contains(&k) { bump(k) } else { 0.0 });
    let mut u = vec![0.0; n];
    law(&model(), n, StableInversion, 1.0).update(&vec![0.0; n], e.as_slice(), &mut u).unwrap();
    let answer = model().lifted(n).unwrap() * DVector::from_vec(u.clone());
    assert!((answer - e).amax() < 1e-9);
    // The causal inverse grows by 1.4 in each sample instead.
    assert!(u.iter().all(|u| u.abs() < 1e3));
}

#[test]
fn zpetc_has_no_phase_error_and_its_known_gain() {
    let n = 1000;
    let mut e = vec![0.0; n];
    e[500] = 1.0;
    let mut u = vec![0.0; n];
    law(&model(), n, Zpetc, 1.0).update(&vec![0.0; n], &e, &mut u).unwrap();
    let answer = model().lifted(n).unwrap() * DVector::from_vec(u);
    // P L = |z - 1.4|^2 / 0.4^2: three samples, symmetric.
    let expected = [-1.4, 1.0 + 1.4 * 1.4, -1.4].map(|value| value / 0.16);
    for (k, found) in answer.iter().enumerate() {
        let wanted = if (499..=501).contains(&k) { expected[k - 499] } else { 0.0 };
        assert!((found - wanted).abs() < 1e-8, "{k}: {found} {wanted}");
    }
}

#[test]
fn a_plant_that_differs_is_learned_by_both_methods_and_the_input_stays_bounded() {
    let n = 400;
    let plant = non_minimum(0.24, [1.35, -0.45, 0.78, 0.22]).lifted(n).unwrap();
    let bump = |k: usize| 0.01 * (std::f64::consts::PI * (k as f64 - 100.0) / 200.0).sin().powi(4);
    let reference = DVector::from_fn(n, |k, _| if (100..300).contains(&k) { bump(k) } else { 0.0 });
    for method in [StableInversion, Zpetc] {
        let rule = InverseRule { gain: 0.6, method, zero_radius: 1.0 };
        let filter = QFilter::low_pass(2, 40.0, DT_S).unwrap();
        let mut law = StableInverse::new(&model(), n, rule, filter).unwrap();
        let mut u = DVector::zeros(n);
        let mut sizes = Vec::new();
        for _ in 0..15 {
            let e = &reference - &plant * &u;
            sizes.push(e.norm());
            let mut next = vec![0.0; n];
            law.update(u.as_slice(), e.as_slice(), &mut next).unwrap();
            u = DVector::from_vec(next);
        }
        assert!(sizes[14] < 0.02 * sizes[0] && sizes[1] < sizes[0], "{method:?}: {sizes:?}");
        assert!(u.amax() < 10.0 * reference.amax());
    }
}

#[test]
fn the_adjoint_is_the_transpose_for_every_method() {
    let n = 60;
    let signal = |seed: f64| -> Vec<f64> { (0..n).map(|k| (f64::from(k) * seed).sin()).collect() };
    for method in [StableInversion, Zpetc] {
        let mut law = law(&model(), 60, method, 0.7);
        let (u, e, dual) = (signal(0.3), signal(0.7), signal(1.9));
        let [mut next, mut to_u, mut to_e] = [(); 3].map(|()| vec![0.0; 60]);
        law.update(&u, &e, &mut next).unwrap();
        assert!(law.apply_adjoint(&dual, &mut to_u, &mut to_e).unwrap());
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (forward, back) = (dot(&next, &dual), dot(&u, &to_u) + dot(&e, &to_e));
        assert!((forward - back).abs() < 1e-9 * forward.abs(), "{method:?}: {forward} {back}");
    }
}

#[test]
fn what_has_no_inverse_is_refused() {
    let refuse = |model: &StateSpace, rule: InverseRule| {
        StableInverse::new(model, 50, rule, QFilter::None).unwrap_err().to_string()
    };
    let rule = InverseRule { gain: 0.5, method: StableInversion, zero_radius: 1.0 };
    let circle = from_transfer_function(&[1.0, 1.0], &[1.0, -0.7, 0.1], Some(DT_S)).unwrap();
    assert!(refuse(&circle, rule).contains("on the unit circle"));
    assert!(
        StableInverse::new(
            &circle,
            50,
            InverseRule { method: Zpetc, zero_radius: 0.99, ..rule },
            QFilter::None
        )
        .is_ok()
    );
    let mute = from_transfer_function(&[0.0], &[1.0, -0.5], Some(DT_S)).unwrap();
    assert!(refuse(&mute, rule).contains("responds to no input"));
    assert!(
        refuse(&model(), InverseRule { zero_radius: 0.5, ..rule }).contains("zero_radius = 0.5")
    );
    assert!(refuse(&model(), InverseRule { gain: 2.0, ..rule }).contains("gain = 2"));
    assert!(refuse(&second_order(94.0, 0.7).unwrap(), rule).contains("continuous"));
    let axis = discretize(&second_order(94.0, 0.7).unwrap(), DT_S, Method::ZeroOrderHold).unwrap();
    let skew = nalgebra::DMatrix::from_row_slice(2, 2, &[1.0, 0.1, 0.0, 1.0]);
    let skew = StateSpace::static_gain(skew, Some(DT_S)).unwrap();
    let coupled = axis.append(&axis).unwrap().series(&skew).unwrap();
    assert!(refuse(&coupled, rule).contains("couples axes"));
}

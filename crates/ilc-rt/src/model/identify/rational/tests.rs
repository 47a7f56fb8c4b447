//! Tests of the rational fit.

use super::*;
use crate::model::{Method, discretize};

fn measured(model: &StateSpace, delay_s: f64) -> FrequencyResponse {
    let frequency_hz: Vec<f64> = (1..200).map(|k| 0.4 * f64::from(k)).collect();
    let w: Vec<f64> = frequency_hz.iter().map(|f| TAU * f).collect();
    let late =
        |(g, w): (DMatrix<Complex<f64>>, &f64)| g[(0, 0)] * Complex::new(0.0, -w * delay_s).exp();
    FrequencyResponse {
        response: model.frequency_response(&w).unwrap().into_iter().zip(&w).map(late).collect(),
        coherence: vec![1.0; frequency_hz.len()],
        frequency_hz,
        n_averages: 1.0,
    }
}

/// Two resonances and an anti-resonance.
fn flexible() -> StateSpace {
    let rigid = from_transfer_function(&[8000.0], &[1.0, 60.0, 8000.0], None).unwrap();
    let mode = from_transfer_function(&[1.1, 5.0, 60_000.0], &[1.0, 9.0, 60_000.0], None).unwrap();
    rigid.series(&mode).unwrap()
}

fn largest_difference(model: &StateSpace, expected: &FrequencyResponse, delay_s: f64) -> f64 {
    let found = measured(model, delay_s);
    let pairs = found.response.iter().zip(&expected.response);
    pairs.map(|(f, e)| (f / e - 1.0).norm()).fold(0.0, f64::max)
}

#[test]
fn a_flexible_axis_is_found_again_continuous_and_sampled() {
    let data = measured(&flexible(), 4e-3);
    let found = fit_rational(&data, 2, 4, 4e-3, None).unwrap();
    assert!(largest_difference(&found.model, &data, 4e-3) < 1e-8);
    assert_eq!((found.reflected_poles, found.model.n_states()), (0, 4));

    for dt_s in [5e-3, 1e-3, 2e-4] {
        let held = discretize(&flexible(), dt_s, Method::ZeroOrderHold).unwrap();
        let data = measured(&held, 0.0);
        let found = fit_rational(&data, 3, 4, 0.0, Some(dt_s)).unwrap();
        let worst = largest_difference(&found.model, &data, 0.0);
        assert!(worst < 1e-6, "dt_s = {dt_s}: {worst}, {}", found.residual_rms);
    }
}

#[test]
fn more_poles_and_zeros_than_there_are_do_no_harm() {
    // (s^2 + 6 s + 3600) / ((s^2 + 9 s + 8100) (s + 40)), and one of another kind.
    let resonant =
        from_transfer_function(&[1.0, 6.0, 3600.0], &[1.0, 49.0, 8460.0, 324_000.0], None).unwrap();
    let lag = from_transfer_function(&[40.0], &[1.0, 40.0], None).unwrap();
    for truth in [resonant, lag, flexible()] {
        for dt_s in [None, Some(1e-3)] {
            let model = match dt_s {
                None => truth.clone(),
                Some(dt_s) => discretize(&truth, dt_s, Method::ZeroOrderHold).unwrap(),
            };
            let data = measured(&model, 0.0);
            let n = truth.n_states();
            for n_poles in n..n + 3 {
                for n_zeros in n.saturating_sub(1)..=n_poles {
                    let found = fit_rational(&data, n_zeros, n_poles, 0.0, dt_s).unwrap();
                    let name = format!("{n_zeros}/{n_poles} for {n}, {dt_s:?}");
                    assert!(found.residual_rms < 1e-4, "{name}: {}", found.residual_rms);
                    let worst = largest_difference(&found.model, &data, 0.0);
                    assert!(worst < 1e-3, "{name}: {worst}");
                }
            }
        }
    }
}

#[test]
fn an_unstable_response_is_fitted_by_a_stable_model() {
    let unstable = from_transfer_function(&[900.0], &[1.0, -20.0, 900.0], None).unwrap();
    let data = measured(&unstable, 0.0);
    let found = fit_rational(&data, 1, 2, 0.0, None).unwrap();
    assert_eq!(found.reflected_poles, 2);
    assert!(found.model.poles().unwrap().iter().all(|pole| pole.re < 0.0));
    assert!(found.residual_rms > 1e-3);

    let dt_s = 1e-3;
    let held = discretize(&unstable, dt_s, Method::ZeroOrderHold).unwrap();
    let found = fit_rational(&measured(&held, 0.0), 1, 2, 0.0, Some(dt_s)).unwrap();
    assert!(found.model.poles().unwrap().iter().all(|pole| pole.norm() < 1.0));
}

#[test]
fn noise_leaves_a_residual_of_its_own_size() {
    let mut data = measured(&flexible(), 0.0);
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for h in &mut data.response {
        *h *= Complex::new(1.0 + 0.02 * random(), 0.02 * random());
    }
    let found = fit_rational(&data, 2, 4, 0.0, None).unwrap();
    let size = 0.02 * (2.0_f64 / 12.0).sqrt();
    assert!((found.residual_rms / size - 1.0).abs() < 0.15, "{}", found.residual_rms);
}

#[test]
fn degrees_that_cannot_be_are_refused() {
    let data = measured(&flexible(), 0.0);
    assert!(fit_rational(&data, 3, 2, 0.0, None).is_err());
    assert!(fit_rational(&data, 0, 21, 0.0, None).is_err());
    for delay_s in [f64::NAN, f64::INFINITY, 1e308, -1e308, 1e9] {
        let line = fit_rational(&data, 0, 2, delay_s, None).unwrap_err().to_string();
        assert!(line.contains("a million periods"), "{line}");
    }
    assert!(fit_rational(&data, 0, 2, 0.0, Some(-1.0)).is_err());
    assert!(fit_rational(&data.band(1.0, 1.3), 0, 2, 0.0, None).is_err());
}

//! Tests of the second-order model and its fit.

use std::f64::consts::TAU;

use nalgebra::Complex;

use super::super::FrequencyResponse;
use super::*;
use proptest::prelude::*;

fn measured(truth: &SecondOrder, frequency_hz: Vec<f64>) -> FrequencyResponse {
    FrequencyResponse {
        response: truth.response(&frequency_hz),
        coherence: vec![0.99; frequency_hz.len()],
        frequency_hz,
        n_averages: 4.0,
    }
}

fn band() -> Vec<f64> {
    (1..160).map(|k| 0.5 * f64::from(k)).collect()
}

#[test]
fn the_sampled_response_is_that_of_the_state_space() {
    let truth = SecondOrder {
        gain: 1.3,
        natural_frequency_hz: 15.0,
        damping: 0.4,
        delay_s: 6e-3,
        dt_s: Some(2e-3),
    };
    let model = truth.state_space().unwrap();
    let w: Vec<f64> = band().iter().map(|f| TAU * f).collect();
    let expected = model.frequency_response(&w).unwrap();
    for (found, expected) in truth.response(&band()).iter().zip(expected) {
        assert!((found - expected[(0, 0)]).norm() < 1e-11 * found.norm());
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(40))]
    #[test]
    fn any_second_order_model_is_found_again(
        gain in prop_oneof![-3.0..-0.3, 0.3..3.0],
        natural_frequency_hz in 3.0..40.0,
        damping in 0.05..1.2,
        delay_s in 0.0..0.01,
        is_sampled: bool,
    ) {
        let dt_s = is_sampled.then_some(2e-3);
        let truth = SecondOrder { gain, natural_frequency_hz, damping, delay_s, dt_s };
        let found = fit_second_order(&measured(&truth, band()), dt_s, Known::default())
            .map_err(|error| TestCaseError::fail(error.to_string()))?;
        let model = found.model;
        prop_assert!((model.gain / gain - 1.0).abs() < 1e-6, "{model:?}");
        prop_assert!((model.natural_frequency_hz / natural_frequency_hz - 1.0).abs() < 1e-6);
        prop_assert!((model.damping / damping - 1.0).abs() < 1e-5);
        prop_assert!((model.delay_s - delay_s).abs() < 1e-8);
        prop_assert!(found.residual_rms < 1e-6);
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(60))]
    #[test]
    fn a_resonance_below_or_above_the_band_is_found_too(
        low_hz in 1.0..40.0_f64,
        width in 1.6..6.0_f64,
        place in prop_oneof![0.25..1.0, 1.0..2.5_f64],
        damping in 0.05..1.5,
        gain in prop_oneof![-3.0..-0.3, 0.3..3.0],
        delay_s in prop::sample::select(vec![0.0, 2e-3, 6e-3, 0.0133]),
        is_sampled: bool,
    ) {
        let dt_s = is_sampled.then_some(2e-3);
        let high_hz = low_hz * width;
        // Below the lower end or above the upper one.
        let natural_frequency_hz = place * if place < 1.0 { low_hz } else { high_hz };
        let truth = SecondOrder { gain, natural_frequency_hz, damping, delay_s, dt_s };
        let frequency_hz: Vec<f64> =
            (0..90).map(|k| low_hz + (high_hz - low_hz) * f64::from(k) / 89.0).collect();
        prop_assume!(high_hz < 220.0 && natural_frequency_hz < 220.0);
        let found = fit_second_order(&measured(&truth, frequency_hz), dt_s, Known::default())
            .map_err(|error| TestCaseError::fail(error.to_string()))?;
        let model = found.model;
        prop_assert!(found.residual_rms < 1e-7, "{found:?} {truth:?}");
        prop_assert!((model.natural_frequency_hz / natural_frequency_hz - 1.0).abs() < 1e-2);
        prop_assert!((model.gain / gain - 1.0).abs() < 1e-2, "{model:?} {truth:?}");
    }
}

#[test]
fn bands_far_above_the_resonance_are_extrapolated() {
    for (natural_frequency_hz, damping, low, high) in [(12.0, 0.5, 36, 80), (12.0, 0.1, 24, 60)] {
        let (gain, dt_s) = (1.0, Some(2e-3));
        let truth = SecondOrder { gain, natural_frequency_hz, damping, delay_s: 0.0, dt_s };
        let frequency_hz: Vec<f64> = (2 * low..=2 * high).map(|k| 0.5 * f64::from(k)).collect();
        let data = measured(&truth, frequency_hz);
        for known in [
            Known::default(),
            Known { gain: Some(1.0), delay_s: None },
            Known { gain: None, delay_s: Some(0.0) },
            Known { gain: Some(1.0), delay_s: Some(0.0) },
        ] {
            let found = fit_second_order(&data, dt_s, known).unwrap();
            let off = found.model.natural_frequency_hz / natural_frequency_hz - 1.0;
            assert!(off.abs() < 1e-5 && found.residual_rms < 1e-8, "{found:?}");
            assert!((found.model.gain - 1.0).abs() < 1e-4, "{found:?}");
        }
    }
}

#[test]
fn an_axis_that_does_not_answer_has_no_gain_and_all_left_over() {
    let n = band().len();
    let silence = FrequencyResponse {
        frequency_hz: band(),
        response: vec![Complex::new(0.0, 0.0); n],
        coherence: vec![0.0; n],
        n_averages: 4.0,
    };
    for dt_s in [None, Some(2e-3)] {
        let found = fit_second_order(&silence, dt_s, Known::default()).unwrap();
        assert!(found.model.gain.abs() < 1e-300 && (found.residual_rms - 1.0).abs() < 1e-15);
        let doubt = super::super::doubt(&silence, found.residual_rms).unwrap();
        assert!(doubt.to_string().contains("does not answer"), "{doubt}");
        let bound =
            super::super::uncertainty(&silence, &found.model.response(&band()), 3.0).unwrap();
        assert!(bound.bound.iter().all(|bound| (bound - 1.0).abs() < 1e-12), "{bound:?}");
    }
    // Frequencies without a response, between others with one, are omitted.
    let truth = SecondOrder {
        gain: 1.3,
        natural_frequency_hz: 15.0,
        damping: 0.4,
        delay_s: 6e-3,
        dt_s: Some(2e-3),
    };
    let mut data = measured(&truth, band());
    for k in (0..n).step_by(3) {
        data.response[k] = Complex::new(0.0, 0.0);
        data.coherence[k] = 0.0;
    }
    let found = fit_second_order(&data, Some(2e-3), Known::default()).unwrap();
    assert!((found.model.natural_frequency_hz - 15.0).abs() < 1e-5, "{found:?}");
}

#[test]
fn a_bad_estimate_with_low_coherence_does_not_count() {
    let truth = SecondOrder {
        gain: 1.0,
        natural_frequency_hz: 12.0,
        damping: 0.6,
        delay_s: 3e-3,
        dt_s: None,
    };
    let mut data = measured(&truth, band());
    data.response[30] *= 3.0;
    let fooled = fit_second_order(&data, None, Known::default()).unwrap();
    data.coherence[30] = 1e-9;
    let found = fit_second_order(&data, None, Known::default()).unwrap();
    assert!((found.model.natural_frequency_hz - 12.0).abs() < 1e-6);
    assert!(fooled.residual_rms > 1e3 * found.residual_rms);
    assert!(found.natural_frequency_deviation_hz < 1e-3 * fooled.natural_frequency_deviation_hz);
}

#[test]
fn a_response_without_sense_ends_in_some_model_and_says_how_bad_it_is() {
    let mut state = 7_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let frequency_hz = band();
    let response = frequency_hz.iter().map(|_| Complex::new(random(), random())).collect();
    let n = frequency_hz.len();
    let noise =
        FrequencyResponse { frequency_hz, response, coherence: vec![0.5; n], n_averages: 2.0 };
    for dt_s in [None, Some(2e-3)] {
        let found = fit_second_order(&noise, dt_s, Known::default()).unwrap();
        assert!(found.residual_rms > 0.8, "{found:?}");
        assert!(found.model.delay_s.abs() <= 1.0 && found.model.natural_frequency_hz < 2400.0);
    }
}

#[test]
fn what_is_known_stays() {
    let truth = SecondOrder {
        gain: 1.02,
        natural_frequency_hz: 12.0,
        damping: 0.6,
        delay_s: 3.3e-3,
        dt_s: Some(1e-3),
    };
    let known = Known { gain: Some(1.0), delay_s: Some(3e-3) };
    let found = fit_second_order(&measured(&truth, band()), Some(1e-3), known).unwrap();
    assert!(found.gain_deviation <= 0.0 && found.delay_deviation_s <= 0.0);
    assert!((found.model.gain - 1.0).abs() < 1e-15 && found.model.delay_samples() == 3);
    assert!((found.model.natural_frequency_hz / 12.0 - 1.0).abs() < 0.05);
}

#[test]
fn one_wrong_thing_at_a_time_is_named() {
    let truth = SecondOrder {
        gain: 1.0,
        natural_frequency_hz: 12.0,
        damping: 0.6,
        delay_s: 0.0,
        dt_s: None,
    };
    let good = measured(&truth, band());
    let wrong = |change: &dyn Fn(&mut FrequencyResponse)| {
        let mut bad = good.clone();
        change(&mut bad);
        fit_second_order(&bad, None, Known::default()).unwrap_err().to_string()
    };
    assert!(wrong(&|d| d.frequency_hz[0] = 0.0).contains("frequency_hz = 0"));
    assert!(wrong(&|d| d.frequency_hz.swap(3, 4)).contains("rise"));
    assert!(wrong(&|d| d.response[2] = Complex::new(f64::NAN, 0.0)).contains("response holds NaN"));
    assert!(wrong(&|d| d.response[2] = Complex::new(0.0, 0.0)).contains("no logarithm"));
    assert!(wrong(&|d| d.coherence[2] = 1.5).contains("coherence holds 1.5"));
    assert!(wrong(&|d| d.response.truncate(5)).contains("response holds 5"));
    assert!(wrong(&|d| *d = d.band(1.0, 1.6)).contains("frequency_hz holds 2"));
    assert!(fit_second_order(&good, Some(0.0), Known::default()).is_err());
    let known = Known { gain: Some(0.0), delay_s: None };
    assert!(fit_second_order(&good, None, known).is_err());
}

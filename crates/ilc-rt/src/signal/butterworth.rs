//! Design of digital Butterworth low-pass and high-pass filters.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::{Section, SignalError};

/// Highest order that [`butterworth`] designs.
pub const MAX_ORDER: usize = 12;

/// Lowest cut-off as a share of the sampling rate: there, the static gain is 1 to six digits.
const LOWEST: f64 = 1e-5;
/// The same for a first-order filter.
const LOWEST_SINGLE: f64 = 1e-10;

/// Returns a Butterworth low-pass as second-order sections.
///
/// Analogue poles on the circle of radius `(2/T) tan(pi f_c T)`, mapped by the bilinear (Tustin)
/// transform with pre-warping, so that the gain at `cutoff_hz` is exactly `1/sqrt(2)`.
///
/// # Shapes
/// - `(order + 1) / 2` sections, the least damped poles last; each pole is paired with the nearest
///   zeros, which keeps intermediate values small
/// # Units
/// - `cutoff_hz` in hertz, `dt_s` in seconds
/// # Errors
/// - [`SignalError::Order`], [`SignalError::Cutoff`], [`SignalError::CutoffTooLow`] or
///   [`SignalError::SampleTime`].
/// # Source
/// - \[oppenheim2009\], Ch. 7: Butterworth poles and the bilinear transform.
pub fn butterworth(order: usize, cutoff_hz: f64, dt_s: f64) -> Result<Vec<Section>, SignalError> {
    if !(1..=MAX_ORDER).contains(&order) {
        return Err(SignalError::Order { order, max: MAX_ORDER });
    }
    if !(dt_s.is_finite() && dt_s > 0.0) {
        return Err(SignalError::SampleTime { dt_s });
    }
    let limit_hz = 0.5 / dt_s;
    if !(cutoff_hz > 0.0 && cutoff_hz < limit_hz) {
        return Err(SignalError::Cutoff { cutoff_hz, limit_hz });
    }
    // `1 + a1 + a2` is about the square of the ratio: below this limit it is rounding noise. With
    // one real pole it is about the ratio itself.
    let lowest_hz = if order == 1 { LOWEST_SINGLE } else { LOWEST } / dt_s;
    if cutoff_hz < lowest_hz {
        return Err(SignalError::CutoffTooLow { cutoff_hz, order, lowest_hz });
    }
    // Everything is scaled by T/2, so that the bilinear transform is z = (1 + s) / (1 - s).
    let radius = (PI * cutoff_hz * dt_s).tan();
    let one = Complex::new(1.0, 0.0);
    let mut gain = one;
    let mut upper_poles = Vec::new();
    let mut real_pole = None;
    for k in 0..order {
        let angle = PI * (2 * k + order + 1) as f64 / (2 * order) as f64;
        let is_real = 2 * k + 1 == order;
        let analogue =
            if is_real { Complex::new(-radius, 0.0) } else { Complex::from_polar(radius, angle) };
        gain *= Complex::new(radius, 0.0) / (one - analogue);
        let digital = (one + analogue) / (one - analogue);
        if is_real {
            real_pole = Some(digital.re);
        } else if 2 * k + 1 < order {
            upper_poles.push(digital);
        }
    }
    upper_poles.sort_by(|p, q| q.norm().total_cmp(&p.norm()));

    // An odd order is filled up with a pole and a zero at the origin; the zero goes to the first
    // pole that is nearer to it than to the other zeros, all at -1.
    let mut origin_zero = real_pole.is_some();
    let mut zeros_for = |pole: Complex<f64>, last: bool| {
        if origin_zero && (last || pole.norm() < (pole + one).norm()) {
            origin_zero = false;
            [1.0, 1.0, 0.0]
        } else {
            [1.0, 2.0, 1.0]
        }
    };
    let mut sections: Vec<Section> = upper_poles
        .iter()
        .map(|pole| Section { b: zeros_for(*pole, false), a: [-2.0 * pole.re, pole.norm_sqr()] })
        .collect();
    if let Some(pole) = real_pole {
        sections.push(Section { b: zeros_for(Complex::new(pole, 0.0), true), a: [-pole, 0.0] });
    }
    sections.reverse();
    for coefficient in &mut sections[0].b {
        *coefficient *= gain.re;
    }
    Ok(sections)
}

/// Returns a Butterworth high-pass as second-order sections.
///
/// The low-pass of the mirrored cut-off `1/(2T) - cutoff_hz` at `-z`: the gain at `cutoff_hz` is exactly
/// `1/sqrt(2)`, and 1 at the Nyquist frequency.
///
/// # Shapes
/// - as [`butterworth`]
/// # Units
/// - `cutoff_hz` in hertz, `dt_s` in seconds
/// # Errors
/// - as [`butterworth`], with [`SignalError::Cutoff`] for a cut-off too near the Nyquist frequency.
/// # Source
/// - \[oppenheim2009\], Ch. 7: transformation of frequency.
pub fn butterworth_high_pass(
    order: usize,
    cutoff_hz: f64,
    dt_s: f64,
) -> Result<Vec<Section>, SignalError> {
    let nyquist_hz = 0.5 / dt_s;
    let mirrored =
        butterworth(order, nyquist_hz - cutoff_hz, dt_s).map_err(|error| match error {
            SignalError::Cutoff { limit_hz, .. } => SignalError::Cutoff { cutoff_hz, limit_hz },
            SignalError::CutoffTooLow { lowest_hz, .. } => {
                SignalError::Cutoff { cutoff_hz, limit_hz: nyquist_hz - lowest_hz }
            }
            other => other,
        })?;
    let at_minus_z = |Section { b, a }| Section { b: [b[0], -b[1], b[2]], a: [-a[0], a[1]] };
    Ok(mirrored.into_iter().map(at_minus_z).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain_at(sections: &[Section], frequency_hz: f64, dt_s: f64) -> f64 {
        let back = Complex::from_polar(1.0, -2.0 * PI * frequency_hz * dt_s);
        sections
            .iter()
            .map(|s| {
                let top = Complex::from(s.b[0]) + back * s.b[1] + back * back * s.b[2];
                let bottom = Complex::from(1.0) + back * s.a[0] + back * back * s.a[1];
                (top / bottom).norm()
            })
            .product()
    }

    #[test]
    fn at_either_end_of_its_range_a_filter_is_one_and_beyond_it_is_refused() {
        for dt_s in [1e-6, 1e-3, 2e-3, 10.0] {
            for order in 1..=MAX_ORDER {
                let lowest = if order == 1 { LOWEST_SINGLE } else { LOWEST };
                for share in [lowest * 1.001, 3e-5, 1e-3, 0.1, 0.4999, 0.499_999_999_9] {
                    let sections = butterworth(order, share / dt_s, dt_s).unwrap();
                    let gain: f64 = sections.iter().map(Section::static_gain).product();
                    assert!((gain - 1.0).abs() < 1e-4, "order {order}, {share}: {gain}");
                    // Bounded and finite for any input; this is the loudest one.
                    let mut filter = super::super::SosFilter::new(sections);
                    let largest = (0..2000)
                        .map(|k| filter.step(if k % 2 == 0 { 1.0 } else { -1.0 }).abs())
                        .fold(0.0, f64::max);
                    assert!(largest < 10.0, "order {order}, {share}: {largest}");
                }
                for share in [lowest * 0.999, 1e-12, 1e-300, f64::MIN_POSITIVE] {
                    let line = butterworth(order, share / dt_s, dt_s).unwrap_err().to_string();
                    assert!(line.contains("cutoff_hz = "), "order {order}, {share}: {line}");
                }
            }
        }
        for (cutoff_hz, dt_s) in [(1.0, 1e-320), (1e300, 1e-310), (1.0, 1e300), (f64::NAN, 1e-3)] {
            assert!(butterworth(2, cutoff_hz, dt_s).is_err(), "{cutoff_hz} {dt_s}");
        }
    }

    #[test]
    fn a_high_pass_has_the_gains_of_an_analogue_one_at_warped_frequencies() {
        let dt_s = 2e-3;
        for order in 1..=MAX_ORDER {
            for cutoff_hz in [5.0_f64, 50.0, 180.0] {
                let sections = butterworth_high_pass(order, cutoff_hz, dt_s).unwrap();
                for frequency_hz in [0.0_f64, 3.0, cutoff_hz, 90.0, 240.0] {
                    let ratio = (PI * cutoff_hz * dt_s).tan() / (PI * frequency_hz * dt_s).tan();
                    let expected = (1.0 + ratio.powf(2.0 * order as f64)).sqrt().recip();
                    let found = gain_at(&sections, frequency_hz, dt_s);
                    assert!((found - expected).abs() < 1e-9, "{order} {cutoff_hz} {frequency_hz}");
                }
            }
        }
        for cutoff_hz in [0.0, -1.0, 250.0, 249.999_999, f64::NAN] {
            let line = butterworth_high_pass(3, cutoff_hz, dt_s).unwrap_err().to_string();
            assert!(line.contains(&format!("cutoff_hz = {cutoff_hz} Hz")), "{line}");
        }
    }

    #[test]
    fn every_order_has_its_three_defining_gains() {
        for order in 1..=MAX_ORDER {
            for cutoff_hz in [5.0, 50.0, 180.0] {
                let sections = butterworth(order, cutoff_hz, 2e-3).unwrap();
                assert_eq!(sections.len(), order.div_ceil(2));
                assert!((gain_at(&sections, 0.0, 2e-3) - 1.0).abs() < 1e-9);
                assert!((gain_at(&sections, cutoff_hz, 2e-3) - 0.5_f64.sqrt()).abs() < 1e-9);
                assert!(gain_at(&sections, 250.0, 2e-3) < 1e-12);
            }
        }
    }

    #[test]
    fn a_first_order_filter_is_known_by_hand() {
        // At a quarter of the sampling rate the analogue radius is 1: pole at 0, gain 1/2.
        let [section] = butterworth(1, 0.25, 1.0).unwrap()[..] else { unreachable!() };
        assert!((section.b[0] - 0.5).abs() < 1e-15 && (section.b[1] - 0.5).abs() < 1e-15);
        assert!(section.a[0].abs() < 1e-15);
    }

    #[test]
    fn what_cannot_be_designed_is_refused() {
        assert!(matches!(butterworth(0, 1.0, 0.1), Err(SignalError::Order { .. })));
        assert!(matches!(butterworth(13, 1.0, 0.1), Err(SignalError::Order { .. })));
        assert!(matches!(butterworth(2, 5.0, 0.1), Err(SignalError::Cutoff { .. })));
        assert!(matches!(butterworth(2, f64::NAN, 0.1), Err(SignalError::Cutoff { .. })));
        assert!(matches!(butterworth(2, 1.0, 0.0), Err(SignalError::SampleTime { .. })));
    }
}

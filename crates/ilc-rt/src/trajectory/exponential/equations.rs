//! Equations 2.2 to 2.18 of the thesis with their derivatives, independent of limits.
//!
//! Corrections of the print: `x_L(0) = 0` for any `b`, and with `b ≠ 0` the start jerk is `6 α b`;
//! the acceleration 2.10 has one minus; 2.11 is ½ at `c`; the exponents of 2.12 and 2.13 have
//! opposite signs.

use crate::trajectory::jet::Jet;

/// Start of a line, `x_L = (m t + b)(1 - e^{-α t³})`, and its velocity, acceleration and jerk.
///
/// # Units
/// - `slope_m_s` in m/s, `offset_m` in m, `alpha` in s⁻³
/// # Source
/// - \[dimarco2016\], Eq. 2.2 to 2.5
#[cfg(test)]
pub(super) fn startup_linear(t_s: f64, slope_m_s: f64, offset_m: f64, alpha: f64) -> Jet {
    let t = Jet::line(t_s, 1.0);
    Jet::line(slope_m_s * t_s + offset_m, slope_m_s) * (t.cubed() * alpha).rise()
}

/// Start of an oscillation, `x_S = A sin(ω t)(1 - e^{-α t²})`, and its derivatives.
///
/// # Units
/// - `amplitude_m` in m, `omega_rad_s` in rad/s, `alpha` in s⁻²
/// # Source
/// - \[dimarco2016\], Eq. 2.7 to 2.10
#[cfg(test)]
pub(super) fn startup_sine(t_s: f64, amplitude_m: f64, omega_rad_s: f64, alpha: f64) -> Jet {
    let t = Jet::line(t_s, 1.0);
    (t * omega_rad_s).sin() * (t.squared() * alpha).rise() * amplitude_m
}

/// Weight of the segment before a transition at `t = 0`: `a / (a + e^{α t})`, `a = R`.
///
/// With `b = 1/R` it and [`weight_after`] add up to 1 at every time, not at the corner alone, as
/// both are the sigmoid shifted by `ln R / α`.
///
/// # Source
/// - \[dimarco2016\], Eq. 2.12 and 2.17
pub(super) fn weight_before(t_s: f64, ratio: f64, alpha: f64) -> Jet {
    (-(Jet::line(alpha * t_s - ratio.ln(), alpha))).logistic()
}

/// Weight of the segment after a transition at `t = 0`: `b / (b + e^{-α t})`, `b = 1/R`.
///
/// # Source
/// - \[dimarco2016\], Eq. 2.13 and 2.18
pub(super) fn weight_after(t_s: f64, ratio: f64, alpha: f64) -> Jet {
    Jet::line(alpha * t_s - ratio.ln(), alpha).logistic()
}

/// Blending ratio at a transition: `|v₂/v₁|` at a reversal, so that the velocity is 0 there, and 1
/// otherwise. A move that ends (`v₂ = 0`) has no ratio and is not a transition.
///
/// # Source
/// - \[dimarco2016\], Eq. 2.15 and the listing of Appendix A
pub(super) fn blending_ratio(before_m_s: f64, after_m_s: f64) -> f64 {
    if before_m_s * after_m_s < 0.0 { (after_m_s / before_m_s).abs() } else { 1.0 }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact where exactness is promised")]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    /// Compares each derivative with a central difference of the previous one.
    fn assert_consistent(function: impl Fn(f64) -> Jet, t: f64, scale_s: f64) {
        let h = 1e-5 * scale_s;
        let (low, mid, high) = (function(t - h), function(t), function(t + h));
        for order in 0..3 {
            let slope = (high.0[order] - low.0[order]) / (2.0 * h);
            let size = mid.0[order + 1].abs() + mid.0[order].abs() / scale_s;
            assert!(
                (slope - mid.0[order + 1]).abs() <= 1e-6 * size + 1e-9,
                "order {order} at {t}: {slope} {mid:?}"
            );
        }
    }

    #[test]
    fn derivatives_belong_together() {
        let mut random = Random(31);
        for _ in 0..2_000 {
            let (m, b, alpha, omega) =
                (random.signed(), random.signed(), random.log(0.5, 50.0), random.log(0.5, 20.0));
            let t = random.unit() * 2.0;
            let ratio = random.log(0.05, 20.0);
            assert_consistent(|t| startup_linear(t, m, b, alpha), t, 0.05);
            assert_consistent(|t| startup_sine(t, m, omega, alpha), t, 0.05);
            assert_consistent(|t| weight_before(t - 1.0, ratio, alpha), t, 0.05);
            assert_consistent(|t| weight_after(t - 1.0, ratio, alpha), t, 0.05);
        }
    }

    #[test]
    fn the_printed_velocities_and_accelerations_come_out() {
        let (m, b, alpha, a, w) = (1.7_f64, 0.3_f64, 4.0_f64, 0.15_f64, 12.0_f64);
        for t in [0.0, 0.1, 0.37, 0.9_f64] {
            let e = (-alpha * t.powi(3)).exp();
            let found = startup_linear(t, m, b, alpha);
            let v = m - e * (m - 3.0 * alpha * m * t.powi(3) - 3.0 * alpha * b * t * t);
            let acc = e
                * (-9.0 * alpha * alpha * b * t.powi(4) - 9.0 * alpha * alpha * m * t.powi(5)
                    + 6.0 * alpha * b * t
                    + 12.0 * alpha * m * t * t);
            assert!((found.0[1] - v).abs() < 1e-13 && (found.0[2] - acc).abs() < 1e-12, "2.4, 2.5");
            let e = (-alpha * t * t).exp();
            let (s, c) = (w * t).sin_cos();
            let found = startup_sine(t, a, w, alpha);
            let v = 2.0 * a * alpha * t * e * s - a * w * e * c + a * w * c;
            let acc = -a
                * e
                * (4.0 * alpha * alpha * t * t * s + w * w * s / e
                    - 2.0 * alpha * s
                    - 4.0 * alpha * w * t * c
                    - w * w * s);
            assert!(
                (found.0[1] - v).abs() < 1e-13 && (found.0[2] - acc).abs() < 1e-11,
                "2.9, 2.10"
            );
        }
    }

    #[test]
    fn a_start_is_at_rest_and_its_jerk_is_the_offsets() {
        let start = startup_linear(0.0, 2.0, 0.5, 3.0).0;
        assert_eq!(start[..3], [0.0; 3], "x_L(0) is 0, not b");
        assert_eq!(start[3], 6.0 * 3.0 * 0.5);
        assert_eq!(startup_linear(0.0, 2.0, 0.0, 3.0).0, [0.0; 4]);
        let sine = startup_sine(0.0, 0.1, 10.0, 3.0).0;
        assert_eq!(sine[..3], [0.0; 3]);
        assert!((sine[3] - 6.0 * 0.1 * 10.0 * 3.0).abs() < 1e-12, "6 A w alpha");
    }

    #[test]
    fn weights_add_up_to_one_and_have_their_ratio_at_the_corner() {
        for ratio in [0.1, 0.5, 1.0, 3.0] {
            for t in [-2.0, -0.3, 0.0, 0.2, 5.0] {
                let sum = weight_before(t, ratio, 4.0) + weight_after(t, ratio, 4.0);
                assert!((sum.0[0] - 1.0).abs() < 1e-15);
                assert!(sum.0[1..].iter().all(|d| d.abs() < 1e-13));
            }
            let (before, after) = (weight_before(0.0, ratio, 4.0), weight_after(0.0, ratio, 4.0));
            assert!((before.0[0] / after.0[0] - ratio).abs() < 1e-12, "2.15");
            assert!((before.0[0] - ratio / (1.0 + ratio)).abs() < 1e-15, "2.16");
        }
        assert_eq!(weight_after(0.0, 1.0, 4.0).0[0], 0.5, "one half at c, not 1");
    }

    #[test]
    fn the_velocity_is_zero_where_the_direction_turns_round() {
        let (v1, v2) = (10.0, -5.0);
        let ratio = blending_ratio(v1, v2);
        assert_eq!(ratio, 0.5);
        let along = Jet::line(0.0, v1) * weight_before(0.0, ratio, 2.0)
            + Jet::line(0.0, v2) * weight_after(0.0, ratio, 2.0);
        assert!(along.0[1].abs() < 1e-15);
        assert_eq!(blending_ratio(10.0, 5.0), 1.0);
    }

    #[test]
    fn the_logistic_survives_any_argument() {
        for x in [-1e4, -800.0, 800.0, 1e4] {
            let jet = Jet::line(x, 3.0).logistic();
            assert!(jet.0.iter().all(|d| d.is_finite()));
            assert_eq!(jet.0[0], if x < 0.0 { 0.0 } else { 1.0 });
        }
    }
}

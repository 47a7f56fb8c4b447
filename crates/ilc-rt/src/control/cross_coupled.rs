//! Cross-coupled control (CCC): corrects two axes together, normal to the path.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{Bounded, Pid, clamp_finite};

/// Cross-coupled control of two axes.
///
/// `epsilon = c_1 e_1 + c_2 e_2`, `w = PID(epsilon)`, `u_i += c_i w`
///
/// # Source
/// - \[koren1991\], Fig. 2, with the signs of \[barton2010\], Eq. (4.1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossCoupled {
    controller: Pid,
}

impl CrossCoupled {
    /// Creates the coupling from a controller of the contour error.
    pub fn new(controller: Pid) -> Self {
        Self { controller }
    }

    /// Returns the corrections of the two axes' commands, and the contour error they are based on.
    ///
    /// # Real Time
    /// Hot. A non-finite correction is replaced by 0.
    pub fn step(&mut self, error_m: [f64; 2], gains: [f64; 2]) -> ([Bounded; 2], f64) {
        let contour_m = gains[0] * error_m[0] + gains[1] * error_m[1];
        let correction = self.controller.step(contour_m);
        let share = |gain: f64| Bounded {
            saturated: correction.saturated,
            finite: correction.finite && gain.is_finite(),
            ..clamp_finite(gain * correction.value, f64::INFINITY)
        };
        (gains.map(share), contour_m)
    }

    /// Resets the controller to rest.
    pub fn reset(&mut self) {
        self.controller.reset();
    }
}

/// Returns the variable-gain coupling coefficients of a curved path.
///
/// `c_1 = -sin theta + kappa e_1 / 2`, `c_2 = cos theta + kappa e_2 / 2`: with them `c . e` is the
/// distance from the osculating circle to second order, i.e. up to an error of the size of (square
/// of that distance) / radius.
///
/// # Units
/// - `tangent`: unit vector; curvature in 1/m, positive to the left
/// # Real Time
/// Hot.
/// # Source
/// - \[koren1991\], Eq. (5) and (6), there with `R = 1 / kappa`.
pub fn variable_gains(tangent: [f64; 2], error_m: [f64; 2], curvature_per_m: f64) -> [f64; 2] {
    let half = 0.5 * curvature_per_m;
    [-tangent[1] + half * error_m[0], tangent[0] + half * error_m[1]]
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    reason = "tests are cold"
)]
mod tests {
    use super::*;
    use crate::control::{Derivative, PidGains};

    fn proportional(kp: f64) -> CrossCoupled {
        CrossCoupled::new(Pid::new(
            PidGains {
                kp,
                ki_per_s: 0.0,
                kd_s: 0.0,
                derivative: Derivative::Difference,
                output_max: f64::INFINITY,
            },
            0.001,
        ))
    }

    #[test]
    fn an_error_along_the_path_is_left_alone_and_one_across_is_corrected() {
        let half = 0.5_f64.sqrt();
        let gains = variable_gains([half, half], [0.0; 2], 0.0);
        let mut coupled = proportional(10.0);
        let (along, contour) = coupled.step([1e-3, 1e-3], gains);
        assert!(contour.abs() < 1e-18 && along.iter().all(|part| part.value.abs() < 1e-16));
        let (across, contour) = coupled.step([-1e-3, 1e-3], gains);
        assert!((contour - 1e-3 * 2.0_f64.sqrt()).abs() < 1e-18);
        assert!((across[0].value + 1e-2).abs() < 1e-16 && (across[1].value - 1e-2).abs() < 1e-16);
    }

    #[test]
    fn on_a_circle_the_variable_gains_leave_a_cubic_error() {
        let radius = 0.05_f64;
        for (along, across) in [(1e-3, 2e-4), (2e-3, -1e-4), (-1e-3, 0.0)] {
            // Reference at (radius, 0) moving up; the centre of curvature is to its left, at the
            // origin.
            let error = [across, along];
            let actual: [f64; 2] = [radius - error[0], -error[1]];
            let wanted = actual[0].hypot(actual[1]) - radius;
            let gains = variable_gains([0.0, 1.0], error, 1.0 / radius);
            let found = gains[0] * error[0] + gains[1] * error[1];
            let linear = -error[0];
            assert!((found - wanted).abs() < 0.2 * (linear - wanted).abs(), "{found} {wanted}");
        }
    }

    #[test]
    fn what_is_not_finite_adds_nothing() {
        let (added, _) = proportional(1.0).step([f64::NAN, 0.0], [1.0, 0.0]);
        assert!(added.iter().all(|part| part.value == 0.0 && !part.finite));
    }
}

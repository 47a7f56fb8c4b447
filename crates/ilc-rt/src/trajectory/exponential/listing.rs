//! The program of the thesis's Appendix A: two legs on one axis, every α given. Not limited: it
//! reproduces a published motion exactly; used by the Python bindings.

use super::equations::{weight_after, weight_before};
use crate::interpolate::MAX_AXES;
use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::jet::Jet;
use crate::trajectory::motion::{MotionState, SampledMotion};

/// One leg of the listing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ListedLeg {
    /// Velocity, signed.
    pub velocity_m_s: f64,
    /// Amplitude of the oscillation.
    pub amplitude_m: f64,
    /// Angular frequency of the oscillation.
    pub omega_rad_s: f64,
    /// Time at which the phase of the oscillation is 0.
    pub phase_zero_s: f64,
}

/// Two legs joined by sigmoids, with a start from rest at 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Listing {
    /// The legs.
    pub legs: [ListedLeg; 2],
    /// Time at which the first leg gives way to the second.
    pub corner_s: f64,
    /// α of the start, in s⁻², on line and oscillation alike.
    pub start_alpha: f64,
    /// α of the transition, in s⁻¹.
    pub transition_alpha: f64,
    /// α of the windows of the oscillations, in s⁻¹.
    pub sine_alpha: f64,
    /// Distance in time from the corner at which the windows are half open.
    pub sine_offset_s: f64,
}

impl Listing {
    /// Returns the parameters printed in the listing.
    #[cfg(test)]
    fn printed() -> Self {
        Self {
            legs: [
                ListedLeg {
                    velocity_m_s: 10.0,
                    amplitude_m: 2.0,
                    omega_rad_s: 10.0,
                    phase_zero_s: 0.0,
                },
                ListedLeg {
                    velocity_m_s: -5.0,
                    amplitude_m: 1.0,
                    omega_rad_s: 20.0,
                    phase_zero_s: 6.01,
                },
            ],
            corner_s: 6.0,
            start_alpha: 5.0,
            transition_alpha: 2.0,
            sine_alpha: 3.0,
            sine_offset_s: 1.0,
        }
    }

    /// Returns position, velocity, acceleration and jerk at a time from the start.
    ///
    /// # Real Time
    /// Hot: does not allocate.
    /// # Source
    /// - \[dimarco2016\], Appendix A
    pub fn at(&self, t_s: f64) -> Jet {
        let from_corner_s = t_s - self.corner_s;
        let t = Jet::line(t_s, 1.0);
        let corner_m = self.legs[0].velocity_m_s * self.corner_s;
        let path = |leg: &ListedLeg, window: Jet| {
            let phase = leg.omega_rad_s * (t_s - leg.phase_zero_s);
            Jet::line(corner_m + leg.velocity_m_s * from_corner_s, leg.velocity_m_s)
                + Jet::line(phase, leg.omega_rad_s).sin() * window * leg.amplitude_m
        };
        let [first, second] = &self.legs;
        let closing = weight_before(from_corner_s + self.sine_offset_s, 1.0, self.sine_alpha);
        let opening = weight_after(from_corner_s - self.sine_offset_s, 1.0, self.sine_alpha);
        // The listing corrects every transition, reversing or not.
        let ratio = (second.velocity_m_s / first.velocity_m_s).abs();
        let joined = path(first, closing)
            * weight_before(from_corner_s, ratio, self.transition_alpha)
            + path(second, opening) * weight_after(from_corner_s, ratio, self.transition_alpha);
        joined * (t.squared() * self.start_alpha).rise()
    }

    /// Position of the two legs at a time with their oscillations, without start and transition.
    pub fn programmed_m(&self, t_s: f64) -> f64 {
        let [first, second] = &self.legs;
        let leg = if t_s < self.corner_s { first } else { second };
        let corner_m = first.velocity_m_s * self.corner_s;
        corner_m
            + leg.velocity_m_s * (t_s - self.corner_s)
            + leg.amplitude_m * (leg.omega_rad_s * (t_s - leg.phase_zero_s)).sin()
    }

    /// Samples the motion from its start.
    ///
    /// # Real Time
    /// Cold: allocates.
    /// # Errors
    /// [`TrajectoryError`] for a velocity of 0, an α or a time that is not positive, or a
    /// non-finite number.
    pub fn sample(&self, duration_s: f64, dt_s: f64) -> Result<SampledMotion, TrajectoryError> {
        let refuse = |name, value, allowed| Err(TrajectoryError::Shape { name, value, allowed });
        for (name, value) in [
            ("duration_s", duration_s),
            ("corner_s", self.corner_s),
            ("start_alpha", self.start_alpha),
            ("transition_alpha", self.transition_alpha),
            ("sine_alpha", self.sine_alpha),
        ] {
            if !is_positive(value) {
                return refuse(name, value, "a finite number above 0");
            }
        }
        for leg in &self.legs {
            let is_still = leg.velocity_m_s.abs() <= 0.0;
            if is_still || !leg.velocity_m_s.is_finite() {
                return refuse("velocity_m_s", leg.velocity_m_s, "a finite number other than 0");
            }
            for (name, value) in [
                ("amplitude_m", leg.amplitude_m),
                ("omega_rad_s", leg.omega_rad_s),
                ("phase_zero_s", leg.phase_zero_s),
                ("sine_offset_s", self.sine_offset_s),
            ] {
                if !value.is_finite() {
                    return refuse(name, value, "a finite number");
                }
            }
        }
        let on_first_axis = |value: f64| {
            let mut axes = [0.0; MAX_AXES];
            axes[0] = value;
            axes
        };
        SampledMotion::sample(duration_s, dt_s, 1, |t_s| {
            let [x, v, a, j] = self.at(t_s).0.map(on_first_axis);
            let state =
                MotionState { position_m: x, velocity_m_s: v, acceleration_m_s2: a, jerk_m_s3: j };
            (state, on_first_axis(self.programmed_m(t_s)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_printed_program_gives_its_1401_samples() {
        let golden = include_str!("../../../../../tests/golden/dimarco_appendix_a.csv");
        let listing = Listing::printed();
        let mut n_samples = 0;
        for row in golden.lines().filter(|row| !row.starts_with('#') && !row.starts_with('t')) {
            let mut columns = row.split(',').map(|column| column.parse::<f64>().unwrap());
            let (t, x) = (columns.next().unwrap(), columns.next().unwrap());
            let found = listing.at(t).0[0];
            assert!((found - x).abs() < 1e-9, "{t}: {found} {x}");
            n_samples += 1;
        }
        assert_eq!(n_samples, 1401);
        let motion = listing.sample(14.0, 0.01).unwrap();
        assert_eq!((motion.n_samples(), motion.n_axes), (1401, 1));
        // Between start and transition it follows its program, and reverses before the corner.
        for k in [200, 250, 1150, 1300] {
            let miss = motion.position_m[k] - motion.programmed_m[k];
            assert!(miss.abs() < 0.1, "{k}: {miss}");
        }
    }

    #[test]
    fn a_number_that_cannot_be_is_refused() {
        let printed = Listing::printed();
        assert!(printed.sample(0.0, 0.01).is_err() && printed.sample(14.0, 0.0).is_err());
        for bad in [
            Listing { start_alpha: 0.0, ..printed },
            Listing { transition_alpha: f64::NAN, ..printed },
            Listing { sine_alpha: -1.0, ..printed },
            Listing { corner_s: f64::INFINITY, ..printed },
            Listing { sine_offset_s: f64::NAN, ..printed },
            Listing { legs: [ListedLeg { velocity_m_s: 0.0, ..printed.legs[0] }; 2], ..printed },
            Listing {
                legs: [ListedLeg { amplitude_m: f64::NAN, ..printed.legs[0] }; 2],
                ..printed
            },
        ] {
            assert!(
                matches!(bad.sample(14.0, 0.01), Err(TrajectoryError::Shape { .. })),
                "{bad:?}"
            );
        }
    }
}

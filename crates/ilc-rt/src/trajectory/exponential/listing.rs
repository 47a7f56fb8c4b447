//! The program of the thesis's Appendix A: two legs on one axis, every α given. Nothing is limited.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::equations::{weight_after, weight_before};
use super::jet::Jet;

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
    /// When the first leg gives way to the second.
    pub corner_s: f64,
    /// α of the start, in s⁻², on line and oscillation alike.
    pub start_alpha: f64,
    /// α of the transition, in s⁻¹.
    pub transition_alpha: f64,
    /// α of the windows of the oscillations, in s⁻¹.
    pub sine_alpha: f64,
    /// How far from the corner the windows are half open.
    pub sine_offset_s: f64,
}

impl Listing {
    /// The numbers printed in the listing.
    pub fn printed() -> Self {
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

    /// Position, velocity, acceleration and jerk at a time from the start.
    ///
    /// # Real Time
    /// Hot, allocates nothing.
    /// # Source
    /// - [dimarco2016], Appendix A
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
        // The listing corrects every transition, whichever way it goes on.
        let ratio = (second.velocity_m_s / first.velocity_m_s).abs();
        let joined = path(first, closing)
            * weight_before(from_corner_s, ratio, self.transition_alpha)
            + path(second, opening) * weight_after(from_corner_s, ratio, self.transition_alpha);
        joined * (t.squared() * self.start_alpha).rise()
    }
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
    }
}

//! One straight leg of an E/S move along its direction, and the effects of its two ends.
//!
//! The programmed motion is `v t + A sin(ω t)`. Each end adds a deviation from the line and a
//! window on the oscillation. A deviation has decayed at the other end, and a window is multiplied
//! by one that is closed there: so the leg is exactly at rest, or at its corner, whatever α each
//! end has.

use super::equations::weight_after;
use crate::interpolate::line::Line;
use crate::trajectory::jet::Jet;

/// Exponent at which exponentials count as gone: `e^{-45}` is below the rounding of 1.
pub(super) const GONE: f64 = 45.0;
/// `∛45`: where `e^{-x³}` has decayed.
const GONE_CUBE_ROOT: f64 = 3.556_893_304_490_063;
/// Clearance of the oscillation from a corner, in units of `1/α`, beyond `A/v`.
const CLEARANCE: f64 = 4.0;

/// One end of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
    /// From rest, or to rest as its mirror image: Eq. 2.3, α in s⁻³.
    Rest,
    /// Into or out of a neighbour on the same line, with its velocity along this leg: Eq. 2.12 and
    /// 2.13, α in s⁻¹.
    Transition {
        /// Velocity of the neighbour along the direction of this leg.
        neighbour_m_s: f64,
        /// `R`, of the later over the earlier speed.
        ratio: f64,
    },
}

/// A leg with the parameters of its motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub(super) feed_m_s: f64,
    pub(super) amplitude_m: f64,
    pub(super) omega_rad_s: f64,
    pub(super) duration_s: f64,
    pub(super) ends: [End; 2],
    /// α of the first and of the last end; `None` while it is not chosen.
    pub(super) alpha: [Option<f64>; 2],
}

/// A leg with its line, and its start time.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlacedLeg {
    pub(super) leg: Leg,
    pub(super) line: Line,
    pub(super) start_s: f64,
}

impl Leg {
    /// Deviation from the line by this end, at a time counted from the end into the leg, and the window
    /// of the oscillation there. Read forward in that time; the last end is reversed by the caller.
    fn end(&self, which: usize, tau_s: f64) -> (Jet, Jet) {
        let Some(alpha) = self.alpha[which] else {
            return (Jet::constant(0.0), Jet::constant(1.0));
        };
        let (tau, v) = (Jet::line(tau_s, 1.0), self.feed_m_s);
        let deviation = match self.ends[which] {
            End::Rest => -(tau * v) * (tau.cubed() * alpha).decay(),
            End::Transition { neighbour_m_s, ratio } => {
                // The neighbour's weight at the distance tau from the corner; its ratio is inverted
                // if time is reversed.
                let ratio = if which == 0 { ratio } else { 1.0 / ratio };
                let neighbour = Jet::constant(1.0) - weight_after(tau_s, ratio, alpha);
                tau * (neighbour_m_s - v) * neighbour
            }
        };
        let window = match self.ends[which] {
            _ if self.amplitude_m == 0.0 => Jet::constant(0.0),
            End::Rest if which == 0 => (tau.squared() * alpha).rise(),
            _ => {
                let clear_s = self.clearance_s(which);
                if tau_s < clear_s {
                    Jet::constant(0.0)
                } else {
                    let open = Jet::line(tau_s - clear_s, 1.0).cubed();
                    let rate = match self.ends[which] {
                        End::Rest => alpha,
                        End::Transition { .. } => alpha.powi(3),
                    };
                    (open * rate).rise()
                }
            }
        };
        (deviation, window)
    }

    /// Distance from a corner within which the oscillation stays at 0: beyond it the line is farther from the
    /// corner than the oscillation reaches, so that it never passes the corner. A start has none.
    pub(super) fn clearance_s(&self, which: usize) -> f64 {
        let Some(alpha) = self.alpha[which] else { return 0.0 };
        if self.amplitude_m == 0.0 {
            return 0.0;
        }
        match self.ends[which] {
            End::Rest if which == 0 => 0.0,
            End::Rest => self.amplitude_m / self.feed_m_s + alpha.cbrt().recip(),
            End::Transition { ratio, .. } => {
                self.amplitude_m / self.feed_m_s + (CLEARANCE + ratio.ln().abs()) / alpha
            }
        }
    }

    /// Duration of an end: of the deviation, and of the opening of the window.
    pub(super) fn reach_s(&self, which: usize) -> (f64, f64) {
        let Some(alpha) = self.alpha[which] else { return (0.0, 0.0) };
        let oscillates = self.amplitude_m != 0.0;
        match self.ends[which] {
            End::Rest => {
                let deviation_s = (GONE / alpha).cbrt();
                let window_s = match (oscillates, which) {
                    (false, _) => 0.0,
                    (true, 0) => (GONE / alpha).sqrt(),
                    (true, _) => self.clearance_s(which) + deviation_s,
                };
                (deviation_s, window_s)
            }
            End::Transition { neighbour_m_s, ratio } => {
                let still = (neighbour_m_s - self.feed_m_s).abs() <= 0.0;
                let deviation_s = if still { 0.0 } else { (GONE + ratio.ln().abs()) / alpha };
                let window_s =
                    if oscillates { self.clearance_s(which) + GONE_CUBE_ROOT / alpha } else { 0.0 };
                (deviation_s, window_s)
            }
        }
    }

    /// Returns the motion along the leg at a time from its first end.
    ///
    /// The position is relative to the nearer end, given by `from_end`, so that both ends are
    /// exact.
    pub(super) fn at(&self, t_s: f64) -> (Jet, bool) {
        let left_s = self.duration_s - t_s;
        let (first, opening) = self.end(0, t_s);
        let (last, closing) = self.end(1, left_s);
        let (last, closing) = (-last.reversed(), closing.reversed());
        let from_end = left_s < t_s;
        let line = if from_end {
            Jet::line(-self.feed_m_s * left_s, self.feed_m_s)
        } else {
            Jet::line(self.feed_m_s * t_s, self.feed_m_s)
        };
        let mut motion = line + first + last;
        if self.amplitude_m != 0.0 {
            let phase = Jet::line(self.omega_rad_s * t_s, self.omega_rad_s);
            motion = motion + phase.sin() * opening * closing * self.amplitude_m;
        }
        (motion, from_end)
    }

    /// Returns the programmed position, without any end.
    pub(super) fn programmed_m(&self, t_s: f64) -> f64 {
        self.feed_m_s * t_s + self.amplitude_m * (self.omega_rad_s * t_s).sin()
    }
}

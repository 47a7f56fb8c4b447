//! The windows of a blended path: verified against the limits, with a proposal if they are
//! violated.
//!
//! The set points are generated once, exactly as in the loop, and their finite differences over the
//! cycle are compared with the limits: nothing is estimated.

use super::spec::feed_max_m_s;
use crate::interpolate::blend::Blend;
use crate::interpolate::element::Leg;
use crate::interpolate::{AxisLimits, MAX_AXES, Quantity};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::grid::{check_time, n_ticks_after};
use crate::trajectory::verify::{Differences, ROWS_AFTER, TOLERANCE, rounding_noise};

/// Longest blend window.
const WINDOW_MAX_S: f64 = 10.0;
/// Steps of each bracketing search for a proposal.
const SEARCH_STEPS: usize = 12;

/// A violated limit.
#[derive(Clone, Copy, Debug)]
struct Excess {
    axis: usize,
    quantity: Quantity,
    reached: f64,
    limit: f64,
}

/// The legs of a path to blend, their start time, and their limits.
pub(in crate::trajectory) struct BlendedPath<'a> {
    pub(in crate::trajectory) legs: &'a [Leg],
    pub(in crate::trajectory) start_s: f64,
    pub(in crate::trajectory) limits: &'a [AxisLimits],
    pub(in crate::trajectory) cycle_s: f64,
}

impl BlendedPath<'_> {
    /// Finds a second window that satisfies every limit, as short as a bracketing search finds it,
    /// and returns the plan with the tick at which it is at rest at its end.
    ///
    /// # Errors
    /// [`TrajectoryError::Exceeds`] with the worst violation and the largest feed and shortest
    /// window that satisfy the limits.
    pub(in crate::trajectory) fn plan(
        &self,
        window_s: f64,
    ) -> Result<(Blend, usize), TrajectoryError> {
        check_time("blend window", window_s, (self.cycle_s, WINDOW_MAX_S))?;
        let window = ticks(window_s, self.cycle_s);
        let mut broken = 0;
        let mut holds = 1;
        if self.excess(window, holds)?.is_some() {
            (broken, holds) = (1, window);
            if let Some(excess) = self.excess(window, window)? {
                return Err(self.refusal(excess, window));
            }
        }
        while holds - broken > 1 {
            let middle = broken.midpoint(holds);
            if self.excess(window, middle)?.is_some() { broken = middle } else { holds = middle }
        }
        self.candidate(window, holds)
    }

    /// Returns the plan for a pair of windows, and the tick at which it is at rest at its end.
    fn candidate(&self, window: usize, rounding: usize) -> Result<(Blend, usize), TrajectoryError> {
        let blend = Blend::plan(
            self.legs,
            self.limits.len(),
            self.start_s,
            self.cycle_s,
            (window, rounding),
        );
        let rest_tick = n_ticks_after(blend.end_s(), self.cycle_s)? + blend.ticks_late();
        Ok((blend, rest_tick))
    }

    /// Returns the worst violation of a pair of windows, relative to its limit; `None` if every
    /// limit is satisfied.
    fn excess(&self, window: usize, rounding: usize) -> Result<Option<Excess>, TrajectoryError> {
        let (mut blend, rest_tick) = self.candidate(window, rounding)?;
        let peaks = peaks(&mut blend, self.limits.len(), rest_tick, self.cycle_s);
        let mut worst: Option<Excess> = None;
        for (axis, limit) in self.limits.iter().enumerate() {
            for (order, (quantity, limit)) in limit.named().into_iter().enumerate() {
                let reached = peaks.of_axis[axis][order];
                let rounding_noise = rounding_noise(peaks.farthest_m, order, self.cycle_s);
                let excess = Excess { axis, quantity, reached, limit };
                if reached > limit * (1.0 + TOLERANCE) + rounding_noise
                    && worst.is_none_or(|worst| reached / limit > worst.reached / worst.limit)
                {
                    worst = Some(excess);
                }
            }
        }
        Ok(worst)
    }

    /// Returns the error with proposals; both are verified first.
    fn refusal(&self, excess: Excess, window: usize) -> TrajectoryError {
        let Excess { axis, quantity, reached, limit } = excess;
        let feed_factor = self.feed_factor(limit / reached, window);
        TrajectoryError::Exceeds {
            axis,
            quantity,
            reached,
            limit,
            feed_factor,
            feed_admissible: feed_factor * feed_max_m_s(self.legs),
            window_admissible_s: self
                .window_ticks(window, reached / limit)
                .map(|ticks| ticks as f64 * self.cycle_s),
        }
    }

    fn feed_holds(&self, factor: f64, window: usize) -> bool {
        let slower = |leg: &Leg| Leg { feed_m_s: leg.feed_m_s * factor, ..*leg };
        let legs: Vec<Leg> = self.legs.iter().map(slower).collect();
        matches!(BlendedPath { legs: &legs, ..*self }.excess(window, window), Ok(None))
    }

    /// Returns the largest factor on all feeds that satisfies every limit, from below; 0 if none is
    /// found.
    fn feed_factor(&self, guess: f64, window: usize) -> f64 {
        let (mut holds, mut broken) = (guess * (1.0 - TOLERANCE), 1.0);
        let mut attempts = 0;
        while !self.feed_holds(holds, window) {
            (holds, broken) = (0.5 * holds, holds);
            attempts += 1;
            if attempts > SEARCH_STEPS {
                return 0.0;
            }
        }
        for _ in 0..SEARCH_STEPS {
            let middle = 0.5 * (holds + broken);
            if self.feed_holds(middle, window) { holds = middle } else { broken = middle }
        }
        holds
    }

    fn window_holds(&self, window: usize) -> bool {
        matches!(self.excess(window, window), Ok(None))
    }

    /// Returns a longer window that satisfies every limit; `None` if the longest one does not, or
    /// if a segment alone is too fast for an axis, as averaging does not slow down a straight line.
    fn window_ticks(&self, window: usize, ratio: f64) -> Option<usize> {
        for leg in self.legs {
            let path = leg.element.limits(self.limits, leg.feed_m_s);
            if path.velocity_m_s < leg.feed_m_s * (1.0 - TOLERANCE) {
                return None;
            }
        }
        let longest = ticks(WINDOW_MAX_S, self.cycle_s);
        let (mut broken, mut holds) = (window, window);
        while !self.window_holds(holds) {
            let wider_s = holds as f64 * self.cycle_s * ratio.clamp(1.25, 2.0);
            let wider = ticks(wider_s, self.cycle_s).max(holds + 1);
            if wider > longest {
                return None;
            }
            (broken, holds) = (holds, wider);
        }
        for _ in 0..SEARCH_STEPS {
            if holds - broken <= 1 {
                break;
            }
            let middle = broken.midpoint(holds);
            if self.window_holds(middle) { holds = middle } else { broken = middle }
        }
        Some(holds)
    }
}

/// Largest finite differences of order 1, 2 and 3 over the cycle.
struct Peaks {
    of_axis: [[f64; 3]; MAX_AXES],
    farthest_m: f64,
}

fn peaks(blend: &mut Blend, n_axes: usize, rest_tick: usize, cycle_s: f64) -> Peaks {
    let mut peaks = Peaks { of_axis: [[0.0; 3]; MAX_AXES], farthest_m: 0.0 };
    let mut differences = Differences::from_rest(&blend.next().position_m[..n_axes], cycle_s);
    for _ in 0..rest_tick + ROWS_AFTER {
        let row_m = blend.next().position_m;
        let found = differences.next(&row_m[..n_axes]);
        for (axis, found) in found.iter().enumerate().take(n_axes) {
            peaks.farthest_m = peaks.farthest_m.max(row_m[axis].abs());
            for (peak, value) in peaks.of_axis[axis].iter_mut().zip(found) {
                *peak = peak.max(value.abs());
            }
        }
    }
    peaks
}

/// Converts a window to whole cycles, rounded up.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "window and cycle are checked; the quotient is 1 to 1e7"
)]
fn ticks(window_s: f64, cycle_s: f64) -> usize {
    ((window_s / cycle_s - 1e-6).ceil() as usize).max(1)
}

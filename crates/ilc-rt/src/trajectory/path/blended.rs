//! Proof that a blended path holds the limits, and what to change if it does not. Cold.
//!
//! The set points are generated once, as the loop will generate them, and their finite differences
//! over the cycle are compared with the limits: nothing is estimated.

use crate::interpolate::MAX_AXES;
use crate::interpolate::blend::Blend;
use crate::interpolate::element::Element;
use crate::trajectory::error::{Quantity, TrajectoryError};
use crate::interpolate::limits::AxisLimits;
use crate::trajectory::path::{PathSpec, check_time};
use crate::trajectory::verify::{Differences, ROWS_AFTER, TOLERANCE, rounding_noise};

/// Most samples of one run.
pub(crate) const N_SAMPLES_MAX: usize = 10_000_000;
/// Longest blend window.
const WINDOW_MAX_S: f64 = 10.0;
/// Steps of each bracketing search for a remedy.
const SEARCH_STEPS: usize = 12;

/// A limit that the set points break.
#[derive(Clone, Copy, Debug)]
struct Excess {
    axis: usize,
    quantity: Quantity,
    reached: f64,
    limit: f64,
}

/// A path with the things that its proof needs.
pub(crate) struct Proof<'a> {
    pub(crate) spec: &'a PathSpec,
    pub(crate) elements: &'a [Element],
    pub(crate) limits: &'a [AxisLimits],
    pub(crate) cycle_s: f64,
}

impl Proof<'_> {
    /// Finds the second window for which every limit holds, as short as a bracketing search finds
    /// it, and gives the plan with the tick at which it is at rest at its end.
    ///
    /// # Errors
    /// [`TrajectoryError::Exceeds`] with the worst excess and the feed and window that would do.
    pub(crate) fn plan(&self, window_s: f64) -> Result<(Blend, usize), TrajectoryError> {
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

    /// The plan for a pair of windows, and the tick at which it is at rest at its end.
    fn candidate(&self, window: usize, rounding: usize) -> Result<(Blend, usize), TrajectoryError> {
        let blend = Blend::plan(self.spec, self.elements, self.cycle_s, (window, rounding));
        let rest_tick = n_ticks_after(blend.end_s(), self.cycle_s)? + blend.ticks_late();
        Ok((blend, rest_tick))
    }

    /// The worst excess of a pair of windows, relative to its limit; none if every limit holds.
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

    /// The error with what would help; both remedies are themselves proven before they are named.
    fn refusal(&self, excess: Excess, window: usize) -> TrajectoryError {
        let Excess { axis, quantity, reached, limit } = excess;
        let feed_factor = self.feed_factor(limit / reached, window);
        TrajectoryError::Exceeds {
            axis,
            quantity,
            reached,
            limit,
            feed_factor,
            feed_admissible_m_s: feed_factor * self.spec.feed_max_m_s(),
            window_admissible_s: self
                .window_ticks(window, reached / limit)
                .map(|ticks| ticks as f64 * self.cycle_s),
        }
    }

    fn feed_holds(&self, factor: f64, window: usize) -> bool {
        let slower = self.spec.with_feed_times(factor);
        let proof = Proof { spec: &slower, ..*self };
        matches!(proof.excess(window, window), Ok(None))
    }

    /// The largest factor on all feeds that holds every limit, from below; 0 if none is found.
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

    /// A longer window that holds every limit; none up to the longest one allowed, and none if a
    /// segment by itself is too fast for an axis, as averaging does not slow a straight line down.
    fn window_ticks(&self, window: usize, ratio: f64) -> Option<usize> {
        for (element, segment) in self.elements.iter().zip(&self.spec.segments) {
            let path = element.limits(self.limits, segment.feed_m_s);
            if path.velocity_m_s < segment.feed_m_s * (1.0 - TOLERANCE) {
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

/// A window as whole cycles, rounded up.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "window and cycle are checked; the quotient is 1 to 1e7"
)]
fn ticks(window_s: f64, cycle_s: f64) -> usize {
    ((window_s / cycle_s - 1e-6).ceil() as usize).max(1)
}

/// Whole cycles that cover a duration.
///
/// # Errors
/// [`TrajectoryError::TooLong`] if a run may not have so many samples.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "compared with the most samples before the cast; durations are not negative"
)]
pub(crate) fn n_ticks(duration_s: f64, cycle_s: f64) -> Result<usize, TrajectoryError> {
    let n_samples = (duration_s / cycle_s - 1e-6).ceil().max(0.0);
    if n_samples <= N_SAMPLES_MAX as f64 {
        Ok(n_samples as usize)
    } else {
        Err(TrajectoryError::TooLong { duration_s, n_samples, n_samples_max: N_SAMPLES_MAX })
    }
}

/// The first tick at or after a time, on the grid as the tick computes it.
///
/// # Errors
/// As [`n_ticks`].
pub(crate) fn n_ticks_after(time_s: f64, cycle_s: f64) -> Result<usize, TrajectoryError> {
    let tick = n_ticks(time_s, cycle_s)?;
    Ok(if (tick as f64) * cycle_s < time_s { tick + 1 } else { tick })
}

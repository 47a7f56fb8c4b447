//! Search of the largest admissible α.
//!
//! The peaks of velocity, acceleration and jerk are not monotone in α: an oscillation and a start
//! may amplify or cancel each other. So α is scanned, every crossing bracketed and bisected, minima
//! and maxima between two points of the scan refined, and all admissible intervals reported. An end
//! is checked together with the other end of its leg where their effects overlap, on the executed
//! motion.

use super::leg::{End, Leg};
use super::peaks::{GOLDEN, peaks};
use crate::interpolate::PathLimits;
use crate::interpolate::Quantity;
use crate::trajectory::error::TrajectoryError;

/// Scan points per decade of α.
const PER_DECADE: f64 = 12.0;
/// Most scan points: those of all numbers.
const POINTS_MAX: f64 = 7600.0;
/// A maximum of the scan is refined above this.
const NEAR: f64 = 0.9;
/// Golden-section steps of a minimum or maximum.
const SECTIONS: usize = 16;
/// Bisections of a crossing.
const STEPS: usize = 32;

/// An interval of α in which every limit is satisfied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaInterval {
    /// Smallest α.
    pub from: f64,
    /// Largest α.
    pub to: f64,
}

/// A place with an α to choose: one end of one leg, or of two that meet.
pub(super) struct Place<'a> {
    /// The legs that end here, each with the end concerned.
    pub(super) legs: &'a [(Leg, usize)],
    pub(super) limits: PathLimits,
    /// Margin of each limit: for the rounding of a peak, or for later ends.
    pub(super) margin: f64,
    /// Requested upper bound of α.
    pub(super) alpha_max: f64,
    /// Index of the first leg, for the refusal.
    pub(super) segment: usize,
    pub(super) name: &'static str,
}

impl Place<'_> {
    /// Returns the largest admissible α, and all admissible intervals in ascending order.
    ///
    /// # Errors
    /// [`TrajectoryError::Alpha`] with the limit nearest to being satisfied if no α is admissible,
    /// [`TrajectoryError::Hurried`] if a leg is too short for any, [`TrajectoryError::AlphaMax`] if
    /// the upper bound is too small for the leg.
    pub(super) fn choose(&self) -> Result<(f64, Vec<AlphaInterval>), TrajectoryError> {
        let smallest = self.smallest()?;
        if self.alpha_max.is_nan() || self.alpha_max < smallest {
            return Err(TrajectoryError::AlphaMax {
                segment: self.segment,
                place: self.name,
                value: self.alpha_max,
                min: smallest,
            });
        }
        let largest = self.largest().max(1.001 * smallest).min(self.alpha_max);
        // Numbers so far apart that their ratio is infinite scan nothing.
        let n_points = ((largest / smallest).log10() * PER_DECADE).ceil().clamp(4.0, POINTS_MAX);
        let step = (largest / smallest).powf(1.0 / n_points);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the least and the most points"
        )]
        let alphas: Vec<f64> = (0..=n_points as usize)
            .map(|i| (smallest * step.powf(i as f64)).min(largest))
            .collect();
        let ratios: Vec<f64> = alphas.iter().map(|&alpha| self.excess(alpha, false).0).collect();
        let mut found: Vec<(f64, f64)> = alphas.iter().copied().zip(ratios).collect();
        self.look_between(&mut found);
        let intervals = self.intervals(&found);
        match intervals.last() {
            Some(last) => Ok((last.to, intervals)),
            None => Err(self.refusal(&found)),
        }
    }

    /// Adds the minimum of every dip above 1 of the scan, and the maximum of every hump below:
    /// there may be an interval, or a gap, between two points.
    fn look_between(&self, found: &mut Vec<(f64, f64)>) {
        let turns: Vec<(f64, f64, f64)> = found
            .windows(3)
            .filter_map(|w| {
                let [before, at, after] = [w[0].1, w[1].1, w[2].1];
                let is_dip = at > 1.0 && at <= before && at <= after;
                let is_hump = at <= 1.0 && at > NEAR && at >= before && at >= after;
                let sign = if is_dip { 1.0 } else { -1.0 };
                (is_dip || is_hump).then_some((w[0].0, w[2].0, sign))
            })
            .collect();
        for (mut from, mut to, sign) in turns {
            let value = |alpha: f64| sign * self.excess(alpha, false).0;
            let (mut left, mut right) = (to - GOLDEN * (to - from), from + GOLDEN * (to - from));
            let (mut at_left, mut at_right) = (value(left), value(right));
            for _ in 0..SECTIONS {
                if at_left < at_right {
                    (to, right, at_right) = (right, left, at_left);
                    left = to - GOLDEN * (to - from);
                    at_left = value(left);
                } else {
                    (from, left, at_left) = (left, right, at_right);
                    right = from + GOLDEN * (to - from);
                    at_right = value(right);
                }
            }
            found.push(if at_left < at_right {
                (left, sign * at_left)
            } else {
                (right, sign * at_right)
            });
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// Returns the admissible intervals between the points of a scan, with bisected, exact ends.
    fn intervals(&self, found: &[(f64, f64)]) -> Vec<AlphaInterval> {
        let holds: Vec<bool> =
            found.iter().map(|&(alpha, ratio)| ratio <= 1.0 && self.holds(alpha)).collect();
        let mut intervals: Vec<AlphaInterval> = Vec::new();
        let mut open: Option<f64> = None;
        for (i, &(alpha, _)) in found.iter().enumerate() {
            if holds[i] && open.is_none() {
                open = Some(if i == 0 { alpha } else { self.bisect(alpha, found[i - 1].0) });
            }
            if let (false, Some(from)) = (holds[i], open) {
                intervals.push(AlphaInterval { from, to: self.bisect(found[i - 1].0, alpha) });
                open = None;
            }
        }
        if let (Some(from), Some(last)) = (open, found.last()) {
            intervals.push(AlphaInterval { from, to: last.0 });
        }
        intervals
    }

    /// Returns the last admissible α from `inside` towards `outside`.
    fn bisect(&self, inside: f64, outside: f64) -> f64 {
        let (mut holds, mut breaks) = (inside, outside);
        for _ in 0..STEPS {
            let middle = 0.5 * (holds + breaks);
            if self.holds(middle) { holds = middle } else { breaks = middle }
        }
        holds
    }

    fn holds(&self, alpha: f64) -> bool {
        self.excess(alpha, true).0 <= 1.0 - self.margin
    }

    /// Returns the largest ratio of a peak to its limit; `exact` refines each peak.
    fn excess(&self, alpha: f64, exact: bool) -> (f64, Quantity, f64, f64) {
        let limits = [
            (Quantity::Velocity, self.limits.velocity_m_s),
            (Quantity::Acceleration, self.limits.acceleration_m_s2),
            (Quantity::Jerk, self.limits.jerk_m_s3),
        ];
        let mut worst = (0.0, Quantity::Velocity, 0.0, self.limits.velocity_m_s);
        for (leg, which) in self.legs {
            let mut leg = *leg;
            leg.alpha[*which] = Some(alpha);
            let peaks = peaks(&leg, *which, exact);
            for ((quantity, limit), peak) in limits.into_iter().zip(peaks) {
                if peak / limit > worst.0 {
                    worst = (peak / limit, quantity, peak, limit);
                }
            }
        }
        worst
    }

    /// Returns the smallest α whose deviation has decayed at the other end, and whose clearance
    /// leaves the other end its half of the leg.
    fn smallest(&self) -> Result<f64, TrajectoryError> {
        let mut smallest = 1e-12_f64;
        for (leg, which) in self.legs {
            let fits = |alpha: f64| {
                let mut leg = *leg;
                leg.alpha[*which] = Some(alpha);
                let (deviation_s, _) = leg.reach_s(*which);
                deviation_s <= leg.duration_s && leg.clearance_s(*which) <= 0.5 * leg.duration_s
            };
            let (mut low, mut high) = (1e-12_f64, 1e18_f64);
            if !fits(high) {
                return Err(TrajectoryError::Hurried {
                    segment: self.segment,
                    lasts_s: leg.duration_s,
                    needs_s: 2.0 * leg.amplitude_m / leg.feed_m_s,
                });
            }
            for _ in 0..60 {
                let middle = (low * high).sqrt();
                if fits(middle) { high = middle } else { low = middle }
            }
            smallest = smallest.max(high);
        }
        Ok(smallest)
    }

    /// Returns an α above which jerk certainly exceeds its limit.
    fn largest(&self) -> f64 {
        let mut largest = f64::INFINITY;
        for (leg, which) in self.legs {
            let jerk = 8.0 * self.limits.jerk_m_s3;
            match leg.ends[*which] {
                End::Rest => {
                    largest = largest.min((jerk / leg.feed_m_s).powf(1.5));
                    // The jerk of an oscillation at its very start is 6 A ω α.
                    if *which == 0 && leg.amplitude_m > 0.0 {
                        let jump = 6.0 * leg.amplitude_m * leg.omega_rad_s;
                        largest = largest.min(1.01 * self.limits.jerk_m_s3 / jump);
                    }
                }
                End::Transition { neighbour_m_s, .. } => {
                    let step = (neighbour_m_s - leg.feed_m_s).abs();
                    if step > 0.0 {
                        largest = largest.min((8.0 * jerk / step).sqrt());
                    }
                    if leg.amplitude_m > 0.0 {
                        largest = largest.min(1e3 * (jerk / leg.amplitude_m).cbrt());
                    }
                }
            }
        }
        if largest.is_finite() { largest } else { 1.0 }
    }

    fn refusal(&self, found: &[(f64, f64)]) -> TrajectoryError {
        let nearest = found
            .iter()
            .fold((1.0, f64::INFINITY), |best, &point| if point.1 < best.1 { point } else { best });
        let (_, quantity, reached, limit) = self.excess(nearest.0, true);
        TrajectoryError::Alpha {
            segment: self.segment,
            place: self.name,
            alpha: nearest.0,
            quantity,
            reached,
            limit,
        }
    }
}

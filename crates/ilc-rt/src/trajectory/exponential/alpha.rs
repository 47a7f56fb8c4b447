//! The largest α that honours every limit. Cold.
//!
//! The peaks of velocity, acceleration and jerk are not monotone in α: an oscillation and a start can
//! help or hurt each other. So α is scanned, every crossing bracketed and bisected, dips between two
//! points of the scan looked into, and all admissible intervals reported.

use super::leg::{End, Leg};
use crate::trajectory::error::{Quantity, TrajectoryError};
use crate::trajectory::limits::PathLimits;

/// Scan points in a decade of α.
const PER_DECADE: f64 = 12.0;
/// Samples of an end without oscillation.
const SAMPLES: usize = 160;
/// Samples of one period of an oscillation.
const SAMPLES_A_PERIOD: f64 = 32.0;
/// Most samples of an end.
const SAMPLES_MAX: f64 = 20_000.0;
/// Bisections of a crossing, and golden sections of a peak.
const STEPS: usize = 32;
/// Peaks looked into of one end and quantity.
const CANDIDATES: usize = 4;
/// Distance kept from a crossing, relative: far above the rounding of a peak.
const MARGIN: f64 = 1e-10;
/// `(√5 - 1)/2`.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// An interval of α in which every limit holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaInterval {
    /// Smallest α.
    pub from: f64,
    /// Largest α.
    pub to: f64,
}

/// A place where α is to be chosen: one end of one leg, or of two that meet.
pub(super) struct Place<'a> {
    /// The legs that end here, each with the end that is here.
    pub(super) legs: &'a [(Leg, usize)],
    pub(super) limits: PathLimits,
    /// Number of the first leg, for the refusal.
    pub(super) segment: usize,
    pub(super) name: &'static str,
}

impl Place<'_> {
    /// The largest admissible α, and all admissible intervals from the smallest on.
    ///
    /// # Errors
    /// [`TrajectoryError::Alpha`] with the limit that is nearest to hold if no α is admissible,
    /// [`TrajectoryError::Hurried`] if a leg is too short for any.
    pub(super) fn choose(&self) -> Result<(f64, Vec<AlphaInterval>), TrajectoryError> {
        let smallest = self.smallest()?;
        let largest = self.largest().max(1.001 * smallest);
        let n_points = ((largest / smallest).log10() * PER_DECADE).ceil().max(4.0);
        let step = (largest / smallest).powf(1.0 / n_points);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few hundred at most: powers of 10 of finite numbers"
        )]
        let alphas: Vec<f64> =
            (0..=n_points as usize).map(|i| smallest * step.powf(i as f64)).collect();
        let ratios: Vec<f64> = alphas.iter().map(|&alpha| self.excess(alpha, false).0).collect();
        let mut found: Vec<(f64, f64)> = alphas.iter().copied().zip(ratios).collect();
        self.look_into_dips(&mut found);
        let intervals = self.intervals(&found);
        match intervals.last() {
            Some(last) => Ok((last.to, intervals)),
            None => Err(self.refusal(&found)),
        }
    }

    /// Adds the lowest point of every dip that the scan sees but that stays above 1 on it.
    fn look_into_dips(&self, found: &mut Vec<(f64, f64)>) {
        let dips: Vec<[(f64, f64); 3]> = found
            .windows(3)
            .filter(|w| w[1].1 > 1.0 && w[1].1 <= w[0].1 && w[1].1 <= w[2].1)
            .map(|w| [w[0], w[1], w[2]])
            .collect();
        for [low, _, high] in dips {
            let (mut from, mut to) = (low.0, high.0);
            for _ in 0..24 {
                let (left, right) = (to - GOLDEN * (to - from), from + GOLDEN * (to - from));
                if self.excess(left, false).0 < self.excess(right, false).0 {
                    to = right;
                } else {
                    from = left;
                }
            }
            let alpha = 0.5 * (from + to);
            found.push((alpha, self.excess(alpha, false).0));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
    }

    /// The admissible intervals between the points of a scan, their ends bisected and exact.
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

    /// The last α from `inside` towards `outside` that holds.
    fn bisect(&self, inside: f64, outside: f64) -> f64 {
        let (mut holds, mut breaks) = (inside, outside);
        for _ in 0..STEPS {
            let middle = 0.5 * (holds + breaks);
            if self.holds(middle) { holds = middle } else { breaks = middle }
        }
        holds
    }

    fn holds(&self, alpha: f64) -> bool {
        self.excess(alpha, true).0 <= 1.0 - MARGIN
    }

    /// The largest ratio of a peak to its limit; `exact` refines each peak.
    fn excess(&self, alpha: f64, exact: bool) -> (f64, Quantity, f64, f64) {
        let limits = [
            (Quantity::Velocity, self.limits.velocity_m_s),
            (Quantity::Acceleration, self.limits.acceleration_m_s2),
            (Quantity::Jerk, self.limits.jerk_m_s3),
        ];
        let mut worst = (0.0, Quantity::Velocity, 0.0, self.limits.velocity_m_s);
        for (leg, which) in self.legs {
            let mut leg = *leg;
            leg.alpha[*which] = alpha;
            let peaks = peaks(&leg, *which, exact);
            for ((quantity, limit), peak) in limits.into_iter().zip(peaks) {
                if peak / limit > worst.0 {
                    worst = (peak / limit, quantity, peak, limit);
                }
            }
        }
        worst
    }

    /// The smallest α whose end is over within its share of the leg.
    fn smallest(&self) -> Result<f64, TrajectoryError> {
        let mut smallest = 1e-12_f64;
        for (leg, which) in self.legs {
            let fits = |alpha: f64| {
                let mut leg = *leg;
                leg.alpha[*which] = alpha;
                let (deviation_s, window_s) = leg.reach_s(*which);
                deviation_s <= leg.duration_s && window_s <= 0.5 * leg.duration_s
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

    /// An α above which jerk is beyond its limit for certain.
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

/// Largest absolute velocity, acceleration and jerk of one end and of a period after it.
fn peaks(leg: &Leg, which: usize, exact: bool) -> [f64; 3] {
    let (deviation_s, window_s) = leg.reach_s(which);
    let felt_s = deviation_s.max(window_s);
    let (span_s, n_samples) = if leg.amplitude_m == 0.0 {
        (felt_s, SAMPLES as f64)
    } else {
        let period_s = std::f64::consts::TAU / leg.omega_rad_s;
        let span_s = (felt_s + period_s).min(leg.duration_s);
        let fine_s = (deviation_s / SAMPLES as f64).min(window_s / SAMPLES as f64);
        let wanted = (SAMPLES_A_PERIOD * span_s / period_s).max(span_s / fine_s.max(1e-300));
        (span_s, wanted.min(SAMPLES_MAX))
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "1 to the most samples"
    )]
    let n_samples = n_samples.ceil().max(2.0) as usize;
    let value = |tau_s: f64| leg.near(which, tau_s).0;
    // The jerk jumps where the window opens: the samples have a joint there.
    let joint_s = if leg.amplitude_m == 0.0 || matches!((leg.ends[which], which), (End::Rest, 0)) {
        0.0
    } else {
        leg.clearance_s(which).min(span_s)
    };
    let times_s: Vec<f64> = [(0.0, joint_s), (joint_s, span_s)]
        .into_iter()
        .filter(|(from, to)| to > from)
        .flat_map(|(from, to)| {
            (0..=n_samples).map(move |i| from + (to - from) * i as f64 / n_samples as f64)
        })
        .collect();
    let samples: Vec<[f64; 4]> = times_s.iter().map(|&tau_s| value(tau_s)).collect();
    std::array::from_fn(|order| {
        let size = |jet: &[f64; 4]| jet[order + 1].abs();
        let most = samples.iter().map(size).fold(0.0, f64::max);
        if !exact {
            return most;
        }
        let mut peak = most;
        // Each side of the joint has peaks of its own: samples at its edges have no neighbour beyond.
        let (is_first, is_last) = (
            |i: usize| i.is_multiple_of(n_samples + 1),
            |i: usize| (i + 1).is_multiple_of(n_samples + 1),
        );
        let mut candidates: Vec<(usize, f64)> = (0..samples.len())
            .map(|i| (i, size(&samples[i])))
            .filter(|&(i, here)| {
                let before = if is_first(i) { 0.0 } else { size(&samples[i - 1]) };
                let after = if is_last(i) { 0.0 } else { size(&samples[i + 1]) };
                here >= 0.97 * most && here >= before && here >= after
            })
            .collect();
        candidates.sort_by(|a, b| b.1.total_cmp(&a.1));
        for (i, _) in candidates.into_iter().take(CANDIDATES) {
            let from = times_s[if is_first(i) { i } else { i - 1 }];
            let to = times_s[if is_last(i) { i } else { i + 1 }];
            peak = peak.max(refined(|tau_s| size(&value(tau_s)), from, to));
        }
        peak
    })
}

/// The largest value in an interval with one maximum.
fn refined(value: impl Fn(f64) -> f64, mut from: f64, mut to: f64) -> f64 {
    let mut best = 0.0_f64;
    for _ in 0..24 {
        let (left, right) = (to - GOLDEN * (to - from), from + GOLDEN * (to - from));
        let (at_left, at_right) = (value(left), value(right));
        best = best.max(at_left).max(at_right);
        if at_left > at_right { to = right } else { from = left }
    }
    best
}

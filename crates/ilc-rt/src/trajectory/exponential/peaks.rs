//! Peaks of velocity, acceleration and jerk at one end of a leg. Cold; used by the search of α.
//!
//! The end is sampled in pieces between the times at which an effect begins, and the largest
//! samples are refined, so that a limit holds between two samples, too.

use super::leg::Leg;

/// `(√5 - 1)/2`.
pub(super) const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Smallest number of samples of a piece.
const SAMPLES: f64 = 160.0;
/// Samples of one period of an oscillation.
const SAMPLES_A_PERIOD: f64 = 32.0;
/// Largest number of samples of a piece.
const SAMPLES_MAX: f64 = 20_000.0;
/// Peaks refined per end and quantity.
const CANDIDATES: usize = 4;

/// A sample of a piece, and the times on either side of it within that piece.
struct Sample {
    jet: [f64; 4],
    around_s: [f64; 2],
    neighbours: [Option<usize>; 2],
}

/// Returns the largest absolute velocity, acceleration and jerk of one end and of the period after
/// it, including the effect of the other end if its α is already chosen.
pub(super) fn peaks(leg: &Leg, which: usize, exact: bool) -> [f64; 3] {
    let value = |tau_s: f64| leg.at(if which == 0 { tau_s } else { leg.duration_s - tau_s }).0.0;
    let mut samples: Vec<Sample> = Vec::new();
    for (from_s, to_s, n) in pieces(leg, which) {
        let first = samples.len();
        let time_s = |i: usize| from_s + (to_s - from_s) * i as f64 / n as f64;
        samples.extend((0..=n).map(|i| Sample {
            jet: value(time_s(i)),
            around_s: [time_s(i.saturating_sub(1)), time_s((i + 1).min(n))],
            neighbours: [i.checked_sub(1).map(|at| first + at), (i < n).then_some(first + i + 1)],
        }));
    }
    std::array::from_fn(|order| {
        let size = |jet: &[f64; 4]| jet[order + 1].abs();
        let most = samples.iter().map(|sample| size(&sample.jet)).fold(0.0, f64::max);
        if !exact {
            return most;
        }
        let mut candidates: Vec<(f64, [f64; 2])> = samples
            .iter()
            .map(|sample| (size(&sample.jet), sample))
            .filter(|(here, sample)| {
                let over = |at: Option<usize>| at.is_none_or(|at| *here >= size(&samples[at].jet));
                *here >= 0.97 * most && sample.neighbours.into_iter().all(over)
            })
            .map(|(here, sample)| (here, sample.around_s))
            .collect();
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        candidates.into_iter().take(CANDIDATES).fold(most, |peak, (_, [from_s, to_s])| {
            peak.max(refined(|tau_s| size(&value(tau_s)), from_s, to_s))
        })
    })
}

/// Returns the pieces to sample, in the time from the end, each with its number of steps.
///
/// They meet where a window opens, as the jerk jumps there, and where an effect has decayed: the
/// ends may be much faster than the leg, or one than the other.
fn pieces(leg: &Leg, which: usize) -> Vec<(f64, f64, usize)> {
    let (deviation_s, window_s) = leg.reach_s(which);
    let other = 1 - which;
    let (other_deviation_s, other_window_s) = leg.reach_s(other);
    let period_s = std::f64::consts::TAU / leg.omega_rad_s;
    let after_s = if leg.amplitude_m == 0.0 { 0.0 } else { period_s };
    let span_s = (deviation_s.max(window_s) + after_s).min(leg.duration_s);
    let mut joints_s: Vec<f64> = [
        leg.clearance_s(which),
        deviation_s,
        window_s,
        leg.duration_s - leg.clearance_s(other),
        leg.duration_s - other_deviation_s,
        leg.duration_s - other_window_s,
    ]
    .into_iter()
    .filter(|&at_s| at_s > 0.0 && at_s < span_s)
    .chain([0.0, span_s])
    .collect();
    joints_s.sort_by(f64::total_cmp);
    joints_s
        .windows(2)
        .filter(|pair| pair[1] > pair[0])
        .map(|pair| {
            let periods = if leg.amplitude_m == 0.0 { 0.0 } else { (pair[1] - pair[0]) / period_s };
            let steps = (SAMPLES_A_PERIOD * periods).clamp(SAMPLES, SAMPLES_MAX);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the least and the most samples"
            )]
            let n = steps.ceil() as usize;
            (pair[0], pair[1], n)
        })
        .collect()
}

/// Returns the largest value in an interval with one maximum.
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

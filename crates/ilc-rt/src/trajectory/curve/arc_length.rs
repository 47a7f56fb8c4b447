//! Arc length of a curve, and the parameter at an arc length, to rounding.

use super::Curve;
use super::frame::norm;
use crate::trajectory::error::TrajectoryError;

/// Abscissae and weights of the eight-point Gauss rule on -1 to 1, the positive half.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];
/// Largest number of bisections of an interval whose length is not yet exact.
const DEPTH: usize = 14;
/// Relative error of a length.
const EXACT: f64 = 1e-13;
/// Relative step below which a parameter has converged: rounding.
const SETTLED: f64 = 1e-14;
/// Newton steps to the parameter at an arc length.
const NEWTON_STEPS: usize = 40;

/// Parameters and arc lengths at the ends of intervals on which one Gauss rule is exact.
#[derive(Clone, Debug)]
pub(super) struct ArcLength {
    knots: Vec<(f64, f64)>,
}

/// Returns the length between two parameters within one interval.
pub(super) fn length(curve: &impl Curve, from: f64, to: f64) -> f64 {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    let speed = |parameter: f64| norm(&curve.at(parameter)[1]);
    GAUSS
        .iter()
        .map(|(x, weight)| weight * (speed(middle - half * x) + speed(middle + half * x)))
        .sum::<f64>()
        * half
}

impl ArcLength {
    /// Measures a curve.
    ///
    /// # Errors
    /// [`TrajectoryError::Cusp`] for a curve whose derivative vanishes, or without finite length.
    pub(super) fn new(curve: &impl Curve) -> Result<Self, TrajectoryError> {
        let breaks = curve.breaks();
        let mut knots = vec![(breaks.first().copied().unwrap_or(0.0), 0.0)];
        let mut reached = 0.0;
        for pair in breaks.windows(2) {
            let mut todo = vec![(pair[0], pair[1], DEPTH)];
            while let Some((from, to, depth)) = todo.pop() {
                let middle = 0.5 * (from + to);
                let whole = length(curve, from, to);
                let halves = length(curve, from, middle) + length(curve, middle, to);
                if depth > 0 && (whole - halves).abs() > EXACT * halves {
                    todo.push((middle, to, depth - 1));
                    todo.push((from, middle, depth - 1));
                    continue;
                }
                if !(halves.is_finite() && halves > 0.0) {
                    return Err(TrajectoryError::Cusp { at: reached });
                }
                reached += halves;
                knots.push((to, reached));
            }
        }
        Ok(Self { knots })
    }

    pub(super) fn total_m(&self) -> f64 {
        self.knots.last().map_or(0.0, |last| last.1)
    }

    /// Returns the intervals between knots, each end as parameter and arc length.
    pub(super) fn intervals(&self) -> impl Iterator<Item = ((f64, f64), (f64, f64))> + '_ {
        self.knots.windows(2).map(|pair| (pair[0], pair[1]))
    }

    /// Returns the parameter at a distance from the start.
    pub(super) fn parameter(&self, curve: &impl Curve, s_m: f64) -> f64 {
        let after = self.knots.partition_point(|knot| knot.1 <= s_m);
        let (Some(&(from, from_m)), Some(&(to, to_m))) =
            (self.knots.get(after.saturating_sub(1)), self.knots.get(after))
        else {
            let end = if s_m > 0.0 { self.knots.last() } else { self.knots.first() };
            return end.map_or(0.0, |knot| knot.0);
        };
        let (mut low, mut high) = (from, to);
        let mut parameter = from + (to - from) * (s_m - from_m) / (to_m - from_m);
        for _ in 0..NEWTON_STEPS {
            let miss = from_m + length(curve, from, parameter) - s_m;
            if miss > 0.0 {
                high = parameter;
            } else {
                low = parameter;
            }
            let next = parameter - miss / norm(&curve.at(parameter)[1]);
            // Before the bisection: an end of the bracket is the parameter itself, which a step of
            // rounding may well leave.
            if (next - parameter).abs() <= SETTLED * parameter.abs().max(to - from) {
                return next;
            }
            parameter = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        parameter
    }
}

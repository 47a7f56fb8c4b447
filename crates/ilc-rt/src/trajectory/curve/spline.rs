//! The natural cubic spline through points: the interpolant of least curvature.

use super::{Curve, Derivatives};
use crate::interpolate::{MAX_AXES, MoveError};
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::path::point;

/// Largest number of points.
const POINTS_MAX: usize = 100_000;

/// A cubic in each axis between every two points; position, tangent and curvature are continuous.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    n_axes: usize,
    /// Parameter of each point: cumulative square roots of the chords (centripetal), so that a
    /// short chord next to a long one makes no loop.
    knots: Vec<f64>,
    points_m: Vec<[f64; MAX_AXES]>,
    /// Second derivatives at the points.
    second: Vec<[f64; MAX_AXES]>,
}

impl Spline {
    /// Creates the spline through points of equal dimension.
    ///
    /// # Errors
    /// [`TrajectoryError`] for fewer than two points, coordinates out of range, and two equal
    /// neighbours.
    pub fn through(points_m: &[Vec<f64>]) -> Result<Self, TrajectoryError> {
        let n_axes = points_m.first().map_or(0, Vec::len);
        if !(1..=MAX_AXES).contains(&n_axes) {
            return Err(MoveError::Axes { n_axes }.into());
        }
        let n = points_m.len();
        if !(2..=POINTS_MAX).contains(&n) {
            return Err(TrajectoryError::Shape {
                name: "points",
                value: n as f64,
                allowed: "2 to 100000",
            });
        }
        let mut all = Vec::with_capacity(n);
        let mut knots = Vec::with_capacity(n);
        for (index, coordinates_m) in points_m.iter().enumerate() {
            if coordinates_m.len() != n_axes {
                return Err(TrajectoryError::Coordinates {
                    segment: index.saturating_sub(1),
                    found: coordinates_m.len(),
                    expected: n_axes,
                });
            }
            let here = point(coordinates_m)?;
            let knot = match (all.last(), knots.last()) {
                (Some(before), Some(reached)) => {
                    let before: &[f64; MAX_AXES] = before;
                    let chord_m = here
                        .iter()
                        .zip(before)
                        .fold(0.0_f64, |sum, (to, from)| sum.hypot(to - from));
                    if chord_m == 0.0 {
                        return Err(TrajectoryError::ZeroLength { segment: index - 1 });
                    }
                    reached + chord_m.sqrt()
                }
                _ => 0.0,
            };
            all.push(here);
            knots.push(knot);
        }
        let second = second_derivatives(&knots, &all);
        Ok(Self { n_axes, knots, points_m: all, second })
    }
}

/// Solves the tridiagonal equations of a natural spline, all axes at once.
fn second_derivatives(knots: &[f64], points_m: &[[f64; MAX_AXES]]) -> Vec<[f64; MAX_AXES]> {
    let n = knots.len();
    let mut second = vec![[0.0; MAX_AXES]; n];
    let mut upper = vec![0.0; n];
    for i in 1..n - 1 {
        let (before, after) = (knots[i] - knots[i - 1], knots[i + 1] - knots[i]);
        let pivot = 2.0 * (before + after) - before * upper[i - 1];
        upper[i] = after / pivot;
        second[i] = std::array::from_fn(|axis| {
            let [left, here, right] = [i - 1, i, i + 1].map(|at| points_m[at][axis]);
            let bend = 6.0 * ((right - here) / after - (here - left) / before);
            (bend - before * second[i - 1][axis]) / pivot
        });
    }
    for i in (1..n - 1).rev() {
        second[i] = std::array::from_fn(|axis| second[i][axis] - upper[i] * second[i + 1][axis]);
    }
    second
}

impl Curve for Spline {
    fn n_axes(&self) -> usize {
        self.n_axes
    }

    fn breaks(&self) -> Vec<f64> {
        self.knots.clone()
    }

    fn at(&self, parameter: f64) -> Derivatives {
        let last = self.knots.len() - 2;
        let i = self.knots.partition_point(|knot| *knot <= parameter).saturating_sub(1).min(last);
        let h = self.knots[i + 1] - self.knots[i];
        let (b, a) = ((parameter - self.knots[i]) / h, (self.knots[i + 1] - parameter) / h);
        let per_axis: [[f64; 4]; MAX_AXES] = std::array::from_fn(|axis| {
            let (from, to) = (self.points_m[i][axis], self.points_m[i + 1][axis]);
            let (m, n) = (self.second[i][axis], self.second[i + 1][axis]);
            [
                a * from + b * to + ((a * a * a - a) * m + (b * b * b - b) * n) * h * h / 6.0,
                (to - from) / h + ((3.0 * b * b - 1.0) * n - (3.0 * a * a - 1.0) * m) * h / 6.0,
                a * m + b * n,
                (n - m) / h,
            ]
        });
        std::array::from_fn(|order| per_axis.map(|axis| axis[order]))
    }
}

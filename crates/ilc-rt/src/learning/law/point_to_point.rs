//! Point-to-point ILC: only the error at some samples of a run counts.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, violation};
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::operator::Operator;
use crate::learning::{Law, LearningError, Result};
use crate::model::{ModelError, StateSpace};
use crate::schema::{Violation, field_order};

/// Largest number of points.
const POINTS_MAX: usize = 2000;
/// Largest condition number of the system at the points.
const CONDITION_MAX: f64 = 1e13;

/// `[learning.point_to_point]`: the instants at which the error counts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PointToPointParameters {
    /// Instants at which the error counts, from the start of the run; the motion between them is free. The end of
    /// the run by default.
    pub points_s: Vec<f64>,
    /// Share of the correction.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 2.0))]
    pub gain: f64,
    /// Weight of the change of the input against the error; 0 for an exact solution.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
}

impl Default for PointToPointParameters {
    fn default() -> Self {
        Self { points_s: Vec::new(), gain: 1.0, r: 0.0 }
    }
}

impl LawParameters for PointToPointParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        let key = "[learning.point_to_point] points_s";
        let apart = |pair: &[f64]| pair[1] - pair[0] > 0.5 * cell.cycle_s;
        if self.points_s.iter().any(|time_s| !(time_s.is_finite() && *time_s >= 0.0)) {
            return Err(violation(key, format!("{:?}", self.points_s), "times from 0, in seconds"));
        }
        match self.points_s.windows(2).find(|pair| !apart(pair)) {
            Some(pair) => Err(violation(key, pair[1], "times in ascending order, a cycle apart")),
            None => Ok(()),
        }
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let n_samples = context.n_samples();
        let mut points = Vec::new();
        for time_s in &self.points_s {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked to be from 0"
            )]
            let point = (time_s / context.cell.cycle_s).round() as usize;
            if point >= n_samples {
                let run_s = n_samples as f64 * context.cell.cycle_s;
                let allowed = format!("below {run_s:.3}, as long as a run is");
                return Err(violation("[learning.point_to_point] points_s", time_s, allowed).into());
            }
            points.push(point);
        }
        if points.is_empty() {
            points.push(n_samples.saturating_sub(1));
        }
        Ok(Box::new(PointToPoint::new(context.model, n_samples, &points, self.gain, self.r)?))
    }

    fn examples(&self) -> &'static [Example] {
        // One instant of the run counts: the RMS error of the whole run stays about the same.
        &[Example {
            is_parallel: false,
            learning: "law = \"point_to_point\"\n[learning.point_to_point]\npoints_s = [0.5]\n\
                       gain = 0.7\nr = 0.01",
            error_left: 1.05,
        }]
    }
}

/// Point-to-point ILC: the error at some samples vanishes with the smallest change of the input.
///
/// `u_{j+1} = u_j + gain P_s' (P_s P_s' + r I)^-1 S e_j`, `P_s = S P` the rows of the lifted system at the points
///
/// With an exact model, gain 1 and r = 0 the points are reached after one run.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`, read at the points alone
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples + n_points^2)`.
/// # Source
/// - \[freeman2013\]; \[owens2013\].
#[derive(Debug, Clone)]
pub struct PointToPoint {
    operator: Operator,
    points: Vec<usize>,
    gain: f64,
    r: f64,
    inverse: DMatrix<f64>,
    at_points: DVector<f64>,
    solved: DVector<f64>,
    spread: Vec<f64>,
    n_samples: usize,
    channels: [usize; 2],
}

impl PointToPoint {
    /// Creates the law for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] unless `0 < gain < 2` and `r` is finite and not negative.
    /// - [`LearningError::Empty`] or [`LearningError::TooMany`] for no points, or more than 2000 times outputs.
    /// - [`LearningError::Weight`] for a point after the run, or before the first effect of the input.
    /// - [`LearningError::Numerics`] for points that are too near to each other for the model.
    /// - [`LearningError::Model`] for a continuous model.
    pub fn new(
        model: &StateSpace,
        n_samples: usize,
        points: &[usize],
        gain: f64,
        r: f64,
    ) -> Result<Self> {
        if model.dt_s().is_none() {
            return Err(ModelError::Continuous { action: "point-to-point learning" }.into());
        }
        let channels @ [m, p] = [model.n_inputs(), model.n_outputs()];
        check_counts(&[("n_samples", n_samples), ("n_inputs", m), ("n_outputs", p)])?;
        check_counts(&[("points", points.len())])?;
        if points.len() > POINTS_MAX {
            let (what, value, allowed) = ("points", points.len(), POINTS_MAX);
            return Err(LearningError::TooMany { what, value, allowed });
        }
        for (what, value, is_right, allowed) in [
            ("gain", gain, gain > 0.0 && gain < 2.0, "it must lie above 0 and below 2"),
            ("r", r, r.is_finite() && r >= 0.0, "it must be finite and not negative"),
        ] {
            if !is_right {
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        let refused = |sample: usize, reason: &str| {
            Err(LearningError::Weight { what: "points", sample, reason: reason.to_owned() })
        };
        if let Some(point) = points.iter().find(|point| **point >= n_samples) {
            return refused(*point, "beyond the end of the run");
        }
        let n_rows = points.len() * p;
        let mut law = Self {
            operator: Operator::new(model),
            points: points.to_vec(),
            gain,
            r,
            inverse: DMatrix::zeros(n_rows, n_rows),
            at_points: DVector::zeros(n_rows),
            solved: DVector::zeros(n_rows),
            spread: vec![0.0; n_samples * p],
            n_samples,
            channels,
        };
        let gram = law.gram();
        if let Some(row) = (0..n_rows).find(|row| r == 0.0 && gram[(*row, *row)] == 0.0) {
            return refused(points[row / p], "before the first effect of the input");
        }
        let regular = gram + DMatrix::identity(n_rows, n_rows) * r;
        let values = regular.symmetric_eigenvalues();
        let inverse = regular.try_inverse();
        let is_sound = values.min() * CONDITION_MAX > values.max();
        let Some(inverse) = inverse.filter(|_| is_sound) else {
            let what = "the change of the input";
            let reason = "the points are too near to each other for this model; give an r above 0";
            return Err(LearningError::Numerics { what, reason });
        };
        law.inverse = inverse;
        Ok(law)
    }

    /// Returns `P_s P_s'`, column by column.
    fn gram(&mut self) -> DMatrix<f64> {
        let n_rows = self.at_points.len();
        let mut gram = DMatrix::zeros(n_rows, n_rows);
        let mut u = vec![0.0; self.n_samples * self.channels[0]];
        for column in 0..n_rows {
            self.solved.fill(0.0);
            self.solved[column] = 1.0;
            self.spread();
            self.operator.transposed(&self.spread, &mut u);
            self.operator.forward(&u, &mut self.spread);
            for (row, at) in self.places().enumerate() {
                gram[(row, column)] = self.spread[at];
            }
        }
        0.5 * (&gram + gram.transpose())
    }

    /// Returns the places of the points' errors in a signal of the outputs.
    fn places(&self) -> impl Iterator<Item = usize> + use<'_> {
        let p = self.channels[1];
        self.points.iter().flat_map(move |point| (0..p).map(move |output| point * p + output))
    }

    /// Writes what was solved into a signal of the outputs that is zero elsewhere.
    fn spread(&mut self) {
        let (points, p) = (&self.points, self.channels[1]);
        self.spread.fill(0.0);
        for (row, value) in self.solved.iter().enumerate() {
            self.spread[points[row / p] * p + row % p] += *value;
        }
    }

    /// Solves for the errors at the points of a signal, and spreads the result.
    fn solve(&mut self, error: &[f64]) {
        let (points, p) = (&self.points, self.channels[1]);
        for (row, value) in self.at_points.iter_mut().enumerate() {
            *value = error[points[row / p] * p + row % p];
        }
        self.solved.gemv(self.gain, &self.inverse, &self.at_points, 0.0);
        self.spread();
    }
}

impl Law for PointToPoint {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        check_update(input, error, next, self.n_samples, self.channels)?;
        self.solve(error);
        self.operator.transposed(&self.spread, next);
        next.iter_mut().zip(input).for_each(|(next, input)| *next += input);
        check("next", next, self.n_samples, self.channels[0])
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        check_adjoint(dual, to_input, to_error, self.n_samples, self.channels)?;
        to_input.copy_from_slice(dual);
        self.operator.forward(dual, to_error);
        self.solve(to_error);
        to_error.copy_from_slice(&self.spread);
        Ok(true)
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        let Self { points, gain, r, n_samples, channels: [n_inputs, n_outputs], .. } = self;
        format!(
            r#"{{"law":"point_to_point","points":{points:?},"gain":{gain},"r":{r},"n_samples":{n_samples},"n_inputs":{n_inputs},"n_outputs":{n_outputs}}}"#
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    const N: usize = 160;

    fn axis(omega: f64, damping: f64, delay: usize) -> StateSpace {
        let model = second_order(omega, damping).unwrap();
        discretize(&model, 2e-3, Method::ZeroOrderHold).unwrap().delayed(delay).unwrap()
    }

    #[test]
    fn an_update_is_that_of_the_regularised_pseudo_inverse() {
        let model = axis(94.0, 0.7, 0).append(&axis(80.0, 0.5, 1)).unwrap();
        let points = [40, 90, 159];
        let lifted = model.lifted(N).unwrap();
        let rows =
            DMatrix::from_fn(6, 2 * N, |row, col| lifted[(points[row / 2] * 2 + row % 2, col)]);
        let signal = |seed: f64| DVector::from_fn(2 * N, |k, _| (k as f64 * seed).sin());
        let (u, e) = (signal(0.7), signal(1.1));
        for r in [0.0, 0.02] {
            let mut law = PointToPoint::new(&model, N, &points, 0.8, r).unwrap();
            let mut next = vec![0.0; 2 * N];
            law.update(u.as_slice(), e.as_slice(), &mut next).unwrap();
            // The smallest change in least squares, by stacking: with r = 0 its limit.
            let root = r.sqrt().max(1e-7);
            let mut tall = DMatrix::zeros(6 + 2 * N, 2 * N);
            tall.rows_mut(0, 6).copy_from(&rows);
            tall.rows_mut(6, 2 * N).fill_diagonal(root);
            let right = DVector::from_fn(6 + 2 * N, |row, _| {
                if row < 6 { e[points[row / 2] * 2 + row % 2] } else { 0.0 }
            });
            let change = tall.svd(true, true).solve(&right, 1e-14).unwrap();
            let expected = &u + 0.8 * change;
            for (found, expected) in next.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-6, "{r}: {found} {expected}");
            }
        }
    }

    #[test]
    fn the_points_are_reached_on_another_plant() {
        let points = [50, 110, N - 1];
        let mut law = PointToPoint::new(&axis(94.0, 0.7, 0), N, &points, 0.7, 0.0).unwrap();
        let plant = axis(80.0, 0.5, 1).lifted(N).unwrap();
        let reference = DVector::from_fn(N, |k, _| 0.01 * (k as f64 / 50.0).sin().powi(4));
        let mut u = DVector::zeros(N);
        let mut worst = Vec::new();
        for _ in 0..20 {
            let e = &reference - &plant * &u;
            worst.push(points.iter().map(|k| e[*k].abs()).fold(0.0, f64::max));
            let mut next = vec![0.0; N];
            law.update(u.as_slice(), e.as_slice(), &mut next).unwrap();
            u = DVector::from_vec(next);
        }
        assert!(worst[19] < 1e-4 * worst[0], "{worst:?}");
    }

    #[test]
    fn unusable_points_are_named() {
        let refuse = |points: &[usize], gain, r| {
            let law = PointToPoint::new(&axis(94.0, 0.7, 0), N, points, gain, r);
            law.unwrap_err().to_string()
        };
        assert!(refuse(&[N], 1.0, 0.0).contains("points at sample 160: beyond"));
        assert!(refuse(&[], 1.0, 0.0).contains("points = 0"));
        assert!(refuse(&[0], 1.0, 0.0).contains("sample 0: before the first effect"));
        assert!(refuse(&[9], 2.0, 0.0).contains("gain = 2"));
        assert!(refuse(&[9], 1.0, -1.0).contains("r = -1"));
        assert!(refuse(&[9; 2001], 1.0, 1.0).contains("at most 2000"));
        let slow = from_transfer_function(&[1e-4], &[1.0, -1.98, 0.981], Some(2e-3)).unwrap();
        let twice = PointToPoint::new(&slow, N, &[30, 30], 1.0, 0.0).unwrap_err().to_string();
        assert!(twice.contains("too near"), "{twice}");
    }
}

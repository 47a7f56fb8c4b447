//! The problem in dense, lifted form.

use nalgebra::{DMatrix, DVector};

use super::super::{Bound, Bounds, Limit};
use super::active_set::non_negative;
use crate::learning::law::norm_optimal::Cost;
use crate::learning::weights::Weight;
use crate::model::StateSpace;

/// `min 1/2 v'Hv + f'v` with `low <= T v <= high`, in dense form.
pub(super) struct Lifted {
    h: DMatrix<f64>,
    f: DVector<f64>,
    rows: DMatrix<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    /// Cost of `v = 0`.
    constant: f64,
}

fn blocks(weight: &Weight, n_samples: usize, p: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(n_samples * p, n_samples * p);
    for k in 0..n_samples {
        matrix.view_mut((k * p, k * p), (p, p)).copy_from(&weight.at(k, p));
    }
    matrix
}

/// Returns the matrix of differences of the given order, with zeros before the run.
pub(super) fn differences(n_samples: usize, m: usize, order: usize) -> DMatrix<f64> {
    let mut first = DMatrix::identity(n_samples * m, n_samples * m);
    for i in m..n_samples * m {
        first[(i, i - m)] = -1.0;
    }
    (0..order).fold(DMatrix::identity(n_samples * m, n_samples * m), |product, _| &first * product)
}

fn limits(limit: &Limit, n_samples: usize, m: usize) -> Vec<f64> {
    let at = |i: usize| match limit {
        Limit::Scalar(value) => *value,
        Limit::PerSample(values) => values[i / m],
        Limit::PerChannel(values) => values[i % m],
        Limit::Full(values) => values[i],
    };
    (0..n_samples * m).map(at).collect()
}

pub(super) fn lift(
    model: &StateSpace,
    n_samples: usize,
    cost: &Cost,
    bounds: &Bounds,
    u: &[f64],
    e: &[f64],
) -> Lifted {
    let (m, p, dt) = (model.n_inputs(), model.n_outputs(), model.dt_s().unwrap());
    let plant = model.lifted(n_samples).unwrap();
    let q = blocks(&cost.q, n_samples, p);
    let s = blocks(&cost.s, n_samples, m);
    let r = blocks(&cost.r, n_samples, m);
    let mut first = differences(n_samples, m, 1);
    for i in 0..m {
        first[(i, i)] = 0.0;
    }
    let (u, e) = (DVector::from_column_slice(u), DVector::from_column_slice(e));
    let h = plant.transpose() * &q * &plant
        + &s
        + r
        + first.transpose() * &first * cost.rate * cost.rate;
    let f = &s * &u - plant.transpose() * &q * &e;
    let constant = 0.5 * (e.dot(&(&q * &e)) + u.dot(&(&s * &u)));

    let size = n_samples * m;
    let reference = bounds.reference.clone().unwrap_or_else(|| vec![0.0; size]);
    let start: Vec<f64> = (0..size).map(|i| reference[i % m]).collect();
    // The set point, relative to its value before the run.
    let moved = DVector::from_fn(size, |i, _| reference[i] - start[i]);
    let (mut rows, mut low, mut high) = (DMatrix::zeros(0, size), Vec::new(), Vec::new());
    let mut add = |bound: &Option<Bound>, matrix: &DMatrix<f64>, at: &DVector<f64>, width| {
        let Some(bound) = bound else { return };
        let count = matrix.nrows();
        let before = rows.nrows();
        rows = rows.clone().insert_rows(before, count, 0.0);
        rows.view_mut((before, 0), (count, size)).copy_from(matrix);
        let (lower, upper) =
            (limits(&bound.lower, n_samples, width), limits(&bound.upper, n_samples, width));
        low.extend((0..count).map(|i| lower[i] - at[i]));
        high.extend((0..count).map(|i| upper[i] - at[i]));
    };
    let one = differences(n_samples, m, 1);
    let two = differences(n_samples, m, 2) / (dt * dt);
    let same = differences(n_samples, m, 0);
    let setpoint = DVector::from_fn(size, |i, _| reference[i] + u[i]);
    add(&bounds.input, &same, &u, m);
    add(&bounds.change, &same, &(&u * 0.0), m);
    add(&bounds.step, &one, &(&one * &u), m);
    add(&bounds.position, &same, &setpoint, m);
    add(&bounds.velocity, &(&one / dt), &(&one * (&moved + &u) / dt), m);
    add(&bounds.acceleration, &two, &(&two * (&moved + &u)), m);
    if let Some(bound) = &bounds.output {
        // Rows without any input's effect are constant.
        let target = bounds.output_reference.clone().unwrap_or(reference);
        let y = DVector::from_fn(n_samples * p, |i, _| target[i] - e[i]);
        let free: Vec<bool> = plant.row_iter().map(|row| row.amax() <= 0.0).collect();
        let open = |limit: &Limit, none: f64| {
            let values = limits(limit, n_samples, p);
            Limit::Full(
                values.iter().zip(&free).map(|(v, free)| if *free { none } else { *v }).collect(),
            )
        };
        let bound = Bound {
            lower: open(&bound.lower, f64::NEG_INFINITY),
            upper: open(&bound.upper, f64::INFINITY),
        };
        add(&Some(bound), &plant, &y, p);
    }
    Lifted { h, f, rows, low, high, constant }
}

impl Lifted {
    pub(super) fn cost(&self, v: &DVector<f64>) -> f64 {
        0.5 * v.dot(&(&self.h * v)) + self.f.dot(v) + self.constant
    }

    /// Solves by an active-set method, independent of the interior-point method; `None` if no
    /// change satisfies all limits.
    ///
    /// With `w = L'v + L^-1 f`, `H = L L'`, the problem is that of the shortest `w` with
    /// `G w >= g`, which is a non-negative least-squares problem for the multipliers (Lawson and
    /// Hanson).
    pub(super) fn solve(&self) -> Option<DVector<f64>> {
        let n = self.h.nrows();
        let lower = self.h.clone().cholesky()?.unpack();
        let centre = lower.solve_lower_triangular(&self.f)?;
        let (mut rows, mut least) = (Vec::new(), Vec::new());
        for i in 0..self.rows.nrows() {
            let row = lower.solve_lower_triangular(&self.rows.row(i).transpose())?;
            let scale = 1.0 / row.norm();
            for (sign, limit) in [(-1.0, self.high[i]), (1.0, self.low[i])] {
                if limit.is_finite() {
                    rows.push(&row * (sign * scale));
                    least.push((sign * scale).mul_add(limit, sign * scale * row.dot(&centre)));
                }
            }
        }
        let change = |w: DVector<f64>| lower.tr_solve_lower_triangular(&(w - &centre));
        if least.iter().all(|least| *least <= 0.0) {
            return change(DVector::zeros(n));
        }
        // Lengths of about 1, so that the last row below is of the size of the others.
        let size = least.iter().fold(0.0_f64, |a, b| a.max(*b));
        let columns: Vec<DVector<f64>> = rows
            .iter()
            .zip(&least)
            .map(|(row, least)| row.clone().insert_row(n, least / size))
            .collect();
        let mut target = DVector::zeros(n + 1);
        target[n] = 1.0;
        let multiplier = non_negative(&DMatrix::from_columns(&columns), &target);
        let active: Vec<usize> = (0..rows.len()).filter(|i| multiplier[*i] > 0.0).collect();
        let chosen: Vec<DVector<f64>> = active.iter().map(|i| rows[*i].clone()).collect();
        let limits = DVector::from_iterator(active.len(), active.iter().map(|i| least[*i]));
        // The shortest w on the active rows, exactly.
        let svd = DMatrix::from_columns(&chosen).transpose().svd(true, true);
        let w = svd.solve(&limits, 1e-13).ok()?;
        let honours = rows.iter().zip(&least).all(|(row, least)| row.dot(&w) > least - 1e-9 * size);
        if honours { change(w) } else { None }
    }

    /// Returns the largest violation of a row, relative to the larger of its limits.
    pub(super) fn excess(&self, v: &DVector<f64>) -> f64 {
        let values = &self.rows * v;
        let mut worst = 0.0_f64;
        for (i, value) in values.iter().enumerate() {
            let finite = |limit: f64| if limit.is_finite() { limit.abs() } else { 0.0 };
            let size = finite(self.low[i]).max(finite(self.high[i])).max(1e-3);
            worst = worst.max((value - self.high[i]) / size).max((self.low[i] - value) / size);
        }
        worst
    }

    /// Returns the part of the gradient that no multiplier of the right sign balances
    /// (stationarity), relative to its two terms.
    pub(super) fn stationarity(&self, v: &DVector<f64>) -> f64 {
        let curved = &self.h * v;
        let size = curved.norm().max(self.f.norm()).max(1e-12);
        let slope = curved + &self.f;
        let values = &self.rows * v;
        let mut active = Vec::new();
        for i in 0..self.rows.nrows() {
            let norm = self.rows.row(i).norm();
            let near = 1e-6 * (norm * v.norm()).max(1e-12);
            for (sign, limit) in [(1.0, self.high[i]), (-1.0, self.low[i])] {
                if limit.is_finite() && (limit - values[i]).abs() < near {
                    active.push(self.rows.row(i).transpose() * (sign / norm));
                }
            }
        }
        if active.is_empty() {
            return slope.norm() / size;
        }
        let normals = DMatrix::from_columns(&active);
        let multiplier = non_negative(&normals, &-&slope);
        (slope + normals * multiplier).norm() / size
    }
}

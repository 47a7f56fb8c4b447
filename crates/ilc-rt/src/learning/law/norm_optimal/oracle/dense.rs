//! The lifted problem as a dense system of equations, in double-double precision.

use super::super::{Cost, Plant};
use super::double_double::Double;

/// A pivot below this share of a diagonal entry vanishes: this part of the input has no effect.
const VANISHED: f64 = 1e-26;

/// Returns the next input: solves `(P'QP + S + R + W) v = P'Q e - S u`, with `P` from impulse
/// responses and `v = 0` where it is undetermined.
pub(super) fn dense<'a>(
    plant: impl Into<Plant<'a>>,
    n_samples: usize,
    cost: impl Into<Cost>,
    u: &[f64],
    e: &[f64],
) -> Vec<f64> {
    let (plant, cost) = (plant.into(), cost.into());
    let (m, p) = (plant.at(0).n_inputs(), plant.at(0).n_outputs());
    let columns: Vec<Vec<Double>> =
        (0..n_samples * m).map(|i| pulse(plant, n_samples, i / m, i % m)).collect();
    let weighted: Vec<Vec<Double>> =
        columns.iter().map(|column| weigh(column, &cost, n_samples, p)).collect();
    let size = columns.len();
    let rate = Double::from(cost.rate) * Double::from(cost.rate);
    let mut h = vec![vec![Double::ZERO; size]; size];
    let mut right = vec![Double::ZERO; size];
    for row in 0..size {
        for col in 0..=row {
            // Nothing happens before the later of the two impulses.
            let begin = row / m * p;
            let mut value = dot(&columns[col][begin..], &weighted[row][begin..]);
            if row / m == col / m {
                let (k, i, j) = (row / m, row % m, col % m);
                value = value + Double::from(cost.s.entry(k, i, j));
                value = value + Double::from(cost.r.entry(k, i, j));
            }
            if row == col {
                for is_in_run in [row >= m, row + m < size] {
                    value = if is_in_run { value + rate } else { value };
                }
            }
            if row == col + m {
                value = value - rate;
            }
            h[row][col] = value;
        }
        let e: Vec<Double> = e.iter().copied().map(Double::from).collect();
        right[row] = dot(&weighted[row], &e);
        for j in 0..m {
            let held = Double::from(cost.s.entry(row / m, row % m, j));
            right[row] = right[row] - held * Double::from(u[row / m * m + j]);
        }
    }
    let change = solve(h, right);
    u.iter().zip(change).map(|(u, v)| (Double::from(*u) + v).value()).collect()
}

/// Returns the response to an impulse of channel `i` at sample `k`.
fn pulse(plant: Plant, n_samples: usize, k: usize, i: usize) -> Vec<Double> {
    let (n, p) = (plant.at(0).n_states(), plant.at(0).n_outputs());
    let mut response = vec![Double::ZERO; n_samples * p];
    let first = plant.at(k);
    for row in 0..p {
        response[k * p + row] = Double::from(first.d()[(row, i)]);
    }
    let mut x: Vec<Double> = (0..n).map(|row| Double::from(first.b()[(row, i)])).collect();
    for sample in k + 1..n_samples {
        let model = plant.at(sample);
        let apply = |matrix: &nalgebra::DMatrix<f64>, row: usize| {
            (0..n).fold(Double::ZERO, |sum, j| sum + Double::from(matrix[(row, j)]) * x[j])
        };
        for row in 0..p {
            response[sample * p + row] = apply(model.c(), row);
        }
        x = (0..n).map(|row| apply(model.a(), row)).collect();
    }
    response
}

fn weigh(column: &[Double], cost: &Cost, n_samples: usize, p: usize) -> Vec<Double> {
    let at = |k: usize, row: usize| {
        (0..p).fold(Double::ZERO, |sum, col| {
            sum + Double::from(cost.q.entry(k, row, col)) * column[k * p + col]
        })
    };
    (0..n_samples * p).map(|index| at(index / p, index % p)).collect()
}

fn dot(left: &[Double], right: &[Double]) -> Double {
    left.iter().zip(right).fold(Double::ZERO, |sum, (left, right)| sum + *left * *right)
}

/// Solves by Cholesky factorisation of the lower triangle.
fn solve(mut h: Vec<Vec<Double>>, mut x: Vec<Double>) -> Vec<Double> {
    let size = x.len();
    let mut gone = vec![false; size];
    for row in 0..size {
        let (above, below) = h.split_at_mut(row);
        let own = &mut below[0];
        for (col, other) in above.iter().enumerate() {
            let known = own[col] - dot(&own[..col], &other[..col]);
            own[col] = if gone[col] { Double::ZERO } else { known / other[col] };
        }
        let diagonal = own[row].value();
        let pivot = own[row] - dot(&own[..row], &own[..row]);
        gone[row] = pivot.value() <= VANISHED * diagonal || pivot.value() <= 0.0;
        own[row] = if gone[row] { Double::ZERO } else { pivot.sqrt() };
    }
    for row in 0..size {
        let known = x[row] - dot(&h[row][..row], &x[..row]);
        x[row] = if gone[row] { Double::ZERO } else { known / h[row][row] };
    }
    for row in (0..size).rev() {
        let known = (row + 1..size).fold(x[row], |sum, i| sum - h[i][row] * x[i]);
        x[row] = if gone[row] { Double::ZERO } else { known / h[row][row] };
    }
    x
}

//! From model, weights and bounds to the solver of one group of axes.

use nalgebra::DMatrix;

use super::Bounds;
use super::bounds::Extent;
use super::interior::{Interior, Parts};
use super::reach;
use super::riccati::{Plant, Weighing};
use super::solver::{Places, Solver};
use crate::learning::law::norm_optimal::Cost;
use crate::learning::law::norm_optimal::decouple::Part;
use crate::learning::law::norm_optimal::relative_degree::relative_degrees;
use crate::learning::{LearningError, Result};

/// Relative weight of inputs that have no effect within the run and are otherwise undetermined.
const FREE: f64 = 1e-8;

/// The problem of one group, with sizes not yet fixed.
struct Problem<'a> {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    places: Places,
    cost: Cost,
    bounds: &'a Bounds,
    extent: Extent,
    /// Samples at the end that model and weights may leave undetermined.
    free_samples: usize,
}

/// Creates the solver of a group.
pub(super) fn solver(part: Part, bounds: &Bounds, extent: Extent) -> Result<Box<dyn Solver>> {
    let Part { plant, cost, inputs, outputs } = part;
    let model = plant.borrow().at(0);
    let is_mixed = cost.q.is_mixed(outputs.len());
    let degrees = relative_degrees(plant.borrow(), extent.n_samples)?;
    // A weight between outputs applies to samples of the same time, so they must be shifted alike.
    let least = degrees.iter().flatten().copied().min().unwrap_or(0);
    let shifts: Vec<usize> =
        degrees.iter().map(|degree| if is_mixed { least } else { degree.unwrap_or(0) }).collect();
    let (mut c, mut d) = (model.c().clone(), model.d().clone());
    for (row, shift) in shifts.iter().enumerate() {
        for _ in 0..*shift {
            let ahead = c.row(row) * model.a();
            let effect = c.row(row) * model.b();
            d.set_row(row, &effect);
            c.set_row(row, &ahead);
        }
    }
    let inner = if inputs.len() > 1 || is_mixed { model.n_states() } else { 0 };
    let free_samples = shifts.iter().copied().max().unwrap_or(0) + inner;
    let delays = if bounds.acceleration.is_some() {
        2
    } else {
        usize::from(cost.rate > 0.0 || bounds.step.is_some() || bounds.velocity.is_some())
    };
    let (n, m, p) = (model.n_states(), inputs.len(), outputs.len());
    let (a, b) = (model.a().clone(), model.b().clone());
    let places = Places { inputs, outputs, shifts };
    sized((n, m, p, delays), &Problem { a, b, c, d, places, cost, bounds, extent, free_samples })
}

/// Selects the smallest solver that fits the problem; excess dimensions stay zero.
fn sized(
    (n, m, p, delays): (usize, usize, usize, usize),
    problem: &Problem<'_>,
) -> Result<Box<dyn Solver>> {
    macro_rules! offer {
        ($($n:literal, $m:literal, $p:literal;)*) => {
            $(
                if n <= $n && m <= $m && p <= $p {
                    return match delays {
                        0 => problem.fill::<$n, $m, $p, $n>(),
                        1 => problem.fill::<$n, $m, $p, { $n + $m }>(),
                        _ => problem.fill::<$n, $m, $p, { $n + 2 * $m }>(),
                    };
                }
            )*
        };
    }
    macro_rules! offer_large {
        ($($n:literal, $m:literal, $p:literal;)*) => {
            $(
                if n <= $n && m <= $m && p <= $p {
                    return problem.fill::<$n, $m, $p, { $n + 2 * $m }>();
                }
            )*
        };
    }
    offer! { 2, 1, 1; 4, 1, 1; 4, 2, 2; }
    offer_large! {
        8, 1, 1; 24, 1, 1; 8, 2, 2; 24, 2, 2; 12, 3, 3; 24, 6, 6; 48, 12, 12;
    }
    let (what, value, allowed) = if m > 12 || p > 12 {
        ("axes that act on each other", m.max(p) as f64, "at most 12 are allowed")
    } else {
        ("states of axes that act on each other", n as f64, "at most 48 are allowed")
    };
    Err(LearningError::Parameter { what, value, allowed })
}

impl Problem<'_> {
    fn fill<const N: usize, const M: usize, const P: usize, const NS: usize>(
        &self,
    ) -> Result<Box<dyn Solver>> {
        let plant = Plant::<N, M, P> {
            a: array(&self.a),
            b: array(&self.b),
            c: array(&self.c),
            d: array(&self.d),
        };
        let (mut weighings, mut holds): (Vec<Weighing<M, P>>, Vec<[[f64; M]; M]>) =
            (Vec::new(), Vec::new());
        let n_samples = self.extent.n_samples;
        let mut which = Vec::with_capacity(n_samples);
        let mut largest = 0.0_f64;
        for k in 0..n_samples {
            let (weighing, hold) = self.weighing::<M, P>(k);
            largest = largest.max(weighing.change.iter().flatten().fold(0.0, |a, b| a.max(*b)));
            largest = largest.max(weighing.output.iter().flatten().fold(0.0, |a, b| a.max(*b)));
            if weighings.last() != Some(&weighing) || holds.last() != Some(&hold) {
                weighings.push(weighing);
                holds.push(hold);
            }
            which.push(weighings.len() - 1);
        }
        let bands = self.bounds.bands(self.extent, &self.places, (M, P))?;
        if let Some(conflict) = reach::standing_conflict(&bands, &self.places.inputs, M) {
            return Err(conflict.into());
        }
        let places = self.places.clone();
        let mut interior =
            Interior::<N, M, P, NS>::new(Parts { plant, weighings, which, holds, places, bands });
        if let Some(sample) = interior.undetermined(self.free_samples) {
            let weights = self.cost.told();
            return Err(LearningError::Undetermined { weights, sample });
        }
        let reach = self.d.amax().max(self.b.amax()).max(f64::MIN_POSITIVE);
        interior.settle_free(FREE * largest * reach * reach);
        Ok(Box::new(interior))
    }

    /// Returns the weights at one sample, and that of the input alone.
    fn weighing<const M: usize, const P: usize>(
        &self,
        k: usize,
    ) -> (Weighing<M, P>, [[f64; M]; M]) {
        let Problem { places, cost, extent, .. } = self;
        let mut output = [[0.0; P]; P];
        let (mut change, mut hold) = ([[0.0; M]; M], [[0.0; M]; M]);
        for (i, shift) in places.shifts.iter().enumerate() {
            let sample = k + shift;
            if sample >= extent.n_samples {
                continue;
            }
            for (j, entry) in output[i].iter_mut().enumerate().take(places.outputs.len()) {
                *entry = cost.q.entry(sample, i, j);
            }
        }
        let m = places.inputs.len();
        for i in 0..m {
            for j in 0..m {
                hold[i][j] = cost.s.entry(k, i, j);
                change[i][j] = hold[i][j] + cost.r.entry(k, i, j);
            }
        }
        // Inputs that only pad the size stay at zero.
        for (i, row) in change.iter_mut().enumerate().skip(places.inputs.len()) {
            row[i] = 1.0;
        }
        let rate = if k == 0 { 0.0 } else { cost.rate * cost.rate };
        let real = |i: usize| if i < places.inputs.len() { rate } else { 0.0 };
        let step = std::array::from_fn(real);
        (Weighing { output, change, step, bend: [0.0; M] }, hold)
    }
}

/// Returns a matrix as an array, padded with zeros.
fn array<const R: usize, const C: usize>(matrix: &DMatrix<f64>) -> [[f64; C]; R] {
    std::array::from_fn(|row| {
        std::array::from_fn(|col| matrix.get((row, col)).copied().unwrap_or(0.0))
    })
}

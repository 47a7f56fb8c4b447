//! A model as a matrix-free linear map of whole runs (lifted system), and its adjoint.

use nalgebra::DMatrix;

use crate::learning::{LearningError, Result};
use crate::model::{ModelError, StateSpace};

/// The non-zero entries of a matrix, row by row: delays make most entries zero.
#[derive(Debug, Clone)]
struct Sparse {
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl Sparse {
    fn new(matrix: &DMatrix<f64>) -> Self {
        let (mut starts, mut entries) = (vec![0], Vec::new());
        for row in matrix.row_iter() {
            entries.extend(
                row.iter().enumerate().filter(|(_, value)| **value != 0.0).map(|(i, v)| (i, *v)),
            );
            starts.push(entries.len());
        }
        Self { starts, entries }
    }

    /// `out += matrix x`
    #[inline]
    fn add(&self, x: &[f64], out: &mut [f64]) {
        for (row, value) in out.iter_mut().enumerate() {
            for (col, entry) in &self.entries[self.starts[row]..self.starts[row + 1]] {
                *value += entry * x[*col];
            }
        }
    }
}

/// The lifted system `P` of a model, applied sample by sample.
#[derive(Debug, Clone)]
pub(super) struct Plant {
    direct: [Sparse; 4],
    transposed: [Sparse; 4],
    n_states: usize,
    n_inputs: usize,
    n_outputs: usize,
}

impl Plant {
    pub(super) fn new(model: &StateSpace) -> Result<Self> {
        if model.dt_s().is_none() {
            return Err(ModelError::Continuous { action: "analysis" }.into());
        }
        let (n_states, n_inputs, n_outputs) =
            (model.n_states(), model.n_inputs(), model.n_outputs());
        for (what, count) in [("n_inputs", n_inputs), ("n_outputs", n_outputs)] {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        let matrices = [model.a(), model.b(), model.c(), model.d()];
        Ok(Self {
            direct: matrices.map(Sparse::new),
            transposed: matrices.map(|matrix| Sparse::new(&matrix.transpose())),
            n_states,
            n_inputs,
            n_outputs,
        })
    }

    /// Lets the caller cancel every so many samples, which take well below a millisecond: asking costs as much as a
    /// sample of a small plant.
    #[inline]
    fn point_at(&self, sample: usize) {
        const OPERATIONS: usize = 1 << 18;
        if sample.is_multiple_of(OPERATIONS / (self.n_states * self.n_states + 1) + 1) {
            crate::interrupt::point();
        }
    }

    /// `out = P input`
    pub(super) fn apply(&self, input: &[f64], out: &mut [f64]) {
        let [a, b, c, d] = &self.direct;
        let (mut x, mut next) = (vec![0.0; self.n_states], vec![0.0; self.n_states]);
        let samples = input.chunks_exact(self.n_inputs).zip(out.chunks_exact_mut(self.n_outputs));
        for (k, (u, y)) in samples.enumerate() {
            self.point_at(k);
            y.fill(0.0);
            c.add(&x, y);
            d.add(u, y);
            next.fill(0.0);
            a.add(&x, &mut next);
            b.add(u, &mut next);
            std::mem::swap(&mut x, &mut next);
        }
    }

    /// `out = P' output`: the same recursion from the end of the run to its start.
    pub(super) fn apply_transposed(&self, output: &[f64], out: &mut [f64]) {
        let [a, b, c, d] = &self.transposed;
        let (mut x, mut next) = (vec![0.0; self.n_states], vec![0.0; self.n_states]);
        let samples = output.chunks_exact(self.n_outputs).zip(out.chunks_exact_mut(self.n_inputs));
        for (k, (y, u)) in samples.rev().enumerate() {
            self.point_at(k);
            u.fill(0.0);
            b.add(&x, u);
            d.add(y, u);
            next.fill(0.0);
            a.add(&x, &mut next);
            c.add(y, &mut next);
            std::mem::swap(&mut x, &mut next);
        }
    }
}

/// Returns, for each input, the delay until it first affects an output; `None` if it never does.
///
/// By the Cayley-Hamilton theorem `n + 1` Markov parameters suffice. One counts as zero if it is
/// below the rounding error of its terms.
pub(super) fn first_effects(model: &StateSpace) -> Result<Vec<Option<usize>>, ModelError> {
    const ROUNDING: f64 = 1e-13;
    let parameters = model.markov(model.n_states() + 1)?;
    let (a, c) = (model.a().abs(), model.c().abs());
    let mut reached = model.b().abs();
    let mut found = vec![None; model.n_inputs()];
    for (k, parameter) in parameters.iter().enumerate() {
        let magnitude = if k == 0 { model.d().abs() } else { &c * &reached };
        if k > 0 {
            reached = &a * reached;
        }
        for (col, degree) in found.iter_mut().enumerate() {
            let answers =
                |row: usize| parameter[(row, col)].abs() > ROUNDING * magnitude[(row, col)];
            if degree.is_none() && (0..model.n_outputs()).any(answers) {
                *degree = Some(k);
            }
        }
        if found.iter().all(Option::is_some) {
            break;
        }
    }
    Ok(found)
}

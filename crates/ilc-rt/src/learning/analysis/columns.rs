//! The iteration matrix of a law without adjoint, column by column.

use super::iteration::Iteration;
use crate::learning::Result;

/// Largest number of inputs for which a law without adjoint is analysed column by column.
pub const COLUMNS_MAX: usize = 3000;

/// `T` as columns, for products with it and with its transpose.
pub(super) struct Columns {
    n: usize,
    values: Vec<f64>,
}

impl Columns {
    /// Computes the columns by one update per unit input.
    pub(super) fn new(iteration: &mut Iteration) -> Result<Self> {
        let n = iteration.n_u();
        let mut values = vec![0.0; n * n];
        let mut unit = vec![0.0; n];
        for (at, column) in values.chunks_exact_mut(n).enumerate() {
            unit[at] = 1.0;
            iteration.apply(&unit, column)?;
            unit[at] = 0.0;
        }
        Ok(Self { n, values })
    }

    /// `out = T x`
    pub(super) fn apply(&self, x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (factor, column) in x.iter().zip(self.values.chunks_exact(self.n)) {
            for (value, entry) in out.iter_mut().zip(column) {
                *value += factor * entry;
            }
        }
    }

    /// `out = T' x`
    pub(super) fn apply_transposed(&self, x: &[f64], out: &mut [f64]) {
        for (value, column) in out.iter_mut().zip(self.values.chunks_exact(self.n)) {
            *value = column.iter().zip(x).map(|(entry, x)| entry * x).sum();
        }
    }
}

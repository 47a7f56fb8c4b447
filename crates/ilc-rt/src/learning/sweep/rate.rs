//! Penalty on the rate of the input's change.

use std::ops::Range;

use nalgebra::DMatrix;

use super::{Stage, Stages};

/// A problem with a penalty on the rate of the input's change.
///
/// Adds `sum_{k>=1} |v_k - v_{k-1}|^2_W`. The previous change is appended to the state, and `m`
/// more outputs with target 0 carry the penalty: `A~ = [A 0; 0 0]`, `B~ = [B; I]`, `C~ = [C 0; 0
/// -I]`, `D~ = [D; I]`, `Q~ = diag(Q, W)`, `W_0 = 0`.
///
/// # Source
/// - \[haas2016\], Eq. (7) and (10).
#[derive(Debug)]
pub struct Rate<S> {
    /// The problem without the penalty.
    pub inner: S,
    /// Weight `W` of each input, the square of `d` in the source.
    pub weight: f64,
}

impl<S: Stages> Stages for Rate<S> {
    fn n_samples(&self) -> usize {
        self.inner.n_samples()
    }

    fn n_targets(&self) -> usize {
        self.inner.n_targets()
    }

    fn stage(&self, k: usize) -> Stage {
        let Stage { a, b, c, d, q, s, r } = self.inner.stage(k);
        let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
        let grown = |top: &DMatrix<f64>, rows: usize, cols: usize| {
            let mut matrix = DMatrix::zeros(top.nrows() + rows, top.ncols() + cols);
            matrix.view_mut((0, 0), top.shape()).copy_from(top);
            matrix
        };
        let (mut b, mut c, mut d, mut q) =
            (grown(&b, m, 0), grown(&c, m, m), grown(&d, m, 0), grown(&q, m, m));
        for i in 0..m {
            b[(n + i, i)] = 1.0;
            c[(p + i, n + i)] = -1.0;
            d[(p + i, i)] = 1.0;
            q[(p + i, p + i)] = self.weight_at(k);
        }
        Stage { a: grown(&a, m, m), b, c, d, q, s, r }
    }

    fn constant(&self) -> Range<usize> {
        let inner = self.inner.constant();
        inner.start.max(1)..inner.end.max(1)
    }

    fn holds_input(&self) -> bool {
        self.inner.holds_input()
    }

    fn has_constant_plant(&self) -> bool {
        self.inner.has_constant_plant()
    }

    fn remembers_change(&self) -> bool {
        true
    }
}

impl<S> Rate<S> {
    fn weight_at(&self, k: usize) -> f64 {
        if k == 0 { 0.0 } else { self.weight }
    }
}

//! Memory layout of the gains of one sample.

/// The sizes of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Sizes {
    /// States.
    pub(super) n: usize,
    /// Inputs.
    pub(super) m: usize,
    /// Outputs, including those of penalties.
    pub(super) p: usize,
    /// Outputs with a target.
    pub(super) targets: usize,
    /// Inputs with a cost of their value: `m`, or 0 if no sample has an `S`.
    pub(super) held: usize,
}

/// The gains of one sample as two column-major matrices, so that each sweep is one product:
///
/// `[p_k; kappa_k] = back [p_{k+1}; e_k; u_k]`, `[x_{k+1}; v_k] = fore [x_k; kappa_k]`
///
/// with `back = [(A-BK)' (C-DK)'Q K'S; H^-1 B' H^-1 D'Q -H^-1 S]` and
/// `fore = [A-BK B; -K I]`, whose identity is not stored.
///
/// Column-major, because each column times a scalar is added to all rows at once, and the terms
/// that do not depend on the previous sample can be added first.
#[derive(Debug, Clone, Copy)]
pub(super) struct Record<'a> {
    /// (n + m) x (n + targets + held).
    pub(super) back: &'a [f64],
    /// (n + m) x n, then n x m.
    pub(super) fore: &'a [f64],
}

impl Sizes {
    /// Returns the length of the backward matrix.
    pub(super) fn back(&self) -> usize {
        (self.n + self.m) * self.columns()
    }

    /// Returns the number of columns of the backward matrix.
    pub(super) fn columns(&self) -> usize {
        self.n + self.targets + self.held
    }

    /// Returns the length of the forward matrix.
    pub(super) fn fore(&self) -> usize {
        (self.n + self.m) * self.n + self.n * self.m
    }
}

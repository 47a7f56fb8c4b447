//! How the gains of one sample lie in memory.

/// The sizes of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Sizes {
    /// States.
    pub(super) n: usize,
    /// Inputs.
    pub(super) m: usize,
    /// Outputs, those of penalties included.
    pub(super) p: usize,
    /// Outputs with a target.
    pub(super) targets: usize,
    /// Inputs whose value itself costs: `m`, or 0 where no sample has an `S`.
    pub(super) held: usize,
}

/// The gains of one sample as two matrices, each by columns, that one product a sweep applies:
///
/// `[p_k; kappa_k] = back [p_{k+1}; e_k; u_k]`, `[x_{k+1}; v_k] = fore [x_k; kappa_k]`
///
/// with `back = [(A-BK)' (C-DK)'Q K'S; H^-1 B' H^-1 D'Q -H^-1 S]` and
/// `fore = [A-BK B; -K I]`, of which the identity is not stored.
///
/// By columns, because then each column times one number is added to all rows at once, and what does
/// not wait for the sample before can be added first.
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
        (self.n + self.m) * (self.n + self.targets + self.held)
    }

    /// Returns the length of the forward matrix.
    pub(super) fn fore(&self) -> usize {
        (self.n + self.m) * self.n + self.n * self.m
    }
}

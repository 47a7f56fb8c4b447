//! Proposals of the runs in memory: computed when a run arrives, or, for a run on a shelf, when it
//! first counts.

use super::super::inputs::Inputs;
use crate::learning::Result;

/// Receives the place of a run among those asked for, its input and its error.
pub type Each<'a> = dyn FnMut(usize, &[f64], &[f64]) -> Result + 'a;

/// Runs that are kept elsewhere, e.g. in a library, and read when they count.
pub trait Shelf: Send {
    /// Reads runs by their numbers on the shelf: gives the place of each in `runs`, its input and
    /// its error. A run that is not there any more is not given.
    ///
    /// # Errors
    /// - [`crate::learning::LearningError::Shelf`] if they cannot be read; that of `each`.
    fn read(&mut self, runs: &[usize], each: &mut Each<'_>) -> Result;
}

/// State of a run's proposal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kept {
    /// Computed: its row.
    Row(usize),
    /// On the shelf: its number there, and the share of its sum due to its error.
    Shelf(usize, f64),
}

/// The proposals of all runs, in the order of the runs.
pub(super) struct Proposals {
    rows: Inputs,
    kept: Vec<Kept>,
    shelf: Option<Box<dyn Shelf>>,
}

impl Proposals {
    pub(super) fn new(length: usize) -> Self {
        Self { rows: Inputs::new(length), kept: Vec::new(), shelf: None }
    }

    pub(super) fn reserve(&mut self, n_runs: usize) {
        self.rows.reserve(n_runs);
        self.kept.reserve(n_runs.saturating_sub(self.kept.len()));
    }

    pub(super) fn len(&self) -> usize {
        self.kept.len()
    }

    pub(super) fn push(&mut self, proposal: &[f64]) {
        self.kept.push(Kept::Row(self.rows.len()));
        self.rows.push(proposal);
    }

    /// Adds all runs of a shelf, with the shares of their sums due to their errors.
    pub(super) fn put_on_shelf(&mut self, shelf: Box<dyn Shelf>, error_sums: &[f64]) {
        self.kept.extend(error_sums.iter().enumerate().map(|(n, sum)| Kept::Shelf(n, *sum)));
        self.shelf = Some(shelf);
    }

    pub(super) fn has_shelf(&self) -> bool {
        self.shelf.is_some()
    }

    pub(super) fn kept(&self, run: usize) -> Kept {
        self.kept[run]
    }

    /// Returns the proposal of a run, `None` while it is on the shelf.
    pub(super) fn row(&self, run: usize) -> Option<&[f64]> {
        match self.kept[run] {
            Kept::Row(row) => Some(self.rows.row(row)),
            Kept::Shelf(..) => None,
        }
    }

    /// Lends the shelf, which has to be given back.
    pub(super) fn lend_shelf(&mut self) -> Option<Box<dyn Shelf>> {
        self.shelf.take()
    }

    pub(super) fn give_back(&mut self, shelf: Box<dyn Shelf>) {
        self.shelf = Some(shelf);
    }

    /// Keeps the proposal of a run from the shelf.
    pub(super) fn take_off(&mut self, run: usize, proposal: &[f64]) {
        self.kept[run] = Kept::Row(self.rows.len());
        self.rows.push(proposal);
    }

    /// Adds `weight` times the proposal of a run; nothing while it is on the shelf.
    pub(super) fn add(&self, run: usize, weight: f64, sum: &mut [f64]) {
        if let Kept::Row(row) = self.kept[run] {
            self.rows.add(row, weight, sum);
        }
    }

    /// Keeps only these runs, given in ascending order.
    pub(super) fn retain(&mut self, runs: &[usize]) {
        self.kept = runs.iter().map(|&run| self.kept[run]).collect();
        let row_of = |kept: &Kept| if let Kept::Row(row) = kept { Some(*row) } else { None };
        let mut rows: Vec<usize> = self.kept.iter().filter_map(row_of).collect();
        rows.sort_unstable();
        self.rows.retain(&rows);
        for kept in &mut self.kept {
            if let Kept::Row(row) = kept {
                *row = rows.partition_point(|other| *other < *row);
            }
        }
    }

    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.kept.clear();
        self.shelf = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Empty;

    impl Shelf for Empty {
        fn read(&mut self, _: &[usize], _: &mut Each<'_>) -> Result {
            Ok(())
        }
    }

    #[test]
    fn rows_keep_their_runs_in_whatever_order_they_are_taken_off_the_shelf() {
        let mut proposals = Proposals::new(1);
        proposals.put_on_shelf(Box::new(Empty), &[0.0, 1.0, 2.0, 3.0]);
        proposals.push(&[40.0]);
        for run in [3, 1] {
            proposals.take_off(run, &[10.0 * run as f64]);
        }
        let rows = |proposals: &Proposals| -> Vec<Option<f64>> {
            (0..proposals.len()).map(|run| proposals.row(run).map(|row| row[0])).collect()
        };
        assert_eq!(rows(&proposals), [None, Some(10.0), None, Some(30.0), Some(40.0)]);
        proposals.retain(&[1, 2, 3]);
        assert_eq!(rows(&proposals), [Some(10.0), None, Some(30.0)]);
        assert_eq!(proposals.kept(1), Kept::Shelf(2, 2.0));
        let mut sum = [1.0];
        for run in 0..3 {
            proposals.add(run, 0.5, &mut sum);
        }
        assert_eq!(sum.map(f64::to_bits), [21.0_f64.to_bits()]);
    }
}

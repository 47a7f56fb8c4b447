//! Numbers of eight segments side by side. For [`super::varying`] and [`super::fading`] only.

use super::wide::LANES;

/// Rows of a number of each segment, aligned to whole rows.
#[derive(Debug)]
pub(super) struct Rows {
    values: Vec<f64>,
    first: usize,
}

impl Rows {
    /// Makes room for some rows of zeros, and for one more before them.
    pub(super) fn new(count: usize) -> Self {
        let values = vec![0.0_f64; (count + 2) * LANES];
        let unaligned = values.as_ptr().align_offset(LANES * size_of::<f64>());
        Self { values, first: LANES + unaligned.min(LANES) }
    }

    /// Returns the rows from one on.
    #[inline]
    pub(super) fn at(&self, row: usize) -> &[[f64; LANES]] {
        self.values[self.first + row * LANES..].as_chunks().0
    }

    /// Returns the rows from one on, to be written.
    #[inline]
    pub(super) fn at_mut(&mut self, row: usize) -> &mut [[f64; LANES]] {
        self.values[self.first + row * LANES..].as_chunks_mut().0
    }

    /// Returns the rows from one on with the number of the segment before in each place; the first
    /// segment, which has none, gets any number.
    #[inline]
    pub(super) fn of_lane_before(&self, row: usize) -> &[[f64; LANES]] {
        self.values[self.first + row * LANES - 1..].as_chunks().0
    }
}

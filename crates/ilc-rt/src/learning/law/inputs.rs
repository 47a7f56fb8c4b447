//! Storage of many inputs of equal length, for laws that learn from all of them.

/// Block size: growth allocates this much, and never moves existing rows.
const BLOCK_BYTES: usize = 1 << 20;

/// Rows of equal length in flat blocks.
#[derive(Debug)]
pub(super) struct Inputs {
    length: usize,
    rows_per_block: usize,
    n_rows: usize,
    blocks: Vec<Vec<f64>>,
}

impl Inputs {
    /// Creates storage for rows of `length` values.
    pub(super) fn new(length: usize) -> Self {
        let rows_per_block = (BLOCK_BYTES / (8 * length.max(1))).max(1);
        Self { length, rows_per_block, n_rows: 0, blocks: Vec::new() }
    }

    /// Reserves space for `n_rows` in all.
    pub(super) fn reserve(&mut self, n_rows: usize) {
        while self.blocks.len() * self.rows_per_block < n_rows {
            self.blocks.push(Vec::with_capacity(self.rows_per_block * self.length));
        }
    }

    pub(super) fn len(&self) -> usize {
        self.n_rows
    }

    pub(super) fn push(&mut self, row: &[f64]) {
        self.reserve(self.n_rows + 1);
        self.blocks[self.n_rows / self.rows_per_block].extend_from_slice(row);
        self.n_rows += 1;
    }

    pub(super) fn row(&self, index: usize) -> &[f64] {
        let start = index % self.rows_per_block * self.length;
        &self.blocks[index / self.rows_per_block][start..start + self.length]
    }

    pub(super) fn replace(&mut self, index: usize, row: &[f64]) {
        let start = index % self.rows_per_block * self.length;
        self.blocks[index / self.rows_per_block][start..start + self.length].copy_from_slice(row);
    }

    /// Adds `weight` times a row.
    pub(super) fn add(&self, index: usize, weight: f64, sum: &mut [f64]) {
        for (sum, value) in sum.iter_mut().zip(self.row(index)) {
            *sum += weight * value;
        }
    }

    /// Keeps only these rows, given in ascending order.
    pub(super) fn retain(&mut self, kept: &[usize]) {
        for (to, &from) in kept.iter().enumerate() {
            if to != from {
                let row = self.row(from).to_vec();
                self.replace(to, &row);
            }
        }
        self.n_rows = kept.len();
        self.blocks.truncate(self.n_rows.div_ceil(self.rows_per_block));
        let in_last = self.n_rows % self.rows_per_block;
        if let Some(last) = self.blocks.last_mut().filter(|_| in_last > 0) {
            last.truncate(in_last * self.length);
        }
    }

    pub(super) fn clear(&mut self) {
        for block in &mut self.blocks {
            block.clear();
        }
        self.n_rows = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_survive_growth_and_trimming() {
        let length = BLOCK_BYTES / 8 / 3;
        let row = |index: usize| vec![index as f64; length];
        let mut inputs = Inputs::new(length);
        for index in 0..10 {
            inputs.push(&row(index));
        }
        assert_eq!((inputs.len(), inputs.blocks.len()), (10, 4));
        inputs.retain(&[0, 3, 4, 9]);
        assert_eq!((inputs.len(), inputs.blocks.len()), (4, 2));
        inputs.push(&row(11));
        let kept: Vec<f64> = (0..5).map(|index| inputs.row(index)[length - 1]).collect();
        assert_eq!(kept, [0.0, 3.0, 4.0, 9.0, 11.0]);
        let mut sum = row(1);
        inputs.add(3, 0.5, &mut sum);
        assert_eq!(sum, vec![5.5; length]);
        inputs.retain(&[]);
        inputs.push(&row(7));
        assert_eq!((inputs.len(), inputs.row(0)[0]), (1, 7.0));
        inputs.clear();
        inputs.push(&row(8));
        assert_eq!((inputs.len(), inputs.row(0)[0]), (1, 8.0));
    }
}

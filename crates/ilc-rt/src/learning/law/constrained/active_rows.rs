//! The rows of the bounds as an active set: equations with multipliers. For `active`.

use super::rows::{Rows, Side};

impl Side {
    /// Keeps the multiplier of a row, and holds it if that outweighs its slack.
    fn keep(&mut self, row: usize, stiffness: f64) {
        self.kept[row] = self.multiplier[row];
        self.is_held[row] =
            self.is_on[row] > 0.0 && self.multiplier[row] > self.slack[row] * stiffness;
    }

    fn take_kept(&mut self) {
        for ((multiplier, kept), is_held) in
            self.multiplier.iter_mut().zip(&self.kept).zip(&self.is_held)
        {
            *multiplier = if *is_held { *kept } else { 0.0 };
        }
    }

    /// Lets go of a row that would be pulled, and holds one that is violated; returns true for a change.
    fn revise(&mut self, row: usize, value: f64, tolerance: f64) -> bool {
        if self.is_held[row] {
            if self.multiplier[row] < 0.0 {
                (self.is_held[row], self.multiplier[row]) = (false, 0.0);
                return true;
            }
        } else if self.is_on[row] * self.room(row, value) < -tolerance {
            self.is_held[row] = true;
            return true;
        }
        false
    }
}

impl Rows {
    /// Keeps the multipliers of a solution, and its active rows; `stiffness` is that of each kind.
    pub(super) fn keep(&mut self, stiffness: &[f64; 4]) {
        for (kind, range) in &self.ranges {
            for row in range.clone() {
                self.upper.keep(row, stiffness[*kind]);
                self.lower.keep(row, stiffness[*kind]);
            }
        }
    }

    /// Goes back to the kept multipliers of all rows.
    pub(super) fn restore_kept(&mut self) {
        self.upper.multiplier.copy_from_slice(&self.upper.kept);
        self.lower.multiplier.copy_from_slice(&self.lower.kept);
    }

    /// Goes back to the active rows of the last solution, and their multipliers.
    pub(super) fn take_kept(&mut self) {
        self.upper.take_kept();
        self.lower.take_kept();
    }

    /// Sets the weights of the active rows; both sides of a row with two equal limits press.
    pub(super) fn press(&mut self, penalties: &[f64; 4]) {
        for (kind, range) in &self.ranges {
            for row in range.clone() {
                let sides = [self.upper.is_held[row], self.lower.is_held[row]];
                self.sigma[row] =
                    sides.map(|held| if held { penalties[*kind] } else { 0.0 }).iter().sum();
            }
        }
    }

    /// Pulls each active row to its limit.
    pub(super) fn pull_to_limits(&mut self, penalties: &[f64; 4]) {
        self.pull.fill(0.0);
        for (kind, range) in &self.ranges {
            for row in range.clone() {
                for side in [&self.upper, &self.lower] {
                    if side.is_held[row] {
                        let way = side.limit[row] - self.values[row];
                        self.pull[row] += penalties[*kind] * way - side.sign * side.multiplier[row];
                    }
                }
            }
        }
    }

    /// Adds what the penalties push to the multipliers; returns the largest violation of an equation,
    /// relative to the size of its kind's limits.
    pub(super) fn correct_multipliers(&mut self, penalties: &[f64; 4], sizes: &[f64; 4]) -> f64 {
        let mut worst = 0.0_f64;
        for (kind, range) in &self.ranges {
            let size = sizes[*kind].max(f64::MIN_POSITIVE);
            for row in range.clone() {
                for side in [&mut self.upper, &mut self.lower] {
                    if side.is_held[row] {
                        let room = side.sign * (side.limit[row] - self.values[row]);
                        side.multiplier[row] -= penalties[*kind] * room;
                        worst = worst.max(room.abs() / size);
                    }
                }
            }
        }
        worst
    }

    /// Corrects the guess; returns the number of rows that changed.
    pub(super) fn revise(&mut self, sizes: &[f64; 4], tolerance: f64) -> usize {
        let mut n_changed = 0;
        for (kind, range) in &self.ranges {
            for row in range.clone() {
                for side in [&mut self.upper, &mut self.lower] {
                    let has_changed = side.revise(row, self.values[row], tolerance * sizes[*kind]);
                    n_changed += usize::from(has_changed);
                }
            }
        }
        n_changed
    }

    /// Sets the slacks; returns the sum of the products with the multipliers.
    pub(super) fn gap_of_active_set(&mut self) -> f64 {
        let mut gap = 0.0;
        for side in [&mut self.upper, &mut self.lower] {
            for row in 0..self.values.len() {
                if side.is_on[row] > 0.0 {
                    let room = side.room(row, self.values[row]);
                    gap += room.abs() * side.multiplier[row];
                    side.slack[row] = room.max(0.0);
                }
            }
        }
        gap
    }
}

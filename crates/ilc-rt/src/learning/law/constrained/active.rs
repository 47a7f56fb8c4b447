//! Active-set steps: the bounds that were active become equations, and their solution corrects the guess.
//!
//! For `interior`, which tries them from its last solution: they end after a few linear systems, or soon
//! turn out to lead nowhere. The equations are kept by penalties and multipliers (augmented Lagrangian), so
//! that the recursion is that of the interior point, and bounds that depend on each other do no harm.

use super::interior::{GAP_ENOUGH, Interior};
use super::rows::{BEND, OUTPUT, STEP};

/// Penalty of a row relative to its stiffness: each solution reduces the violation by about this
/// factor, times the share of the stiffness that the row meets.
const PENALTY: f64 = 1e10;
/// Least and largest number of solutions with one factorisation. The first one moves far, and so is rounded; the
/// second one is exact.
const SOLUTIONS: [usize; 2] = [2, 4];
/// Violation that is rounding, relative to the size of the limits.
const MISSED: f64 = 1e-12;
/// Largest number of guesses.
const MAX_GUESSES: usize = 6;
/// Share of its corrections that the next guess may need.
const SHRINKS: f64 = 0.75;

impl<const N: usize, const M: usize, const P: usize, const NS: usize> Interior<N, M, P, NS> {
    /// Searches from the current iterate and multipliers; returns as `search` does.
    pub(super) fn pin(&mut self) -> (bool, usize, f64) {
        let sizes = self.sizes();
        let stiffness = self.stiffness_of_rows();
        let penalties = stiffness.map(|stiffness| PENALTY * stiffness);
        self.rows.take_kept();
        let mut n_before = f64::INFINITY;
        for guess in 1..=MAX_GUESSES {
            let missed = self.solve_equations(&penalties, &sizes);
            let n_wrong = self.rows.revise(&sizes, MISSED) as f64;
            if n_wrong <= 0.0 {
                self.look();
                let gap = self.rows.gap_of_active_set() / self.cost.max(self.least_cost());
                return (missed <= MISSED && gap <= GAP_ENOUGH, guess, gap);
            }
            if !missed.is_finite() || n_wrong > SHRINKS * n_before {
                return (false, guess, f64::INFINITY);
            }
            n_before = n_wrong;
        }
        (false, MAX_GUESSES, f64::INFINITY)
    }

    /// Goes to the solution with all active rows at their limits; returns the largest violation.
    fn solve_equations(&mut self, penalties: &[f64; 4], sizes: &[f64; 4]) -> f64 {
        self.rows.press(penalties);
        let [least, most] = SOLUTIONS;
        let mut missed = f64::INFINITY;
        for solution in 1..=most {
            self.look();
            self.rows.pull_to_limits(penalties);
            if solution == 1 {
                self.factorise(true);
                self.forward(true);
            } else {
                self.sweep(true);
            }
            self.go(1.0);
            missed = self.rows.correct_multipliers(penalties, sizes);
            if solution >= least && missed <= MISSED {
                break;
            }
        }
        missed
    }

    /// Returns the resistance of the input to each kind of row.
    pub(super) fn stiffness_of_rows(&self) -> [f64; 4] {
        let own = self.plain[0].stiffness();
        let reach = self.plant.d.iter().flatten().fold(0.0_f64, |most, d| most.max(d.abs()));
        let mut stiffness = [own; 4];
        // Sums of the squares of 1, -1 and 1, -2, 1.
        stiffness[STEP] = own / 2.0;
        stiffness[BEND] = own / 6.0;
        stiffness[OUTPUT] = own / (reach * reach).max(f64::MIN_POSITIVE);
        stiffness
    }
}

//! Weights for several agents in formation.

use nalgebra::DMatrix;

use super::{Objective, Weight};
use crate::learning::{LearningError, Result};

/// Most channels of all agents together.
const CHANNELS_MAX: usize = 256;
/// Most entries of `F`: half a gigabyte.
const ENTRIES_MAX: usize = 1 << 26;

/// The agents, and the maps from their errors to formation errors and to the centre's error.
///
/// An agent is a machine, or a group of axes, with its own reference. The errors of all agents are
/// stacked in each sample: `e = (e_1x, e_1y, e_2x, ...)`. The formation error of two agents is the
/// difference of their errors, `e_j - e_i = (r_j - r_i) - (y_j - y_i)`: the desired offset, given
/// by the references, minus the actual one. So the references alone define the formation
/// ([`Formation::follow`] makes them from a leader's), and a drift common to all agents has no cost
/// in it.
///
/// # Shapes
/// - every stacked signal: `n_samples` x (`n_agents` * `n_axes`), time first
/// # Source
/// - \[barton2010\], Eq. (4.4), (6.4), (6.14), (6.15).
#[derive(Debug, Clone, PartialEq)]
pub struct Formation {
    n_agents: usize,
    n_axes: usize,
    /// `F`: formation errors from all errors.
    shape: DMatrix<f64>,
    /// `K`: error of the centre from all errors.
    centre: DMatrix<f64>,
}

impl Formation {
    /// Creates a formation of equal agents in which every pair keeps its offset in every axis.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] or [`LearningError::TooMany`], as [`Formation::check_size`].
    pub fn new(n_agents: usize, n_axes: usize) -> Result<Self> {
        Self::check_size(n_agents, n_axes)?;
        let axes: Vec<usize> = (0..n_axes).collect();
        Self::of_pairs(n_agents, n_axes, &Self::all_pairs(n_agents), &axes)
    }

    /// Creates a formation in which the given pairs of agents keep their offset in the given axes.
    ///
    /// Each axis has one row per pair `(i, j)`: -1 at agent `i` and 1 at agent `j`. With three
    /// agents of two axes and all pairs this is the `F` of the source. The centre is the mean of
    /// the agents.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] or [`LearningError::TooMany`], as [`Formation::check_size`], the latter
    ///   for too many pairs and axes, too.
    /// - [`LearningError::Weight`] for an agent or axis that does not exist, or a pair of equal
    ///   agents.
    pub fn of_pairs(
        n_agents: usize,
        n_axes: usize,
        pairs: &[(usize, usize)],
        axes: &[usize],
    ) -> Result<Self> {
        Self::check_size(n_agents, n_axes)?;
        let (value, allowed) =
            (axes.len().saturating_mul(pairs.len()), ENTRIES_MAX / (n_agents * n_axes));
        if value > allowed {
            return Err(LearningError::TooMany { what: "pairs * axes", value, allowed });
        }
        for (i, j) in pairs {
            if i == j || *i.max(j) >= n_agents {
                let reason = format!("({i}, {j}); two different ones of {n_agents} agents from 0");
                return Err(LearningError::Weight { what: "pairs", sample: 0, reason });
            }
        }
        if let Some(axis) = axes.iter().find(|axis| **axis >= n_axes) {
            let reason = format!("axis {axis}; the agents have {n_axes} axes from 0");
            return Err(LearningError::Weight { what: "axes", sample: 0, reason });
        }
        let mut shape = DMatrix::zeros(axes.len() * pairs.len(), n_agents * n_axes);
        for (place, axis) in axes.iter().enumerate() {
            for (row, (i, j)) in pairs.iter().enumerate() {
                shape[(place * pairs.len() + row, i * n_axes + axis)] = -1.0;
                shape[(place * pairs.len() + row, j * n_axes + axis)] = 1.0;
            }
        }
        let share = 1.0 / n_agents as f64;
        let centre = DMatrix::from_fn(n_axes, n_agents * n_axes, |row, col| {
            if col % n_axes == row { share } else { 0.0 }
        });
        Ok(Self { n_agents, n_axes, shape, centre })
    }

    /// Ensures that a formation has agents and axes, and not too many for memory.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] for 0 agents or axes.
    /// - [`LearningError::TooMany`] for more than 256 channels of all agents together.
    pub fn check_size(n_agents: usize, n_axes: usize) -> Result {
        for (what, count) in [("n_agents", n_agents), ("n_axes", n_axes)] {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        let (value, allowed) = (n_agents.saturating_mul(n_axes), CHANNELS_MAX);
        if value > allowed {
            return Err(LearningError::TooMany { what: "n_agents * n_axes", value, allowed });
        }
        Ok(())
    }

    /// Returns every pair of agents, neighbours in number first.
    pub fn all_pairs(n_agents: usize) -> Vec<(usize, usize)> {
        (1..n_agents).flat_map(|gap| (0..n_agents - gap).map(move |i| (i, i + gap))).collect()
    }

    /// Replaces the centre (by default the mean) by any linear map of all errors to those of one
    /// agent.
    ///
    /// # Errors
    /// - [`LearningError::Weight`] unless the map is `n_axes` x (`n_agents` * `n_axes`) and finite.
    pub fn with_centre(mut self, centre: DMatrix<f64>) -> Result<Self> {
        check_map("centre", &centre, self.n_channels())?;
        if centre.nrows() != self.n_axes {
            let reason = format!("{} rows; {} are needed", centre.nrows(), self.n_axes);
            return Err(LearningError::Weight { what: "centre", sample: 0, reason });
        }
        self.centre = centre;
        Ok(self)
    }

    /// Returns the number of agents.
    pub fn n_agents(&self) -> usize {
        self.n_agents
    }

    /// Returns the number of axes of one agent.
    pub fn n_axes(&self) -> usize {
        self.n_axes
    }

    /// Returns the number of channels of all agents together.
    pub fn n_channels(&self) -> usize {
        self.n_agents * self.n_axes
    }

    /// Returns `F`, the map from all errors to the formation errors.
    pub fn shape(&self) -> &DMatrix<f64> {
        &self.shape
    }

    /// Returns `K`, the map from all errors to the error of the formation's centre.
    pub fn centre(&self) -> &DMatrix<f64> {
        &self.centre
    }

    /// Returns the formation errors of a run, `n_samples` x rows of `F`, time first.
    ///
    /// # Errors
    /// - [`LearningError::Length`] unless `error` holds whole samples of all agents.
    pub fn errors(&self, error: &[f64]) -> Result<Vec<f64>> {
        check_signal("error", error, self.n_channels())?;
        let row_of = |sample: &[f64], row: usize| -> f64 {
            sample.iter().enumerate().map(|(i, value)| self.shape[(row, i)] * value).sum()
        };
        let rows = self.shape.nrows();
        Ok(error
            .chunks(self.n_channels())
            .flat_map(|sample| (0..rows).map(move |row| row_of(sample, row)))
            .collect())
    }

    /// Returns the references of all agents from the leader's and each agent's offset from it.
    ///
    /// # Shapes
    /// - `leader`: `n_samples` x `n_axes`; `offsets`: `n_agents` x `n_axes`; the result:
    ///   `n_samples` x (`n_agents` * `n_axes`)
    /// # Errors
    /// - [`LearningError::Length`] for a wrong length.
    pub fn follow(&self, leader: &[f64], offsets: &[f64]) -> Result<Vec<f64>> {
        check_signal("leader", leader, self.n_axes)?;
        if offsets.len() != self.n_channels() {
            return Err(LearningError::Length {
                what: "offsets",
                found: offsets.len(),
                n_samples: self.n_agents,
                n_channels: self.n_axes,
            });
        }
        Ok(leader
            .chunks(self.n_axes)
            .flat_map(|sample| {
                offsets.iter().enumerate().map(|(i, offset)| sample[i % self.n_axes] + offset)
            })
            .collect())
    }

    /// Returns the weight of all agents' errors (or inputs) for an objective.
    ///
    /// `Q = sum over rows f of F: w_f f' f + X1 (B1 diag(Q_1, .., Q_p) + B2 K' Q_c K)`, see
    /// [`Objective`].
    ///
    /// # Errors
    /// - [`LearningError::Weight`] for a term that is out of range or of the wrong shape.
    /// # Source
    /// - \[barton2010\], Eq. (6.3), (6.6), (6.8), (6.9).
    pub fn weight(&self, n_samples: usize, objective: &Objective) -> Result<Weight> {
        objective.check(n_samples, self.n_agents, self.n_axes)?;
        let at = |k: usize| objective.at(k, self);
        if objective.is_constant() {
            return Ok(Weight::Block(at(0)));
        }
        Ok(Weight::Blocks((0..n_samples).map(at).collect()))
    }
}

/// Refuses a signal that is not a whole number of samples.
fn check_signal(what: &'static str, signal: &[f64], n_channels: usize) -> Result {
    let found = signal.len();
    if found > 0 && found.is_multiple_of(n_channels) {
        return Ok(());
    }
    let n_samples = (found / n_channels).max(1);
    Err(LearningError::Length { what, found, n_samples, n_channels })
}

fn check_map(what: &'static str, map: &DMatrix<f64>, n_channels: usize) -> Result {
    let refused = |reason: String| Err(LearningError::Weight { what, sample: 0, reason });
    if map.ncols() != n_channels {
        return refused(format!("{} columns; {n_channels} are needed", map.ncols()));
    }
    match map.iter().find(|entry| !entry.is_finite()) {
        Some(entry) => refused(format!("{entry}; only finite values are allowed")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_agents_of_two_axes_have_the_printed_shape() {
        #[rustfmt::skip]
        let printed = DMatrix::from_row_slice(6, 6, &[
            -1.0,  0.0,  1.0,  0.0, 0.0, 0.0,
             0.0,  0.0, -1.0,  0.0, 1.0, 0.0,
            -1.0,  0.0,  0.0,  0.0, 1.0, 0.0,
             0.0, -1.0,  0.0,  1.0, 0.0, 0.0,
             0.0,  0.0,  0.0, -1.0, 0.0, 1.0,
             0.0, -1.0,  0.0,  0.0, 0.0, 1.0,
        ]);
        let formation = Formation::new(3, 2).unwrap();
        assert_eq!(formation.shape(), &printed);
        assert_eq!(formation.shape().rank(1e-12), 4);
        let centre = DMatrix::from_fn(2, 6, |i, j| if i == j % 2 { 1.0 / 3.0 } else { 0.0 });
        assert_eq!(formation.centre(), &centre);
    }

    #[test]
    fn errors_are_wanted_offsets_less_actual_ones() {
        // Agent 1 should stay 2 above agent 0; it is 1.5 above and 0.25 to the side.
        let formation = Formation::new(2, 2).unwrap();
        let reference = formation.follow(&[5.0, 7.0], &[0.0, 0.0, 0.0, 2.0]).unwrap();
        assert_eq!(reference, [5.0, 7.0, 5.0, 9.0]);
        let measured = [4.0, 6.0, 4.25, 7.5];
        let error: Vec<f64> = reference.iter().zip(measured).map(|(r, y)| r - y).collect();
        assert_eq!(formation.errors(&error).unwrap(), [0.0 - 0.25, 2.0 - 1.5]);
    }

    #[test]
    fn one_axis_may_stay_out_of_the_formation() {
        let formation = Formation::of_pairs(2, 3, &[(0, 1)], &[0, 1]).unwrap();
        let error = [1.0, 2.0, 3.0, 4.0, 6.0, 9.0];
        assert_eq!(formation.errors(&error).unwrap(), [3.0, 4.0]);
    }

    #[test]
    fn one_wrong_thing_at_a_time_is_refused() {
        let told = |pairs: &[(usize, usize)], axes: &[usize]| {
            Formation::of_pairs(2, 2, pairs, axes).unwrap_err().to_string()
        };
        assert!(told(&[(1, 1)], &[0]).contains("pairs"));
        assert!(told(&[(0, 2)], &[0]).contains("(0, 2)"));
        assert!(told(&[(0, 1)], &[2]).contains("axis 2"));
        assert!(Formation::new(0, 2).unwrap_err().to_string().contains("n_agents"));
        assert!(Formation::new(2, 0).unwrap_err().to_string().contains("n_axes"));
        for (n_agents, n_axes) in
            [(257, 1), (1, 257), (10_000_000, 1), (1, usize::MAX), (2, usize::MAX)]
        {
            let line = Formation::new(n_agents, n_axes).unwrap_err().to_string();
            assert!(line.contains("at most 256"), "{line}");
        }
        assert_eq!(Formation::new(16, 16).unwrap().shape().ncols(), 256);
        let axes = vec![0; 1 << 20];
        let line = Formation::of_pairs(64, 4, &Formation::all_pairs(64), &axes).unwrap_err();
        assert!(line.to_string().contains("at most 262144"), "{line}");
        let good = Formation::new(2, 2).unwrap();
        let narrow = good.clone().with_centre(DMatrix::zeros(2, 3)).unwrap_err();
        assert!(narrow.to_string().contains("3 columns"));
        let flat = good.clone().with_centre(DMatrix::zeros(1, 4)).unwrap_err();
        assert!(flat.to_string().contains("1 rows"));
        let nan = good.clone().with_centre(DMatrix::from_element(2, 4, f64::NAN)).unwrap_err();
        assert!(nan.to_string().contains("NaN"));
        assert!(good.errors(&[1.0; 6]).unwrap_err().to_string().contains("error holds 6"));
        assert!(good.follow(&[1.0; 3], &[0.0; 4]).unwrap_err().to_string().contains("leader"));
        assert!(good.follow(&[1.0; 2], &[0.0; 2]).unwrap_err().to_string().contains("offsets"));
    }
}

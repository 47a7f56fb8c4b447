//! Several delta mechanisms of one cell, three axes each: for the machine, which makes them from a cell description.

use ilc_rt::config::{Cell, DeltaSimulation};
use ilc_rt::kinematics::KinematicsError;

use super::delta::{Delta, LEGS};
use super::{Demand, Plant};

/// Delta mechanisms beside each other, alike and mechanically apart; the first has the first three axes.
#[derive(Clone, Debug)]
pub struct Mechanisms(Vec<Delta>);

impl Mechanisms {
    /// Creates the mechanisms of a cell description, at rest at their start positions.
    ///
    /// # Errors
    /// [`KinematicsError`] for a mechanism that validation would have refused.
    pub fn from_cell(cell: &Cell, description: &DeltaSimulation) -> Result<Self, KinematicsError> {
        let first = (0..cell.n_axes() / LEGS).map(|number| number * LEGS);
        first
            .map(|axis| Delta::from_cell(cell, description, axis))
            .collect::<Result<_, _>>()
            .map(Self)
    }

    /// Reads from the mechanism of an axis.
    fn of(&self, axis: usize, read: impl Fn(&Delta, usize) -> f64) -> f64 {
        self.0.get(axis / LEGS).map_or(0.0, |delta| read(delta, axis % LEGS))
    }
}

impl Plant for Mechanisms {
    fn n_axes(&self) -> usize {
        self.0.len() * LEGS
    }

    fn step(&mut self, demand: &[Demand], dt_s: f64) {
        let mut demands = demand.chunks(LEGS);
        for delta in &mut self.0 {
            delta.step(demands.next().unwrap_or(&[]), dt_s);
        }
    }

    fn limit_force(&mut self, axis: usize, share: f64) {
        if let Some(delta) = self.0.get_mut(axis / LEGS) {
            delta.limit_force(axis % LEGS, share);
        }
    }

    fn feed_force(&mut self, axis: usize, force_n: f64) {
        if let Some(delta) = self.0.get_mut(axis / LEGS) {
            delta.feed_force(axis % LEGS, force_n);
        }
    }

    fn encoder_m(&self, axis: usize) -> f64 {
        self.of(axis, Plant::encoder_m)
    }

    fn encoder_velocity_m_s(&self, axis: usize) -> f64 {
        self.of(axis, Plant::encoder_velocity_m_s)
    }

    fn force_n(&self, axis: usize) -> f64 {
        self.of(axis, Plant::force_n)
    }

    fn tool_m(&self, axis: usize) -> f64 {
        self.of(axis, Plant::tool_m)
    }
}

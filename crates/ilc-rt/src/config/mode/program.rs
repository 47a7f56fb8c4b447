//! The program of an axis as its loops see it: way, velocity and acceleration, sample by sample.
//!
//! For the modes beside it, and for the prediction of a run without learning.

use super::super::Axis;

/// The program of an axis; positions are relative to its start.
#[derive(Clone, Debug)]
pub struct AxisProgram {
    /// Way from the start.
    pub way_m: Vec<f64>,
    /// Velocity to the next set point.
    pub velocity_m_s: Vec<f64>,
    /// Change of that velocity.
    pub acceleration_m_s2: Vec<f64>,
    /// Time from one set point to the next.
    pub cycle_s: f64,
}

impl AxisProgram {
    /// Creates it from the set points of all axes.
    ///
    /// # Shapes
    /// - `reference_m`: `n_samples` x `n_axes`, time first
    pub fn new(reference_m: &[f64], n_axes: usize, axis: usize, cycle_s: f64) -> Self {
        let own = reference_m.iter().skip(axis).step_by(n_axes.max(1));
        let start_m = own.clone().next().copied().unwrap_or(0.0);
        let way_m: Vec<f64> = own.map(|place_m| place_m - start_m).collect();
        let last = way_m.len().saturating_sub(1);
        let velocity_m_s: Vec<f64> =
            (0..way_m.len()).map(|k| (way_m[(k + 1).min(last)] - way_m[k]) / cycle_s).collect();
        let before = std::iter::once(0.0).chain(velocity_m_s.iter().copied());
        let acceleration_m_s2 =
            before.zip(&velocity_m_s).map(|(before, now)| (now - before) / cycle_s).collect();
        Self { way_m, velocity_m_s, acceleration_m_s2, cycle_s }
    }

    /// Creates a ramp of one unit per second.
    pub fn ramp(n_samples: usize, cycle_s: f64) -> Self {
        let way_m: Vec<f64> = (0..=n_samples).map(|k| k as f64 * cycle_s).collect();
        let mut ramp = Self::new(&way_m, 1, 0, cycle_s);
        // The last set point has no next one.
        for signal in [&mut ramp.way_m, &mut ramp.velocity_m_s, &mut ramp.acceleration_m_s2] {
            signal.pop();
        }
        ramp
    }

    /// Returns the set points, ahead of the program by the lead of the axis.
    pub(super) fn ahead_m(&self, axis: &Axis) -> Vec<f64> {
        let lead_s = axis.feedforward.map_or(0.0, |forward| forward.lead_s);
        let motion = self.way_m.iter().zip(&self.velocity_m_s);
        motion.map(|(way, velocity)| way + lead_s * velocity).collect()
    }

    /// Returns the force that the feed-forwards of the axis add, without Coulomb friction, which a
    /// linear model has not either.
    pub(super) fn force_n(&self, axis: &Axis) -> Vec<f64> {
        let (Some(force), Some(forward)) = (axis.force, axis.feedforward) else {
            return vec![0.0; self.way_m.len()];
        };
        let (mass, viscous) =
            (forward.acceleration * force.mass_kg, forward.friction * force.viscous_n_s_m);
        let motion = self.velocity_m_s.iter().zip(&self.acceleration_m_s2);
        motion.map(|(velocity, acceleration)| mass * acceleration + viscous * velocity).collect()
    }
}

//! Cyclic synchronous velocity: the drive closes the velocity loop; the learned input is added to the
//! output of the controller's position loop, or to the drive's torque (object 0x60B2).

use std::f64::consts::TAU;

use super::super::{Axis, AxisModel, InputKind};
use super::drive::{DriveLoops, from_input};
use super::{AxisProgram, ModeDesign};
use crate::model::{Method, ModelError, StateSpace, discretize, from_transfer_function};

pub(super) struct Csv;

impl ModeDesign for Csv {
    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)> {
        vec![("velocity_bandwidth_hz", model.velocity_bandwidth_hz)]
    }

    fn closes_position_loop(&self) -> bool {
        true
    }

    fn needs_position_loop(&self) -> bool {
        true
    }

    /// `G / (1 + kv z^-1 G)` with `G = a / (s (s + a))`, as the position in the controller's loop
    /// is one cycle old; with a zero-order hold. A torque enters the same loop behind the drive's
    /// velocity control.
    fn nominal_model(
        &self,
        axis: &Axis,
        input: InputKind,
        cycle_s: f64,
    ) -> Result<StateSpace, ModelError> {
        let bandwidth_rad_s = bandwidth_rad_s(axis);
        let integral_time_s = axis.force.and_then(|force| force.integral_time_s);
        let delay = axis.model.unwrap_or_default().delay_samples as usize;
        if input == InputKind::Velocity && integral_time_s.is_none() {
            let numerator = [bandwidth_rad_s];
            let velocity = from_transfer_function(&numerator, &[1.0, bandwidth_rad_s, 0.0], None)?;
            let gain = nalgebra::dmatrix![gain_per_s(axis)];
            let controller = StateSpace::static_gain(gain, Some(cycle_s))?.delayed(1)?;
            return discretize(&velocity, cycle_s, Method::ZeroOrderHold)?
                .delayed(delay)?
                .feedback(&controller);
        }
        let loops = loops(axis);
        let gains = nalgebra::dmatrix![0.0; gain_per_s(axis); 0.0];
        let controller = StateSpace::static_gain(gains, Some(cycle_s))?.delayed(1)?;
        let closed = discretize(&loops.model()?, cycle_s, Method::ZeroOrderHold)?
            .delayed(delay)?
            .feedback(&controller)?;
        from_input(&closed, input as usize)
    }

    fn feed(&self, axis: &Axis, program: &AxisProgram) -> Vec<(InputKind, Vec<f64>)> {
        let share = axis.position_loop.map_or(0.0, |it| it.velocity_feedforward);
        let ahead_m = program.ahead_m(axis);
        let motion = ahead_m.iter().zip(&program.velocity_m_s);
        let velocity = motion.map(|(way, velocity)| gain_per_s(axis) * way + share * velocity);
        let mut feed = vec![(InputKind::Velocity, velocity.collect())];
        if axis.feedforward.is_some() {
            feed.push((InputKind::Torque, program.force_n(axis)));
        }
        feed
    }

    fn told_velocity(&self, axis: &Axis) -> Axis {
        let mut told = axis.clone();
        if let Some(position_loop) = &mut told.position_loop {
            position_loop.velocity_feedforward = 1.0;
        }
        told
    }

    /// The input moves the axis only until the position loop counteracts it.
    fn travel(&self, axis: &Axis, input: InputKind) -> f64 {
        let per_velocity = 1.0 / gain_per_s(axis);
        if input == InputKind::Torque {
            return per_velocity / loops(axis).gain_n_s_m();
        }
        per_velocity
    }

    /// `kv` and the velocity loop make a second-order loop with `w0^2 = kv 2 pi f`.
    fn natural_frequency_hz(&self, axis: &Axis) -> f64 {
        (gain_per_s(axis) * bandwidth_rad_s(axis) / (TAU * TAU)).sqrt()
    }

    fn perturbed(&self, axis: &Axis, frequency: f64, _damping: f64) -> Axis {
        let mut other = axis.clone();
        if let Some(model) = &mut other.model {
            model.velocity_bandwidth_hz = model.velocity_bandwidth_hz.map(|hz| hz * frequency);
        }
        other
    }
}

/// Returns the loops of the drive; that of the position is in the controller.
fn loops(axis: &Axis) -> DriveLoops {
    DriveLoops {
        position_gain_per_s: 0.0,
        bandwidth_rad_s: bandwidth_rad_s(axis),
        integral_time_s: axis.force.and_then(|force| force.integral_time_s),
        mass_kg: axis.force.map_or(1.0, |force| force.mass_kg),
    }
}

fn bandwidth_rad_s(axis: &Axis) -> f64 {
    // A loop that is damped critically has a = 4 kv.
    axis.model
        .and_then(|model| model.velocity_bandwidth_hz)
        .map_or_else(|| 4.0 * gain_per_s(axis), |bandwidth_hz| TAU * bandwidth_hz)
}

fn gain_per_s(axis: &Axis) -> f64 {
    axis.position_loop.map_or(1.0, |position_loop| position_loop.gain_per_s)
}

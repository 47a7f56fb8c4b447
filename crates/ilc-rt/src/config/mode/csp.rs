//! Cyclic synchronous position: the drive closes both loops; the learned input is added to the set
//! point, or to the drive's velocity or torque (objects 0x60B1, 0x60B2).

use std::f64::consts::TAU;

use super::super::{Axis, AxisModel, InputKind};
use super::drive::{DriveLoops, from_input};
use super::{AxisProgram, ModeDesign};
use crate::model::{Method, ModelError, StateSpace, discretize, second_order};

pub(super) struct Csp;

impl ModeDesign for Csp {
    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)> {
        vec![("natural_frequency_hz", model.natural_frequency_hz), ("damping", model.damping)]
    }

    fn closes_position_loop(&self) -> bool {
        false
    }

    /// `w^2 / (s^2 + 2 d w s + w^2)` from the set point, with a zero-order hold.
    fn nominal_model(
        &self,
        axis: &Axis,
        input: InputKind,
        cycle_s: f64,
    ) -> Result<StateSpace, ModelError> {
        let (frequency_hz, damping) = (self.natural_frequency_hz(axis), damping(axis));
        let integral_time_s = axis.force.and_then(|force| force.integral_time_s);
        let position = if input == InputKind::Position && integral_time_s.is_none() {
            second_order(TAU * frequency_hz, damping)?
        } else {
            from_input(&loops(axis, integral_time_s).model()?, input as usize)?
        };
        let delay = axis.model.unwrap_or_default().delay_samples as usize;
        discretize(&position, cycle_s, Method::ZeroOrderHold)?.delayed(delay)
    }

    fn feed(&self, axis: &Axis, program: &AxisProgram) -> Vec<(InputKind, Vec<f64>)> {
        let mut feed = vec![(InputKind::Position, program.ahead_m(axis))];
        if let Some(forward) = axis.feedforward {
            let velocity = program.velocity_m_s.iter().map(|v| forward.velocity * v).collect();
            feed.push((InputKind::Velocity, velocity));
            feed.push((InputKind::Torque, program.force_n(axis)));
        }
        feed
    }

    /// The delay of a drive that interpolates is a whole cycle; the model has a hold beside it.
    fn hold_s(&self, axis: &Axis, cycle_s: f64) -> f64 {
        let interpolates = axis.model.is_some_and(|model| model.delay_samples > 0);
        if interpolates { 0.5 * cycle_s } else { 0.0 }
    }

    fn travel(&self, axis: &Axis, input: InputKind) -> f64 {
        let loops = loops(axis, None);
        let kv = loops.position_gain_per_s;
        match input {
            InputKind::Position => 1.0,
            InputKind::Velocity => 1.0 / kv,
            InputKind::Torque => 1.0 / (kv * loops.gain_n_s_m()),
        }
    }

    fn natural_frequency_hz(&self, axis: &Axis) -> f64 {
        axis.model.and_then(|model| model.natural_frequency_hz).unwrap_or_else(|| {
            // A loop of second order follows a velocity 2 d / w0 behind, which must be less than
            // the allowed following error at full speed.
            let limits = &axis.limits;
            2.0 * limits.velocity_max_m_s / (TAU * limits.following_error_max_m)
        })
    }

    fn perturbed(&self, axis: &Axis, frequency: f64, damping: f64) -> Axis {
        let mut other = axis.clone();
        if let Some(model) = &mut other.model {
            model.natural_frequency_hz = model.natural_frequency_hz.map(|hz| hz * frequency);
            model.damping = model.damping.map(|value| value * damping);
        }
        other
    }
}

fn damping(axis: &Axis) -> f64 {
    axis.model.and_then(|model| model.damping).unwrap_or(1.0)
}

/// `kv = w / 2 d` and `a = 2 d w` give the second-order response.
fn loops(axis: &Axis, integral_time_s: Option<f64>) -> DriveLoops {
    let natural_rad_s = TAU * Csp.natural_frequency_hz(axis);
    DriveLoops {
        position_gain_per_s: natural_rad_s / (2.0 * damping(axis)),
        bandwidth_rad_s: 2.0 * damping(axis) * natural_rad_s,
        integral_time_s,
        mass_kg: axis.force.map_or(1.0, |force| force.mass_kg),
    }
}

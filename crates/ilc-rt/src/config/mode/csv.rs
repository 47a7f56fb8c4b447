//! Cyclic synchronous velocity: the learned input is added to the output of the controller's
//! position loop.

use std::f64::consts::TAU;

use super::super::{Axis, AxisModel, AxisUnit, Learning};
use super::{Demand, ModeDesign, Peaks};
use crate::model::{Method, ModelError, StateSpace, discretize, from_transfer_function};

pub(super) struct Csv;

impl ModeDesign for Csv {
    fn input_unit(&self, unit: AxisUnit) -> &'static str {
        match unit {
            AxisUnit::M => "m/s",
            AxisUnit::Rad => "rad/s",
        }
    }

    fn input_max(&self, learning: &Learning) -> f64 {
        learning.input_max_m_s
    }

    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)> {
        vec![("velocity_bandwidth_hz", model.velocity_bandwidth_hz)]
    }

    fn closes_position_loop(&self) -> bool {
        true
    }

    /// `G / (1 + kv z^-1 G)` with `G = a / (s (s + a))`, as the position in the controller's loop
    /// is one cycle old; with a zero-order hold.
    fn nominal_model(&self, axis: &Axis, cycle_s: f64) -> Result<StateSpace, ModelError> {
        let model = axis.model.unwrap_or_default();
        let bandwidth = TAU * model.velocity_bandwidth_hz.unwrap_or(1.0);
        let velocity = from_transfer_function(&[bandwidth], &[1.0, bandwidth, 0.0], None)?;
        let controller =
            StateSpace::static_gain(nalgebra::dmatrix![gain_per_s(axis)], Some(cycle_s))?
                .delayed(1)?;
        discretize(&velocity, cycle_s, Method::ZeroOrderHold)?
            .delayed(model.delay_samples as usize)?
            .feedback(&controller)
    }

    fn feed(&self, axis: &Axis, set_point_m: f64, velocity_m_s: f64) -> f64 {
        let Some(position_loop) = axis.position_loop else { return set_point_m };
        position_loop.gain_per_s * set_point_m + position_loop.velocity_feedforward * velocity_m_s
    }

    fn demands(&self, axis: &Axis, learning: &Learning, peaks: Peaks) -> (f64, [Demand; 3]) {
        let limits = &axis.limits;
        let demand = |what, needed, allowed, unit| Demand { what, needed, allowed, unit };
        let demands = [
            demand("learning.input_max_m_s", peaks.value, learning.input_max_m_s, "m/s"),
            demand("limits.velocity_max_m_s", peaks.value, limits.velocity_max_m_s, "m/s"),
            demand(
                "limits.acceleration_max_m_s2",
                peaks.rate,
                limits.acceleration_max_m_s2,
                "m/s^2",
            ),
        ];
        // The input moves the axis only until the position loop counteracts it.
        (peaks.value / gain_per_s(axis), demands)
    }
}

fn gain_per_s(axis: &Axis) -> f64 {
    axis.position_loop.map_or(1.0, |position_loop| position_loop.gain_per_s)
}

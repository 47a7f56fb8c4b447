//! Cyclic synchronous position: the learned input is added to the set point of the drive's position loop.

use std::f64::consts::TAU;

use super::super::{Axis, AxisModel, AxisUnit, Learning};
use super::{Demand, ModeDesign, Peaks};
use crate::model::{Method, ModelError, StateSpace, discretize, second_order};

pub(super) struct Csp;

impl ModeDesign for Csp {
    fn input_unit(&self, unit: AxisUnit) -> &'static str {
        unit.symbol()
    }

    fn input_max(&self, learning: &Learning) -> f64 {
        learning.input_max_m
    }

    fn model_keys(&self, model: &AxisModel) -> Vec<(&'static str, Option<f64>)> {
        vec![("natural_frequency_hz", model.natural_frequency_hz), ("damping", model.damping)]
    }

    fn closes_position_loop(&self) -> bool {
        false
    }

    /// `w^2 / (s^2 + 2 d w s + w^2)` with a zero-order hold.
    fn nominal_model(&self, axis: &Axis, cycle_s: f64) -> Result<StateSpace, ModelError> {
        let model = axis.model.unwrap_or_default();
        let frequency_hz = model.natural_frequency_hz.unwrap_or(1.0);
        let damping = model.damping.unwrap_or(1.0);
        let position = second_order(TAU * frequency_hz, damping)?;
        discretize(&position, cycle_s, Method::ZeroOrderHold)?.delayed(model.delay_samples as usize)
    }

    fn feed(&self, _axis: &Axis, set_point_m: f64, _velocity_m_s: f64) -> f64 {
        set_point_m
    }

    fn demands(&self, axis: &Axis, learning: &Learning, peaks: Peaks) -> (f64, [Demand; 3]) {
        let limits = &axis.limits;
        let demand = |what, needed, allowed, unit| Demand { what, needed, allowed, unit };
        let demands = [
            demand("learning.input_max_m", peaks.value, learning.input_max_m, "m"),
            demand("limits.velocity_max_m_s", peaks.rate, limits.velocity_max_m_s, "m/s"),
            demand(
                "limits.acceleration_max_m_s2",
                peaks.curvature,
                limits.acceleration_max_m_s2,
                "m/s^2",
            ),
        ];
        (peaks.value, demands)
    }
}

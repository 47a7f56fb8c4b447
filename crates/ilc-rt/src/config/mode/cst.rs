//! Cyclic synchronous torque: the whole cascade is in the controller; the learned input is added to
//! its force.

use std::f64::consts::TAU;

use super::super::{Axis, AxisModel, CascadeControl, InputKind};
use super::{AxisProgram, ModeDesign};
use crate::control::{Cascade, CascadeGains, CascadeReference};
use crate::model::{Method, ModelError, StateSpace, discretize, from_transfer_function};

pub(super) struct Cst;

impl ModeDesign for Cst {
    fn model_keys(&self, _model: &AxisModel) -> Vec<(&'static str, Option<f64>)> {
        Vec::new()
    }

    fn closes_position_loop(&self) -> bool {
        true
    }

    fn needs_cascade(&self) -> bool {
        true
    }

    /// `G / (1 + z^-1 C G)` with `G = 1 / (s (m s + b))` and a zero-order hold. The measurement of the
    /// controller is one cycle old, and its velocity a filtered difference:
    /// `C = kp (1 + T/Tn z^-1 / (1 - z^-1)) (kv + (1 - z^-1)/T p / (1 - (1 - p) z^-1))`.
    fn nominal_model(
        &self,
        axis: &Axis,
        _input: InputKind,
        cycle_s: f64,
    ) -> Result<StateSpace, ModelError> {
        let (mass_kg, viscous) =
            axis.force.map_or((1.0, 0.0), |force| (force.mass_kg, force.viscous_n_s_m));
        let plant = from_transfer_function(&[1.0], &[mass_kg, viscous, 0.0], None)?;
        discretize(&plant, cycle_s, Method::ZeroOrderHold)?
            .delayed(axis.model.unwrap_or_default().delay_samples as usize)?
            .feedback(&feedback(&control(axis), cycle_s)?.delayed(1)?)
    }

    /// The force of the cascade for an axis that does not move: the loop is linear.
    fn feed(&self, axis: &Axis, program: &AxisProgram) -> Vec<(InputKind, Vec<f64>)> {
        let gains = CascadeGains {
            velocity_max_m_s: f64::INFINITY,
            force_max_n: f64::INFINITY,
            ..cascade_gains(axis)
        };
        let mut cascade = Cascade::new(gains, program.cycle_s);
        let viscous_n_s_m = axis.force.map_or(0.0, |force| force.viscous_n_s_m)
            * axis.feedforward.map_or(0.0, |forward| forward.friction);
        let ahead_m = program.ahead_m(axis);
        let force = (0..program.way_m.len()).map(|k| {
            let reference = CascadeReference {
                position_m: ahead_m[k],
                velocity_m_s: program.velocity_m_s[k],
                acceleration_m_s2: program.acceleration_m_s2[k],
            };
            cascade.step(reference, 0.0, 0.0, viscous_n_s_m * program.velocity_m_s[k]).value
        });
        vec![(InputKind::Torque, force.collect())]
    }

    fn integral_time_s(&self, axis: &Axis) -> Option<f64> {
        control(axis).integral_time_s
    }

    fn travel(&self, axis: &Axis, _input: InputKind) -> f64 {
        let control = control(axis);
        1.0 / (control.position_gain_per_s * control.velocity_gain_n_s_m)
    }

    /// `kv` and the velocity loop make a second-order loop with `w0^2 = kv kp / m`.
    fn natural_frequency_hz(&self, axis: &Axis) -> f64 {
        let mass_kg = axis.force.map_or(1.0, |force| force.mass_kg);
        (1.0 / (self.travel(axis, InputKind::Torque) * mass_kg)).sqrt() / TAU
    }

    /// The gains are known: only the mass may be another one, `w0^2 = kv kp / m`.
    fn perturbed(&self, axis: &Axis, frequency: f64, _damping: f64) -> Axis {
        let mut other = axis.clone();
        if let Some(force) = &mut other.force {
            force.mass_kg /= frequency * frequency;
        }
        other
    }
}

/// Returns the gains of the cascade of an axis, with its limits; those of an idle one if it has none.
pub(crate) fn cascade_gains(axis: &Axis) -> CascadeGains {
    let control = control(axis);
    let forward = axis.feedforward.unwrap_or_default();
    CascadeGains {
        position_gain_per_s: control.position_gain_per_s,
        velocity_gain_n_s_m: control.velocity_gain_n_s_m,
        integral_time_s: control.integral_time_s.unwrap_or(f64::INFINITY),
        velocity_feedforward: forward.velocity,
        acceleration_feedforward_kg: axis
            .force
            .map_or(0.0, |force| force.mass_kg * forward.acceleration),
        velocity_max_m_s: axis.limits.velocity_max_m_s,
        force_max_n: axis.force.map_or(0.0, |force| force.max_n()),
    }
}

fn control(axis: &Axis) -> CascadeControl {
    axis.cascade.unwrap_or(CascadeControl {
        position_gain_per_s: 1.0,
        velocity_gain_n_s_m: 1.0,
        integral_time_s: None,
        velocity_filter_hz: None,
    })
}

/// Returns the controller from the measured position to the force against it.
fn feedback(control: &CascadeControl, cycle_s: f64) -> Result<StateSpace, ModelError> {
    let (share, kv) = (control.velocity_share(cycle_s), control.position_gain_per_s);
    // kv + share/T (z - 1) / (z - 1 + share), over the common denominator.
    let rate = share / cycle_s;
    let (first, second) = (kv + rate, -kv * (1.0 - share) - rate);
    let gain = control.velocity_gain_n_s_m;
    let (numerator, denominator) = match control.integral_time_s {
        None => (vec![gain * first, gain * second], vec![1.0, share - 1.0]),
        Some(time_s) => {
            let zero = cycle_s / time_s - 1.0;
            (
                vec![gain * first, gain * (second + zero * first), gain * zero * second],
                vec![1.0, share - 2.0, 1.0 - share],
            )
        }
    };
    from_transfer_function(&numerator, &denominator, Some(cycle_s))
}

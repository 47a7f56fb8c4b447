//! Experiment of an identification: one axis is excited around a point while all others hold still.

use serde_json::json;

use super::error::IdentificationError;
use crate::config::mode::{self, Demand, Peaks};
use crate::config::{Axis, Cell, InputKind, Measure};
use crate::design::{DesignError, Plan, input_unit};
use crate::model::ModelError;
use crate::model::identify::{Excitation, ExcitationSignal};
use crate::trajectory::Interpolator;

/// Name of the law in the records of experiments.
pub(crate) const LAW_NAME: &str = "excitation";
/// Default amplitude as a share of the largest possible one.
const AMPLITUDE_SHARE: f64 = 0.5;
/// Likewise of a torque, of which friction takes its part whatever the amplitude is.
const TORQUE_SHARE: f64 = 0.9;

/// An experiment with one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Name of the axis.
    pub axis: String,
    /// The excitation, in m (csp) or m/s (csv).
    pub excitation: Excitation,
    /// Position that the axis is excited around; the program's start if `None`.
    pub at_m: Option<f64>,
}

/// Signals of a completed experiment.
///
/// # Shapes
/// - both: `n_samples` x `n_axes`, time first
#[derive(Debug, Clone, PartialEq)]
pub struct Signals {
    /// Learned input.
    pub input: Vec<f64>,
    /// Error of the measurement; the set point rests.
    pub error_m: Vec<f64>,
}

/// A planned experiment.
pub(crate) struct Planned {
    /// The plan whose program is a hold.
    pub(crate) plan: Plan,
    /// Input table, `n_samples * n_axes`.
    pub(crate) input: Vec<f64>,
}

impl Experiment {
    /// Returns the experiment with half the largest amplitude that the limits of the axis allow; with 90 % of it for
    /// a torque.
    ///
    /// # Errors
    /// [`IdentificationError::Experiment`] or [`IdentificationError::Model`] for an experiment that
    /// no amplitude makes possible.
    pub fn with_default_amplitude(mut self, cell: &Cell) -> Result<Self, IdentificationError> {
        // All limited quantities are proportional to the amplitude, so one try gives the largest
        // one.
        self.excitation.amplitude = 1e-6;
        let (index, axis) = self.axis(cell)?;
        let signal = self.signal(cell)?;
        let tightest = self
            .demands(cell, index, axis, &signal)
            .iter()
            .map(Demand::margin)
            .fold(f64::INFINITY, f64::min);
        let is_torque = axis.input_kind() == InputKind::Torque;
        self.excitation.amplitude *=
            tightest * if is_torque { TORQUE_SHARE } else { AMPLITUDE_SHARE };
        if self.excitation.amplitude.is_nan() || self.excitation.amplitude <= 0.0 {
            return Err(self.refused(cell, "amplitude", "0", "the limits leave no room at all"));
        }
        Ok(self)
    }

    /// Compares what the excitation demands with the limits of the axis.
    ///
    /// # Errors
    /// [`IdentificationError::Experiment`] with the most exceeded limit, and the largest possible
    /// amplitude.
    pub fn check(&self, cell: &Cell) -> Result<(), IdentificationError> {
        let (index, axis) = self.axis(cell)?;
        let signal = self.signal(cell)?;
        let demands = self.demands(cell, index, axis, &signal);
        let tightest = demands.iter().min_by(|a, b| a.margin().total_cmp(&b.margin()));
        if let Some(demand) = tightest.filter(|demand| demand.margin() < 1.0) {
            let Demand { what, needed, allowed, unit } = demand;
            let largest = self.excitation.amplitude * demand.margin();
            let input = input_unit(axis);
            return Err(self.refused(
                cell,
                &format!("amplitude {} {input}: {what}", self.excitation.amplitude),
                &format!("{needed:.6} {unit}"),
                &format!(
                    "at most {allowed:.6} {unit}, which is an amplitude of {largest:.6e} {input}"
                ),
            ));
        }
        Ok(())
    }

    /// Plans the experiment, within the limits of the axis.
    pub(crate) fn plan(
        &self,
        cell: &Cell,
        measure: Option<Measure>,
        lockstep: bool,
    ) -> Result<Planned, IdentificationError> {
        self.check(cell)?;
        let (index, _) = self.axis(cell)?;
        let signal = self.signal(cell)?;
        let mut cell = cell.clone();
        cell.program.start_m[index] = self.center_m(&cell, index);
        let n_samples = signal.values.len();
        let hold = Interpolator::hold(&cell.program.start_m, n_samples, cell.cycle_s()).map_err(
            |source| DesignError::Program {
                file: cell.file.display().to_string(),
                key: "[program] start_m".to_owned(),
                source: Box::new(source),
                units: cell.units(),
            },
        )?;
        let program = json!({ "hold_m": cell.program.start_m, "n_samples": n_samples });
        let mut plan = Plan::with(&cell, measure, lockstep, hold, program.to_string())?;
        let parameters = self.parameters(&signal);
        plan.name_law(&cell, LAW_NAME, &parameters, &parameters);
        let n_axes = cell.n_axes();
        let mut input = vec![0.0; n_samples * n_axes];
        for (row, value) in input.chunks_exact_mut(n_axes).zip(&signal.values) {
            row[index] = *value;
        }
        Ok(Planned { plan, input })
    }

    /// Returns the index and the description of the axis.
    pub(crate) fn axis<'a>(
        &self,
        cell: &'a Cell,
    ) -> Result<(usize, &'a Axis), IdentificationError> {
        let found = cell.axes.iter().enumerate().find(|(_, axis)| axis.name == self.axis);
        found.ok_or_else(|| {
            let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
            self.refused(cell, "name", &self.axis, &format!("this cell has {}", names.join(", ")))
        })
    }

    /// Returns the unit of the input and of the amplitude.
    pub fn input_unit(&self, cell: &Cell) -> &'static str {
        self.axis(cell).map_or("", |(_, axis)| input_unit(axis))
    }

    /// Samples the excitation at the servo cycle.
    pub(crate) fn signal(&self, cell: &Cell) -> Result<ExcitationSignal, IdentificationError> {
        self.excitation.signal(cell.cycle_s()).map_err(|source| {
            if let ModelError::Parameter { what, value, allowed } = source {
                return self.refused(cell, what, &value.to_string(), allowed);
            }
            IdentificationError::Model { file: cell.file.display().to_string(), source }
        })
    }

    fn center_m(&self, cell: &Cell, index: usize) -> f64 {
        self.at_m.unwrap_or_else(|| cell.program.start_m[index])
    }

    /// Returns the demands of the excitation on the axis, with their limits.
    fn demands(
        &self,
        cell: &Cell,
        index: usize,
        axis: &Axis,
        signal: &ExcitationSignal,
    ) -> Vec<Demand> {
        let (u, dt_s) = (&signal.values, cell.cycle_s());
        let max =
            |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |m: f64, v| m.max(v.abs()));
        let peak = max(&mut u.iter().copied());
        let rate = max(&mut u.windows(2).map(|w| (w[1] - w[0]) / dt_s));
        let curve = max(&mut u.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]) / (dt_s * dt_s)));
        let (limits, center_m) = (&axis.limits, self.center_m(cell, index));
        let margin_m =
            (center_m - limits.position_min_m).min(limits.position_max_m - center_m).max(0.0);
        let peaks = Peaks { value: peak, rate, curvature: curve };
        let (travel_m, demands) = mode::demands(axis, &cell.learning, peaks);
        let demand = |what, needed, allowed, unit| Demand { what, needed, allowed, unit };
        let mut demands = demands.to_vec();
        demands.push(demand(
            "limits.following_error_max_m",
            travel_m,
            limits.following_error_max_m,
            "m",
        ));
        demands.push(demand("way to the end of the axis", travel_m, margin_m, "m"));
        demands
    }

    /// Returns the experiment as JSON, for its record.
    fn parameters(&self, signal: &ExcitationSignal) -> String {
        let mut parameters = json!(self.excitation);
        parameters["axis"] = json!(self.axis);
        parameters["first_sample"] = json!(signal.first_sample);
        parameters["period_samples"] = json!(signal.period_samples);
        parameters.to_string()
    }

    pub(crate) fn refused(
        &self,
        cell: &Cell,
        what: &str,
        value: &str,
        allowed: &str,
    ) -> IdentificationError {
        IdentificationError::Experiment {
            file: cell.file.display().to_string(),
            axis: self.axis.clone(),
            what: what.to_owned(),
            value: value.to_owned(),
            allowed: allowed.to_owned(),
        }
    }
}

//! `[learning.norm_optimal]`: the weights of the quadratic cost, by direction and along the run.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Cost, NormOptimal};
use crate::learning::law::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff, violation,
};
use crate::learning::weights::{Contour, ContourTerms, Gain, Schedule, Weight};
use crate::learning::{Law, Result};
use crate::schema::{Violation, field_order};

/// `[learning.norm_optimal]`: weights of the quadratic cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct NormOptimalParameters {
    /// Weight of the next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Weight of the rate of the change of input: restricts learning to frequencies where the model
    /// is valid. Its product with the cycle counts: halve the cycle, double `rate`.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rate: f64,
    /// Weights of the error by its direction.
    pub contour: Option<ContourParameters>,
    /// Other weights for part of the run, in the order of time and without overlap.
    #[serde(rename = "phase")]
    pub phases: Vec<PhaseParameters>,
    /// Bandwidth of the transition of weights between phases, 0.001 to 0.95 of the Nyquist
    /// frequency; a transition takes about 0.34 / `smoothing_hz` seconds.
    pub smoothing_hz: f64,
}

impl Default for NormOptimalParameters {
    fn default() -> Self {
        Self {
            q: 1.0,
            s: 0.0,
            r: 0.0,
            rate: 0.0,
            contour: None,
            phases: Vec::new(),
            smoothing_hz: 10.0,
        }
    }
}

/// `[learning.norm_optimal.contour]`: `Q = q I + weight (I - t t') + along t t'`, t the tangent of
/// the program's path at each sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ContourParameters {
    /// Weight of the error normal to the path.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub weight: f64,
    /// Weight of the error along the path.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub along: f64,
    /// Names of the two or three axes that form the path; all axes of the cell by default.
    pub axes: Vec<String>,
}

impl Default for ContourParameters {
    fn default() -> Self {
        Self { weight: 1.0, along: 0.0, axes: Vec::new() }
    }
}

/// `[[learning.norm_optimal.phase]]`: weights for part of the run; those not given here keep their
/// outer values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PhaseParameters {
    /// Start time, from the start of the run.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub from_s: f64,
    /// End time, from the start of the run; at least a cycle after `from_s`.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub to_s: f64,
    /// Weight of the next error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: Option<f64>,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: Option<f64>,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: Option<f64>,
    /// Weight of the error normal to the path; only with `contour` in `[learning.norm_optimal]`.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub contour: Option<f64>,
}

impl LawParameters for NormOptimalParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        let smoothing_hz = Some(self.smoothing_hz);
        check_cutoff("[learning.norm_optimal] smoothing_hz", smoothing_hz, cell)?;
        if let Some(contour) = &self.contour {
            contour.check(cell)?;
        }
        let mut before_s = 0.0;
        for (number, phase) in self.phases.iter().enumerate() {
            let refused = |name: &str, value: &str, allowed: String| {
                let key = format!("[[learning.norm_optimal.phase]] {} {name}", number + 1);
                Err(violation(&key, value, allowed))
            };
            let (from_s, to_s) = (phase.from_s, phase.to_s);
            if from_s < before_s {
                let allowed = format!("at least {before_s}, where the phase before ends");
                return refused("from_s", &from_s.to_string(), allowed);
            }
            if to_s < from_s + cell.cycle_s {
                let allowed = format!("at least one cycle after from_s = {from_s}");
                return refused("to_s", &to_s.to_string(), allowed);
            }
            before_s = to_s;
            if phase.contour.is_some() && self.contour.is_none() {
                let allowed = "only with [learning.norm_optimal.contour]".to_owned();
                return refused("contour", "given", allowed);
            }
        }
        Ok(())
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let cost = self.cost(context)?;
        Ok(Box::new(NormOptimal::new(context.model, context.n_samples(), cost)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example {
                is_parallel: false,
                learning: "law = \"norm_optimal\"\n[learning.norm_optimal]\nrate = 6.0",
                error_left: 0.1,
            },
            Example {
                is_parallel: false,
                learning: "law = \"norm_optimal\"\n[learning.norm_optimal]\nrate = 16.0\n\
                           contour = { weight = 5.0, along = 0.5 }\n\
                           [[learning.norm_optimal.phase]]\nfrom_s = 0.2\nto_s = 0.5\nq = 2.0\n\
                           contour = 6.0",
                error_left: 0.1,
            },
        ]
    }
}

impl ContourParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        let key = "[learning.norm_optimal.contour] axes";
        for (place, name) in self.axes.iter().enumerate() {
            let known = cell.axes.iter().any(|axis| axis.name == *name);
            if !known || self.axes[..place].contains(name) {
                return Err(violation(key, name, "names of axes of this cell, each once"));
            }
        }
        let count = if self.axes.is_empty() { cell.axes.len() } else { self.axes.len() };
        if (2..=3).contains(&count) {
            return Ok(());
        }
        let allowed = "the 2 or 3 axes that make the path (all axes if the list is empty)";
        Err(violation(key, format!("{:?}", self.axes), allowed))
    }
}

impl NormOptimalParameters {
    /// Returns the cost for the set points of a run.
    ///
    /// `Q_k = q_k I + c_k (I - t_k t_k') + along t_k t_k'`, `t_k` the tangent of the path; a
    /// Gaussian filter smooths `q`, `s`, `r` and `c` between phases.
    ///
    /// # Errors
    /// - [`BuildError::Refused`] for a phase that begins after the end of the run;
    ///   [`BuildError::Learning`] for weights that do not match the path.
    pub fn cost(&self, context: &LawContext) -> Result<Cost, BuildError> {
        let cycle_s = context.cell.cycle_s;
        let run = Run { phases: &self.phases, n_samples: context.n_samples(), cycle_s };
        run.check_phases()?;
        let along = |base: f64, pick: fn(&PhaseParameters) -> Option<f64>| {
            run.along(base, pick, self.smoothing_hz)
        };
        let weight = |base: f64, pick: fn(&PhaseParameters) -> Option<f64>| {
            along(base, pick).map(|found| found.map_or(Weight::Scalar(base), Weight::PerSample))
        };
        let mut q = weight(self.q, |phase| phase.q)?;
        if let Some(contour) = &self.contour {
            let named = |name: &str| contour.axes.iter().any(|axis| axis == name);
            let axes: Vec<usize> = (0..context.n_axes())
                .filter(|i| contour.axes.is_empty() || named(context.cell.axes[*i].name))
                .collect();
            let across = along(contour.weight, |phase| phase.contour)?
                .map_or(Gain::Constant(contour.weight), Gain::PerSample);
            let terms = ContourTerms { q, contour: across, along: contour.along.into() };
            let path = Contour::of_axes(context.reference_m, context.n_axes(), &axes)?;
            q = path.weight(&terms)?;
        }
        let (s, r) = (weight(self.s, |phase| phase.s)?, weight(self.r, |phase| phase.r)?);
        Ok(Cost { q, s, r, rate: self.rate })
    }
}

/// The phases of a run.
struct Run<'a> {
    phases: &'a [PhaseParameters],
    n_samples: usize,
    cycle_s: f64,
}

impl Run<'_> {
    fn sample(&self, time_s: f64) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked to be from 0 to 1e5 s"
        )]
        let sample = (time_s / self.cycle_s).round() as usize;
        sample
    }

    /// Refuses a phase that begins after the end of the run.
    fn check_phases(&self) -> Result<(), Violation> {
        for (number, phase) in self.phases.iter().enumerate() {
            if self.sample(phase.from_s) >= self.n_samples {
                let key = format!("[[learning.norm_optimal.phase]] {} from_s", number + 1);
                let run_s = self.n_samples as f64 * self.cycle_s;
                let allowed = format!("below {run_s:.3}, as long as a run is");
                return Err(violation(&key, phase.from_s, allowed));
            }
        }
        Ok(())
    }

    /// Returns a weight at each sample; `None` if no phase changes it.
    fn along(
        &self,
        base: f64,
        pick: fn(&PhaseParameters) -> Option<f64>,
        smoothing_hz: f64,
    ) -> Result<Option<Vec<f64>>> {
        let mut segments = vec![(0, base)];
        for phase in self.phases {
            let Some(value) = pick(phase) else { continue };
            for (start, value) in
                [(self.sample(phase.from_s), value), (self.sample(phase.to_s), base)]
            {
                match segments.last_mut() {
                    Some(last) if last.0 == start => last.1 = value,
                    _ if start < self.n_samples => segments.push((start, value)),
                    _ => {}
                }
            }
        }
        if segments.len() == 1 && segments[0].1.to_bits() == base.to_bits() {
            return Ok(None);
        }
        let schedule = Schedule::new(&segments)?;
        let smooth = schedule.smoothed(smoothing_hz, self.cycle_s)?;
        smooth.samples(self.n_samples).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::law::LawAxis;
    use crate::learning::law::LawName;
    use crate::learning::law::context::LawTables;
    use crate::model::StateSpace;

    #[derive(Debug)]
    struct NoTables;

    impl LawTables for NoTables {
        fn parameters(&self, _: LawName) -> Option<&dyn LawParameters> {
            None
        }
    }

    fn cost(text: &str) -> Result<Cost, String> {
        let axis = |name| LawAxis {
            name,
            input: crate::fieldbus::cia402::InputKind::Position,
            input_max: 1.0,
            position_min: -1.0,
            position_max: 1.0,
            velocity_max: 1.0,
            acceleration_max: 1.0,
        };
        let cell = LawCell { axes: vec![axis("x"), axis("y")], cycle_s: 2e-3, tables: &NoTables };
        let model = StateSpace::static_gain(nalgebra::DMatrix::identity(2, 2), Some(2e-3)).unwrap();
        // A straight line at 45 degrees, 1 s of it.
        let path: Vec<f64> = (0..1000).map(|i| f64::from(i / 2) * 1e-4).collect();
        let parameters: NormOptimalParameters = toml::from_str(text).unwrap();
        let context = LawContext { cell: &cell, model: &model, reference_m: &path };
        parameters.cost(&context).map_err(|error| error.to_string())
    }

    #[test]
    fn without_contour_and_phases_the_weights_are_four_numbers() {
        let plain = cost("rate = 6.0").unwrap();
        assert_eq!(plain.scalars().map(|w| (w.q, w.s, w.r, w.rate)), Some((1.0, 0.0, 0.0, 6.0)));
    }

    #[test]
    fn a_contour_weight_counts_across_the_path_only() {
        let cost = cost("contour = { weight = 8.0 }").unwrap();
        let q = cost.q.at(200, 2);
        // q I + 8 (I - t t') with t = (1, 1) / sqrt 2.
        for (found, expected) in q.iter().zip([5.0, -4.0, -4.0, 5.0]) {
            assert!((found - expected).abs() < 1e-12, "{q}");
        }
    }

    #[test]
    fn a_phase_holds_between_its_times_and_goes_over_smoothly() {
        let cost = cost("[[phase]]\nfrom_s = 0.4\nto_s = 0.6\nq = 5.0\nr = 2.0\n").unwrap();
        let q = |k: usize| cost.q.entry(k, 0, 0);
        assert!(
            (q(50) - 1.0).abs() < 1e-9
                && (q(250) - 5.0).abs() < 1e-9
                && (q(450) - 1.0).abs() < 1e-9
        );
        // Half-way at the boundary, without a step anywhere.
        assert!((0.5 * (q(199) + q(200)) - 3.0).abs() < 1e-9, "{}", q(200));
        assert!((1..500).all(|k| (q(k) - q(k - 1)).abs() < 0.3));
        assert!((cost.r.entry(250, 1, 1) - 2.0).abs() < 1e-9);
        assert!(cost.s.is_constant());
    }

    #[test]
    fn a_phase_beyond_the_run_is_named() {
        let line = cost("[[phase]]\nfrom_s = 1.0\nto_s = 2.0\nq = 5.0\n").unwrap_err();
        for part in ["[[learning.norm_optimal.phase]] 1 from_s = 1", "below 1.000"] {
            assert!(line.contains(part), "{line}");
        }
    }
}

//! The weights of `[learning.norm_optimal]` at each sample: across the path, and from phase to phase.
//!
//! `law` makes the law of them.

use super::error::DesignError;
use crate::config::{Cell, ConfigError, NormOptimalSection, PhaseSection};
use crate::learning::LearningError;
use crate::learning::law::norm_optimal::Cost;
use crate::learning::weights::{Contour, ContourTerms, Gain, Schedule, Weight};

/// Returns the cost of `[learning.norm_optimal]` for the set points of a run.
///
/// `Q_k = q_k I + c_k (I - t_k t_k') + along t_k t_k'`, `t_k` the direction of the path; `q`, `s`, `r`
/// and `c` go over from phase to phase through a Gaussian filter.
pub(super) fn norm_optimal_cost(cell: &Cell, reference_m: &[f64]) -> Result<Cost, DesignError> {
    let section = &cell.learning.norm_optimal;
    let n_samples = reference_m.len() / cell.n_axes();
    let run = Run { cell, section, n_samples };
    run.check_phases()?;
    let weight = |base: f64, pick: fn(&PhaseSection) -> Option<f64>| {
        run.along(base, pick).map(|found| found.map_or(Weight::Scalar(base), Weight::PerSample))
    };
    let refused = |source| DesignError::Learning { file: run.file(), source };
    let build = || -> Result<Cost, LearningError> {
        let mut q = weight(section.q, |phase| phase.q)?;
        if let Some(contour) = &section.contour {
            let axes: Vec<usize> = (0..cell.n_axes())
                .filter(|i| contour.axes.is_empty() || contour.axes.contains(&cell.axes[*i].name))
                .collect();
            let across = run
                .along(contour.weight, |phase| phase.contour)?
                .map_or(Gain::Constant(contour.weight), Gain::PerSample);
            let terms = ContourTerms { q, contour: across, along: contour.along.into() };
            q = Contour::of_axes(reference_m, cell.n_axes(), &axes)?.weight(&terms)?;
        }
        let (s, r) = (weight(section.s, |phase| phase.s)?, weight(section.r, |phase| phase.r)?);
        Ok(Cost { q, s, r, rate: section.rate })
    };
    build().map_err(refused)
}

/// The phases of a run.
struct Run<'a> {
    cell: &'a Cell,
    section: &'a NormOptimalSection,
    n_samples: usize,
}

impl Run<'_> {
    fn file(&self) -> String {
        self.cell.file.display().to_string()
    }

    fn sample(&self, time_s: f64) -> usize {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked to be from 0 to 1e5 s"
        )]
        let sample = (time_s / self.cell.cycle_s()).round() as usize;
        sample
    }

    /// Refuses a phase that begins after the end of the run.
    fn check_phases(&self) -> Result<(), ConfigError> {
        for (number, phase) in self.section.phases.iter().enumerate() {
            if self.sample(phase.from_s) >= self.n_samples {
                let run_s = self.n_samples as f64 * self.cell.cycle_s();
                return Err(ConfigError::Value {
                    file: self.file(),
                    key: format!("[[learning.norm_optimal.phase]] {} from_s", number + 1),
                    value: phase.from_s.to_string(),
                    allowed: format!("below {run_s:.3}, as long as a run is"),
                });
            }
        }
        Ok(())
    }

    /// Returns a weight at each sample; `None` if no phase changes it.
    fn along(
        &self,
        base: f64,
        pick: fn(&PhaseSection) -> Option<f64>,
    ) -> Result<Option<Vec<f64>>, LearningError> {
        let mut segments = vec![(0, base)];
        for phase in &self.section.phases {
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
        let smooth = schedule.smoothed(self.section.smoothing_hz, self.cell.cycle_s())?;
        smooth.samples(self.n_samples).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GANTRY: &str =
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_gantry.toml"));

    fn cost(tail: &str) -> Result<Cost, String> {
        let cell = Cell::parse(&format!("{GANTRY}\n{tail}"), "cell.toml").unwrap();
        // A straight line at 45 degrees, 1 s of it.
        let path: Vec<f64> = (0..1000).map(|i| f64::from(i / 2) * 1e-4).collect();
        norm_optimal_cost(&cell, &path).map_err(|error| error.to_string())
    }

    #[test]
    fn without_contour_and_phases_the_weights_are_four_numbers() {
        let plain = cost("").unwrap();
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
        let phase = "[[learning.norm_optimal.phase]]\nfrom_s = 0.4\nto_s = 0.6\nq = 5.0\nr = 2.0\n";
        let cost = cost(phase).unwrap();
        let q = |k: usize| cost.q.entry(k, 0, 0);
        assert!(
            (q(50) - 1.0).abs() < 1e-9
                && (q(250) - 5.0).abs() < 1e-9
                && (q(450) - 1.0).abs() < 1e-9
        );
        // Half-way at the boundary, and nowhere a step.
        assert!((0.5 * (q(199) + q(200)) - 3.0).abs() < 1e-9, "{}", q(200));
        assert!((1..500).all(|k| (q(k) - q(k - 1)).abs() < 0.3));
        assert!((cost.r.entry(250, 1, 1) - 2.0).abs() < 1e-9);
        assert!(cost.s.is_constant());
    }

    #[test]
    fn a_phase_beyond_the_run_is_named() {
        let phase = "[[learning.norm_optimal.phase]]\nfrom_s = 1.0\nto_s = 2.0\nq = 5.0\n";
        let line = cost(phase).unwrap_err();
        for part in ["cell.toml", "[[learning.norm_optimal.phase]] 1 from_s = 1", "below 1.000"] {
            assert!(line.contains(part), "{line}");
        }
    }
}

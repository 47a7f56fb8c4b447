//! Flexible ILC: a table of learned inputs over the disturbance, with interpolation.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawName;
use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, check_core};
use super::expectation::{Expectation, check as check_disturbance};
use super::inputs::Inputs;
use crate::learning::error::{check, check_learns_from_every_run};
use crate::learning::{Law, LearningError, Result, Surrogate};
use crate::schema::{Violation, field_order};

/// `[learning.flexible]`: the core law and the resolution of the table.
///
/// The runs of this cell, program and measurement in the library are entered at the start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct FlexibleParameters {
    /// The law that proposes an input after each run, with the parameters of its own table.
    pub core: LawName,
    /// Number of disturbances of a run, e.g. temperatures.
    #[schemars(range(min = 0, max = 7))]
    pub disturbances: usize,
    /// Distance up to which two disturbances are the same entry of the table.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub tolerance: f64,
}

impl Default for FlexibleParameters {
    fn default() -> Self {
        Self { core: LawName::NormOptimal, disturbances: 1, tolerance: 0.0 }
    }
}

impl LawParameters for FlexibleParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_core("[learning.flexible] core", self.core, cell)
    }

    fn core(&self) -> Option<LawName> {
        Some(self.core)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let shape = TableShape {
            n_samples: context.n_samples(),
            n_inputs: context.n_axes(),
            n_outputs: context.n_axes(),
            n_disturbances: self.disturbances,
            tolerance: self.tolerance,
        };
        Ok(Box::new(Flexible::new(context.core(self.core)?, shape)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"flexible\"\n[learning.flexible]\ntolerance = 0.5\n\
                       [learning.norm_optimal]\nrate = 6.0",
            error_left: 0.1,
        }]
    }
}

/// Size and resolution of the table of a [`Flexible`] law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableShape {
    /// Samples of a run.
    pub n_samples: usize,
    /// Channels of the input.
    pub n_inputs: usize,
    /// Channels of the error.
    pub n_outputs: usize,
    /// Number of disturbances of a run.
    pub n_disturbances: usize,
    /// Distance up to which two disturbances are the same entry of the table.
    pub tolerance: f64,
}

/// Flexible ILC: one input for each disturbance met, interpolated between the nearest two.
///
/// `u_i = (1 - t) p_a + t p_b`, `t = (d - d_a)(d_b - d_a) / |d_b - d_a|^2`, at most 1
///
/// For each disturbance a table holds the core law's proposal after the last run under it; a core
/// that inverts the model (norm-optimal without `s` and `r`) makes these the optimal inputs. `a` is
/// the entry nearest to the coming disturbance `d`, `b` the nearest one on the other side of `d`
/// (for more than one disturbance: among those with `(d - d_a)(d_b - d_a) > 0`). Beyond the table
/// the nearest entry is used: there is no extrapolation. Unlike
/// [`Relevance`](super::relevance::Relevance) it uses two runs only, whatever their errors.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`; disturbance:
///   `n_disturbances`
/// # Real Time
/// Cold path. `O(n_samples + n_entries)`. An update allocates when the table grows: a block of
/// about a megabyte at a time.
/// # Source
/// - \[hoelzle2012\] as described in \[dimarco2016\], Sec. 3.2: tabulated disturbances, plant
///   inversion, interpolation between the nearest two. The mapping from disturbance to plant, known
///   in the original, is left to the core law.
pub struct Flexible {
    core: Box<dyn Law>,
    shape: TableShape,
    told: Expectation,
    disturbances: Vec<f64>,
    inputs: Inputs,
    proposal: Vec<f64>,
}

impl Flexible {
    /// Creates the law around a core law, with an empty table.
    ///
    /// # Errors
    /// - [`LearningError::Empty`] for 0 samples or channels.
    /// - [`LearningError::Parameter`] for a tolerance that is negative or not finite.
    /// - [`LearningError::Measures`] for a core law that makes runs which only measure.
    pub fn new(core: Box<dyn Law>, shape: TableShape) -> Result<Self> {
        check_learns_from_every_run("flexible", &core)?;
        let TableShape { n_samples, n_inputs, n_outputs, n_disturbances, tolerance } = shape;
        for (what, count) in
            [("n_samples", n_samples), ("n_inputs", n_inputs), ("n_outputs", n_outputs)]
        {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        if !(tolerance.is_finite() && tolerance >= 0.0) {
            let allowed = "a tolerance must be finite and not negative";
            return Err(LearningError::Parameter { what: "tolerance", value: tolerance, allowed });
        }
        let length = n_samples * n_inputs;
        Ok(Self {
            core,
            shape,
            told: Expectation::new(n_disturbances),
            disturbances: Vec::new(),
            inputs: Inputs::new(length),
            proposal: vec![0.0; length],
        })
    }

    /// Returns the number of disturbances in the table.
    pub fn len(&self) -> usize {
        self.inputs.len()
    }

    /// Returns true if the table is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Enters an earlier run, or one made elsewhere, into the table.
    ///
    /// # Errors
    /// - [`LearningError::Length`], [`LearningError::NotFinite`], [`LearningError::Disturbance`],
    ///   or any error of the core law.
    pub fn remember(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result {
        check_disturbance(disturbance, self.shape.n_disturbances)?;
        self.propose(input, error)?;
        self.enter(disturbance);
        Ok(())
    }

    fn propose(&mut self, input: &[f64], error: &[f64]) -> Result {
        let TableShape { n_samples, n_inputs, n_outputs, .. } = self.shape;
        check("input", input, n_samples, n_inputs)?;
        check("error", error, n_samples, n_outputs)?;
        self.core.update(input, error, &mut self.proposal)?;
        check("next", &self.proposal, n_samples, n_inputs)
    }

    fn entry(&self, number: usize) -> &[f64] {
        let width = self.shape.n_disturbances;
        &self.disturbances[number * width..][..width]
    }

    /// Stores the proposal for its disturbance.
    fn enter(&mut self, disturbance: &[f64]) {
        let nearest = self.nearest(disturbance);
        let reach = self.shape.tolerance * self.shape.tolerance;
        let met = nearest.filter(|&number| distance(self.entry(number), disturbance) <= reach);
        if let Some(number) = met {
            self.inputs.replace(number, &self.proposal);
        } else {
            self.inputs.push(&self.proposal);
            self.disturbances.extend_from_slice(disturbance);
        }
    }

    /// Returns the entry nearest to a disturbance; of equally near ones the older.
    fn nearest(&self, disturbance: &[f64]) -> Option<usize> {
        let of = |number: usize| distance(self.entry(number), disturbance);
        (0..self.len()).min_by(|&a, &b| of(a).total_cmp(&of(b)))
    }

    /// Writes the input of the table for a disturbance; false if the table is empty.
    fn look_up(&self, disturbance: &[f64], next: &mut [f64]) -> bool {
        let Some(a) = self.nearest(disturbance) else { return false };
        next.copy_from_slice(self.inputs.row(a));
        if let Some((b, share)) = self.beyond(a, disturbance) {
            for (next, towards) in next.iter_mut().zip(self.inputs.row(b)) {
                *next += share * (towards - *next);
            }
        }
        true
    }

    /// Returns the nearest entry on the other side of a disturbance than `a`, and the interpolation
    /// factor.
    fn beyond(&self, a: usize, disturbance: &[f64]) -> Option<(usize, f64)> {
        let from = self.entry(a);
        let share = |number: usize| {
            let to = self.entry(number);
            let along: f64 =
                from.iter().zip(to).zip(disturbance).map(|((a, b), d)| (b - a) * (d - a)).sum();
            along / distance(from, to)
        };
        let of = |number: usize| distance(self.entry(number), disturbance);
        (0..self.len())
            .filter(|&number| number != a && share(number) > 0.0)
            .min_by(|&a, &b| of(a).total_cmp(&of(b)))
            .map(|number| (number, share(number).min(1.0)))
    }
}

/// Returns the squared distance of two disturbances.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

impl Law for Flexible {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let TableShape { n_samples, n_inputs, .. } = self.shape;
        if next.len() != n_samples * n_inputs {
            let (what, found, n_channels) = ("next", next.len(), n_inputs);
            return Err(LearningError::Length { what, found, n_samples, n_channels });
        }
        self.propose(input, error)?;
        let (finished, coming) = self.told.settle()?;
        let finished = finished.map(<[f64]>::to_vec);
        let coming = coming.to_vec();
        if let Some(finished) = finished {
            self.enter(&finished);
        }
        if !self.look_up(&coming, next) {
            next.copy_from_slice(&self.proposal);
            return Ok(());
        }
        check("next", next, n_samples, n_inputs)
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        self.told.announce(disturbance);
        self.core.set_disturbance(disturbance);
    }

    /// The entries converge where the core law does.
    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Inside(self.core.as_mut())
    }

    fn n_disturbances(&self) -> Option<usize> {
        Some(self.shape.n_disturbances)
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.remember(input, error, disturbance).map(|()| true)
    }

    /// The input of the table, from the runs in memory.
    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        let Some(coming) = self.told.coming() else { return Ok(None) };
        let mut input = vec![0.0; self.shape.n_samples * self.shape.n_inputs];
        Ok(self.look_up(coming, &mut input).then_some(input))
    }

    fn reset(&mut self) {
        self.core.reset();
        self.told.forget();
        self.disturbances.clear();
        self.inputs.clear();
    }

    fn describe(&self) -> String {
        let TableShape { n_samples, n_inputs, n_outputs, n_disturbances, tolerance } = self.shape;
        let core = self.core.describe();
        format!(
            r#"{{"law":"flexible","core":{core},"tolerance":{tolerance},"n_samples":{n_samples},"n_inputs":{n_inputs},"n_outputs":{n_outputs},"n_disturbances":{n_disturbances}}}"#
        )
    }
}

impl fmt::Debug for Flexible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} with {} entries", self.describe(), self.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::law::pd::{Pd, PdGains};
    use crate::learning::law::q_filter::QFilter;

    /// The core proposes `u + e`.
    fn law(n_disturbances: usize, tolerance: f64) -> Flexible {
        let gains = PdGains { kp: 1.0, kd: 0.0, lead_samples: 0 };
        let core = Pd::new(gains, 1, 1, QFilter::None).unwrap();
        let shape =
            TableShape { n_samples: 1, n_inputs: 1, n_outputs: 1, n_disturbances, tolerance };
        Flexible::new(Box::new(core), shape).unwrap()
    }

    fn next_at(law: &mut Flexible, coming: &[f64]) -> f64 {
        // A run without a disturbance is not entered.
        let mut next = [0.0];
        law.told.forget();
        law.set_disturbance(coming);
        law.update(&[99.0], &[0.0], &mut next).unwrap();
        next[0]
    }

    #[test]
    fn the_table_is_interpolated_between_its_neighbours_and_held_beyond_them() {
        let mut law = law(1, 0.0);
        assert!(law.is_empty());
        for (d, u) in [(0.0, 10.0), (1.0, 20.0), (5.0, 40.0)] {
            law.remember(&[u], &[1.0], &[d]).unwrap();
        }
        for (d, u) in
            [(-3.0, 11.0), (0.0, 11.0), (0.25, 13.5), (1.0, 21.0), (2.0, 26.0), (9.0, 41.0)]
        {
            assert!((next_at(&mut law, &[d]) - u).abs() < 1e-12, "at {d}");
        }
        assert_eq!(law.len(), 3);
    }

    #[test]
    fn the_first_input_is_that_of_the_table() {
        let mut law = law(1, 0.0);
        law.set_disturbance(&[0.25]);
        assert_eq!(law.first_input().unwrap(), None, "nothing is in the table");
        for (d, u) in [(0.0, 10.0), (1.0, 20.0)] {
            law.remember(&[u], &[1.0], &[d]).unwrap();
        }
        assert_eq!(law.first_input().unwrap(), Some(vec![13.5]));
        law.told.forget();
        assert_eq!(law.first_input().unwrap(), None, "the disturbance is not known");
    }

    #[test]
    fn a_disturbance_met_again_replaces_its_entry() {
        let mut law = law(1, 0.5);
        law.remember(&[1.0], &[1.0], &[20.0]).unwrap();
        law.remember(&[5.0], &[1.0], &[20.4]).unwrap();
        law.remember(&[7.0], &[1.0], &[21.0]).unwrap();
        assert_eq!(law.len(), 2);
        assert!((next_at(&mut law, &[20.0]) - 6.0).abs() < 1e-12);
        law.reset();
        assert!(law.is_empty());
    }

    #[test]
    fn several_disturbances_are_projected_on_the_line_between_two_entries() {
        let mut law = law(2, 0.0);
        law.remember(&[0.0], &[0.0], &[0.0, 0.0]).unwrap();
        law.remember(&[8.0], &[0.0], &[4.0, 0.0]).unwrap();
        law.remember(&[100.0], &[0.0], &[0.0, 50.0]).unwrap();
        assert!((next_at(&mut law, &[1.0, 0.0]) - 2.0).abs() < 1e-12);
        assert!((next_at(&mut law, &[1.0, -3.0]) - 2.0).abs() < 1e-12);
        assert!((next_at(&mut law, &[-1.0, -1.0]) - 0.0).abs() < 1e-12);
    }

    #[test]
    fn a_run_enters_under_its_own_disturbance() {
        let mut law = law(1, 0.0);
        let mut next = [0.0];
        law.set_disturbance(&[20.0]);
        law.set_disturbance(&[30.0]);
        law.update(&[1.0], &[1.0], &mut next).unwrap();
        assert_eq!(next.to_vec(), [2.0]);
        law.set_disturbance(&[20.0]);
        law.update(&[2.0], &[3.0], &mut next).unwrap();
        assert_eq!((law.len(), next[0]), (2, 2.0));
        assert_eq!(law.disturbances, [20.0, 30.0]);
        assert!(law.update(&[1.0], &[f64::NAN], &mut next).is_err());
        assert!(law.update(&[1.0], &[1.0], &mut []).is_err());
        law.set_disturbance(&[1.0, 2.0]);
        assert!(law.update(&[1.0], &[1.0], &mut next).is_err());
    }
}

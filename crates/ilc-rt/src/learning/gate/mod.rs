//! The switching mechanism: learn, hold, or roll back to the best input; for any law.

mod rule;

pub use rule::{GateMeasure, GateParameters, GateRule, Measure};

use super::{Law, LearningError, Purpose, Result, Standing, Surrogate};

/// State of a [`Gate`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GateState {
    /// The law learns.
    Learning,
    /// The error is inside the tolerance: the input is kept.
    Holding,
    /// The error grew: the best input so far is kept.
    RolledBack,
}

impl GateState {
    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Learning => "learning",
            Self::Holding => "holding",
            Self::RolledBack => "rolled_back",
        }
    }
}

/// A wrapper that stops its law when the error is good enough, or before it diverges.
///
/// - *Learning*, and the error is within the tolerance: *holding*, with the input unchanged.
/// - *Learning*, and for `patience` runs in a row the error exceeded `growth` times the best one:
///   *rolled back*, to the input of the best run.
/// - *Holding*, and the error exceeds `resume` times the tolerance: *learning* again.
/// - *Rolled back*, and for `patience` runs in a row the error exceeds `growth` times its earlier
///   value for the same input: the machine has changed, so *learning* again. An error within the
///   tolerance makes it *holding*.
///
/// Runs that only measure ([`Law::purpose`]) are passed to the law, and not judged.
///
/// When learning resumes, the best run so far is forgotten: it was made on a different machine
/// state.
///
/// # Shapes
/// - those of the law inside
/// # Real Time
/// Cold path. Allocates in the first [`Law::update`] only, for the best input.
/// # Source
/// - \[filter-based\], Section 4 (Fig. 19) and Section 6.3: switching iterative learning. The paper
///   switches off by hand before the error grows; growth, rollback and resumption are ours.
#[derive(Debug)]
pub struct Gate<L> {
    law: L,
    rule: GateRule,
    state: GateState,
    best_input: Vec<f64>,
    best_figure: Option<f64>,
    runs_grown: usize,
    /// The last update restored the best input.
    went_back: bool,
}

impl<L: Law> Gate<L> {
    /// Wraps a law.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a tolerance that is negative or not finite, or a ratio
    ///   below 1.
    /// - [`LearningError::Empty`] for a patience of 0.
    pub fn new(law: L, rule: GateRule) -> Result<Self> {
        let GateRule { tolerance, resume, growth, patience, .. } = rule;
        if !(tolerance.is_finite() && tolerance >= 0.0) {
            let allowed = "a tolerance must be finite and not negative";
            return Err(LearningError::Parameter { what: "tolerance", value: tolerance, allowed });
        }
        for (what, value) in [("resume", resume), ("growth", growth)] {
            if value.is_nan() || value < 1.0 {
                let allowed = "a ratio must be at least 1";
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        if patience == 0 {
            return Err(LearningError::Empty { what: "patience" });
        }
        Ok(Self {
            law,
            rule,
            state: GateState::Learning,
            best_input: Vec::new(),
            best_figure: None,
            runs_grown: 0,
            went_back: false,
        })
    }

    /// Returns the state of the gate.
    pub fn state(&self) -> GateState {
        self.state
    }

    /// Returns the figure of the best run since learning began or resumed.
    pub fn best_figure(&self) -> Option<f64> {
        self.best_figure
    }

    /// Returns the input of that run; empty before the first one.
    pub fn best_input(&self) -> &[f64] {
        &self.best_input
    }

    /// Sets the number of channels of the error, for a [`Measure::Rms`]; for a caller that knows it
    /// only at the first run.
    pub fn set_channels(&mut self, channels: usize) {
        if let Measure::Rms { n_channels } = &mut self.rule.measure {
            *n_channels = channels.max(1);
        }
    }

    /// Returns the law inside.
    pub fn law(&self) -> &L {
        &self.law
    }

    /// Returns the law inside.
    pub fn law_mut(&mut self) -> &mut L {
        &mut self.law
    }

    /// Decides on the next input after a run with this input and this figure.
    fn judge(&mut self, input: &[f64], figure: f64) {
        let GateRule { tolerance, resume, growth, patience, .. } = self.rule;
        let left = self.state == GateState::Holding && figure > resume * tolerance;
        let has_grown = self.best_figure.is_some_and(|best| figure > growth * best);
        self.runs_grown = if has_grown { self.runs_grown + 1 } else { 0 };
        let too_long = self.runs_grown >= patience;
        self.went_back = false;
        if left || self.state == GateState::RolledBack && too_long {
            self.state = GateState::Learning;
            self.best_figure = None;
            self.runs_grown = 0;
        } else if self.state != GateState::Holding && figure <= tolerance {
            self.state = GateState::Holding;
        } else if self.state == GateState::Learning && too_long {
            self.state = GateState::RolledBack;
            self.runs_grown = 0;
            self.went_back = true;
            self.law.on_rollback();
        }
        if self.best_figure.is_none_or(|best| figure < best) {
            self.best_figure = Some(figure);
            self.best_input.clear();
            self.best_input.extend_from_slice(input);
        }
    }
}

impl<L: Law> Law for Gate<L> {
    fn inner(&self) -> Option<&dyn Law> {
        Some(&self.law)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        Some(&mut self.law)
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let figure = self.rule.measure.of(error);
        if next.len() != input.len() || !figure.is_finite() {
            // The inner law knows the shapes and returns their errors, without having learned.
            self.law.update(input, error, next)?;
            let allowed = "the figure of an error must be finite";
            return Err(LearningError::Parameter { what: "error", value: figure, allowed });
        }
        if self.best_input.len() != input.len() {
            // The first run, or runs of another size: there is nothing to compare with.
            self.best_figure = None;
        }
        if self.state == GateState::Learning && self.law.purpose() != Purpose::Learning {
            // A run that only measures says nothing about the law or the machine.
            return self.law.update(input, error, next);
        }
        self.judge(input, figure);
        match self.state {
            GateState::Learning => return self.law.update(input, error, next),
            GateState::Holding => next.copy_from_slice(input),
            GateState::RolledBack => next.copy_from_slice(&self.best_input),
        }
        Ok(())
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        self.law.recall(input, error, disturbance)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        self.law.take_over(reference, input)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        self.law.first_input()
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Inside(&mut self.law)
    }

    fn handles_rollback(&self) -> bool {
        true
    }

    fn status(&self) -> Option<String> {
        match self.state {
            GateState::Learning => self.law.status(),
            GateState::Holding => Some(format!(
                "the error is within the tolerance of {:.4e}: the input is kept until it exceeds {:.4e}",
                self.rule.tolerance,
                self.rule.resume * self.rule.tolerance
            )),
            GateState::RolledBack => Some(format!(
                "the error grew beyond {} times the best one: the best input is kept",
                self.rule.growth
            )),
        }
    }

    fn standing(&self) -> Standing {
        match self.state {
            GateState::Learning => self.law.standing(),
            GateState::Holding => Standing::Holds,
            GateState::RolledBack if self.went_back => Standing::GoesBack,
            GateState::RolledBack => Standing::Rests,
        }
    }

    fn purpose(&self) -> Purpose {
        match self.state {
            GateState::Learning => self.law.purpose(),
            GateState::Holding | GateState::RolledBack => Purpose::Learning,
        }
    }

    fn reset(&mut self) {
        self.law.reset();
        self.state = GateState::Learning;
        self.best_figure = None;
        self.runs_grown = 0;
        self.went_back = false;
    }

    fn describe(&self) -> String {
        let GateRule { measure, tolerance, resume, growth, patience } = self.rule;
        let measure = measure.as_str();
        let ratio = |value: f64| if value.is_finite() { value.to_string() } else { "null".into() };
        format!(
            r#"{{"law":"gate","measure":"{measure}","tolerance":{tolerance},"resume":{},"growth":{},"patience":{patience},"inner":{}}}"#,
            ratio(resume),
            ratio(growth),
            self.law.describe()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds 1 to the input in every update, so that updates can be counted.
    #[derive(Debug, Default)]
    struct Counter {
        expected: Vec<f64>,
        resets: usize,
        n_rollbacks: usize,
    }

    impl Law for Counter {
        fn update(&mut self, u: &[f64], _: &[f64], next: &mut [f64]) -> Result {
            crate::learning::error::check("input", u, 2, 1)?;
            for (next, u) in next.iter_mut().zip(u) {
                *next = u + 1.0;
            }
            Ok(())
        }
        fn set_disturbance(&mut self, disturbance: &[f64]) {
            self.expected = disturbance.to_vec();
        }
        fn on_rollback(&mut self) {
            self.n_rollbacks += 1;
        }
        fn reset(&mut self) {
            self.resets += 1;
        }
        fn describe(&self) -> String {
            r#"{"law":"counter"}"#.into()
        }
    }

    fn gate(tolerance: f64) -> Gate<Counter> {
        let rule = GateRule { tolerance, ..GateRule::default() };
        Gate::new(Counter::default(), rule).unwrap()
    }

    /// Runs errors of these sizes and returns the inputs of the runs after them, and the states.
    fn play(gate: &mut Gate<Counter>, errors: &[f64]) -> (Vec<f64>, Vec<GateState>) {
        let mut input = [0.0; 2];
        let mut next = [0.0; 2];
        errors
            .iter()
            .map(|size| {
                gate.update(&input, &[*size, -size], &mut next).unwrap();
                input = next;
                (next[0], gate.state())
            })
            .unzip()
    }

    use GateState::{Holding, Learning, RolledBack};

    #[test]
    fn the_law_inside_hears_that_its_input_is_taken_back_and_people_hear_why() {
        let mut gate = gate(0.0);
        assert!(gate.handles_rollback() && gate.status().is_none());
        play(&mut gate, &[5.0, 2.0, 3.1, 2.9, 3.1]);
        assert_eq!((gate.law().n_rollbacks, gate.status()), (0, None));
        play(&mut gate, &[3.2]);
        assert_eq!(gate.law().n_rollbacks, 1);
        assert!(gate.status().unwrap().contains("best input is kept"));
        assert_eq!(gate.standing(), Standing::GoesBack);
        play(&mut gate, &[2.0]);
        assert_eq!(gate.standing(), Standing::Rests, "once for each time");
        gate.on_rollback();
        assert_eq!(gate.law().n_rollbacks, 2);
    }

    #[test]
    fn inside_the_tolerance_the_input_is_kept_and_learning_resumes_with_hysteresis() {
        let (inputs, states) = play(&mut gate(1.0), &[5.0, 2.0, 0.9, 1.4, 0.5, 1.6, 1.1, 1.0]);
        let expected = [Learning, Learning, Holding, Holding, Holding, Learning, Learning, Holding];
        assert_eq!(states, expected);
        assert_eq!(inputs, [1.0, 2.0, 2.0, 2.0, 2.0, 3.0, 4.0, 4.0]);
    }

    #[test]
    fn growth_for_two_runs_in_a_row_goes_back_to_the_best_input() {
        // The best run is the second one, with input 1; its error may grow to 3.
        let (inputs, states) = play(&mut gate(0.0), &[5.0, 2.0, 3.1, 2.9, 3.1, 3.2, 2.1, 2.0]);
        assert_eq!(states[..5], [Learning; 5]);
        assert_eq!(states[5..], [RolledBack; 3]);
        assert_eq!(inputs, [1.0, 2.0, 3.0, 4.0, 5.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn a_machine_that_changed_is_learned_again_and_a_good_one_is_held() {
        let mut gate = gate(1.0);
        let (_, states) = play(&mut gate, &[2.0, 9.0, 9.0, 2.0, 9.0, 2.0, 9.0, 9.0]);
        let expected = [
            Learning, Learning, RolledBack, RolledBack, RolledBack, RolledBack, RolledBack,
            Learning,
        ];
        assert_eq!(states, expected);
        assert_eq!(gate.best_figure().map(f64::to_bits), Some(9_f64.to_bits()));
        gate.reset();
        assert_eq!((gate.state(), gate.best_figure(), gate.law().resets), (Learning, None, 1));
        let (inputs, states) = play(&mut gate, &[2.0, 9.0, 9.0, 0.5]);
        assert_eq!(states[2..], [RolledBack, Holding]);
        assert_eq!(inputs[3].to_bits(), 0_f64.to_bits());
    }

    #[test]
    fn the_measures_are_those_of_their_names() {
        assert!((Measure::Rms { n_channels: 1 }.of(&[3.0, -4.0]) - 12.5_f64.sqrt()).abs() < 1e-15);
        assert_eq!(Measure::Max.of(&[3.0, -4.0]).to_bits(), 4_f64.to_bits());
        // One sample of two axes: the length is 5.
        assert!((Measure::Rms { n_channels: 2 }.of(&[3.0, -4.0]) - 5.0).abs() < 1e-15);
        let rule = GateRule { tolerance: 3.9, measure: Measure::Max, ..GateRule::default() };
        let mut gate = Gate::new(Counter::default(), rule).unwrap();
        gate.update(&[0.0; 2], &[3.0, -4.0], &mut [0.0; 2]).unwrap();
        assert_eq!(gate.state(), Learning);
    }

    #[test]
    fn what_is_expected_and_what_is_wrong_reach_the_law_inside() {
        let mut gate = gate(1.0);
        gate.set_disturbance(&[21.5]);
        assert_eq!(gate.law().expected, [21.5]);
        assert!(gate.describe().contains(r#""inner":{"law":"counter"}"#));
        assert!(gate.update(&[0.0; 3], &[9.0; 3], &mut [0.0; 3]).is_err());
        let error = gate.update(&[0.0; 2], &[f64::NAN; 2], &mut [0.0; 2]).unwrap_err();
        assert!(error.to_string().contains("error = NaN"));
        assert_eq!(gate.best_figure().map(f64::to_bits), Some(9_f64.to_bits()));
    }

    #[test]
    fn wrong_rules_are_refused_one_at_a_time() {
        let refuse = |rule| Gate::new(Counter::default(), rule).unwrap_err().to_string();
        let rule = GateRule::default();
        assert!(refuse(GateRule { tolerance: -1.0, ..rule }).contains("tolerance = -1"));
        assert!(refuse(GateRule { resume: 0.9, ..rule }).contains("resume = 0.9"));
        assert!(refuse(GateRule { growth: f64::NAN, ..rule }).contains("growth = NaN"));
        assert!(refuse(GateRule { patience: 0, ..rule }).contains("patience = 0"));
    }
}

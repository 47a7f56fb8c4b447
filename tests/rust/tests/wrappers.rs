//! Wrappers of a law: the inner law hears, and answers, what its wrapper leaves to it.

use ilc_rt::learning::gate::{Gate, GateRule};
use ilc_rt::learning::ladder::{Ladder, LadderRule};
use ilc_rt::learning::law::filtered::Filtered;
use ilc_rt::learning::law::flexible::{Flexible, TableShape};
use ilc_rt::learning::law::higher_order::HigherOrder;
use ilc_rt::learning::law::model_free::{ModelFree, ModelFreeRule};
use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::law::relevance::{Relevance, RelevanceWeights, RunShape};
use ilc_rt::learning::law::through_jacobian::ThroughJacobian;
use ilc_rt::learning::{Law, LearningError, Result, Scaled, Standing};
use nalgebra::dmatrix;

/// A law that tells what it has heard.
#[derive(Default)]
struct Inner {
    disturbance: Vec<f64>,
    n_rollbacks: usize,
}

impl Law for Inner {
    fn update(&mut self, input: &[f64], _: &[f64], next: &mut [f64]) -> Result {
        next.copy_from_slice(input);
        Ok(())
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        self.disturbance = disturbance.to_vec();
    }

    fn n_disturbances(&self) -> Option<usize> {
        Some(3)
    }

    fn on_rollback(&mut self) {
        self.n_rollbacks += 1;
    }

    fn handles_rollback(&self) -> bool {
        true
    }

    fn status(&self) -> Option<String> {
        Some(format!("{:?}, {} rollbacks", self.disturbance, self.n_rollbacks))
    }

    fn standing(&self) -> Standing {
        Standing::Rests
    }

    fn reset(&mut self) {
        *self = Self::default();
    }

    fn describe(&self) -> String {
        "{}".to_owned()
    }
}

#[test]
fn a_wrapper_leaves_to_its_inner_law_what_it_does_not_do_itself() {
    let inner = || Box::new(Inner::default()) as Box<dyn Law>;
    let wrapped: [Box<dyn Law>; 6] = [
        Box::new(Gate::new(inner(), GateRule::default()).unwrap()),
        Box::new(Ladder::new(inner(), LadderRule::new(2)).unwrap()),
        Box::new(Scaled::new(inner(), vec![2.0]).unwrap()),
        Box::new(Filtered::new(inner(), (8, 1), QFilter::None).unwrap()),
        Box::new(HigherOrder::new(inner(), &[1.5, -0.5], (8, 1)).unwrap()),
        Box::new(ThroughJacobian::new(inner(), &[dmatrix![2.0]]).unwrap()),
    ];
    for mut law in wrapped {
        let name = law.describe();
        law.set_disturbance(&[21.5]);
        law.on_rollback();
        assert_eq!(law.status().as_deref(), Some("[21.5], 1 rollbacks"), "{name}");
        assert_eq!(law.n_disturbances(), Some(3), "{name}");
        assert_eq!(law.standing(), Standing::Rests, "{name}");
        assert!(law.handles_rollback(), "{name}");
        law.reset();
        assert_eq!(law.status().as_deref(), Some("[], 0 rollbacks"), "{name}");
    }
}

#[test]
fn only_a_gate_wraps_a_law_that_also_makes_runs_which_only_measure() {
    let measuring = || {
        let rule = ModelFreeRule { gain: None, probe: 0.1 };
        Box::new(ModelFree::new(rule, 8, 1).unwrap()) as Box<dyn Law>
    };
    assert!(Gate::new(measuring(), GateRule::default()).unwrap().measures());
    let size =
        TableShape { n_samples: 8, n_inputs: 1, n_outputs: 1, n_disturbances: 0, tolerance: 0.0 };
    let run = RunShape { n_samples: 8, n_inputs: 1, n_outputs: 1, n_disturbances: 0, dt_s: 1e-3 };
    let refusals = [
        Ladder::new(measuring(), LadderRule::new(2)).err(),
        Filtered::new(measuring(), (8, 1), QFilter::None).err(),
        HigherOrder::new(measuring(), &[1.5, -0.5], (8, 1)).err(),
        ThroughJacobian::new(measuring(), &[dmatrix![2.0]]).err(),
        Flexible::new(measuring(), size).err(),
        Relevance::new(measuring(), run, RelevanceWeights::default(), None).err(),
        // A gate in between hides nothing.
        Ladder::new(Gate::new(measuring(), GateRule::default()).unwrap(), LadderRule::new(2)).err(),
    ];
    for refusal in refusals {
        assert!(matches!(refusal, Some(LearningError::Measures { .. })), "{refusal:?}");
    }
}

/// A law that begins with an input, as basis functions do on a new program.
struct Begins;

impl Law for Begins {
    fn update(&mut self, input: &[f64], _: &[f64], next: &mut [f64]) -> Result {
        next.copy_from_slice(input);
        Ok(())
    }

    fn take_over(&mut self, _: &[f64], _: &[f64]) -> Result<bool> {
        Ok(true)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>, LearningError> {
        Ok(Some((0..64).map(|k| if k % 2 == 0 { 1.5 } else { 0.5 }).collect()))
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        "{}".to_owned()
    }
}

#[test]
fn a_filter_begins_with_the_filtered_first_input_of_its_law() {
    let filter = QFilter::low_pass(2, 20.0, 1e-2).unwrap();
    let mut law = Filtered::new(Begins, (64, 1), filter.clone()).unwrap();
    assert!(law.take_over(&[0.0; 64], &[0.0; 64]).unwrap());
    let mut expected = Begins.first_input().unwrap().unwrap();
    filter.for_samples(64).unwrap().apply(&mut expected, 1).unwrap();
    assert_eq!(law.first_input().unwrap(), Some(expected.clone()));
    assert!((expected[32] - 1.0).abs() < 0.1, "{expected:?}");
}

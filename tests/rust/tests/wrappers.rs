//! Wrappers of a law: the inner law hears, and answers, what its wrapper leaves to it.

use ilc_rt::learning::gate::{Gate, GateRule};
use ilc_rt::learning::ladder::{Ladder, LadderRule};
use ilc_rt::learning::law::filtered::Filtered;
use ilc_rt::learning::law::higher_order::HigherOrder;
use ilc_rt::learning::law::q_filter::QFilter;
use ilc_rt::learning::law::through_jacobian::ThroughJacobian;
use ilc_rt::learning::{Law, Result, Scaled, Standing};
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

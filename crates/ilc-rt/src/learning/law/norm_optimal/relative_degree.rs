//! Relative degree of a time-varying model: delay of each output.

use super::plant::Plant;
use crate::model::{self, ModelError};

/// A Markov parameter counts as zero below this share of the sum of magnitudes of its terms.
const ROUNDING: f64 = 1e-13;

/// Returns, for each output, the smallest delay of any input, or `None` if it responds to none.
pub(in crate::learning::law) fn relative_degrees(
    plant: Plant,
    n_samples: usize,
) -> Result<Vec<Option<usize>>, ModelError> {
    match plant {
        Plant::Invariant(model) => model::relative_degrees(model),
        Plant::Varying(_) => Ok(varying(plant, n_samples)),
    }
}

/// Returns the smallest delay over all samples; bounded by the number of states, which is enough to
/// find every effect.
fn varying(plant: Plant, n_samples: usize) -> Vec<Option<usize>> {
    let first = plant.at(0);
    let mut found = vec![first.n_states(); first.n_outputs()];
    for k in 0..n_samples {
        let mut reached = plant.at(k).b().clone();
        let mut bound = reached.abs();
        let longest = found.iter().copied().max().unwrap_or(0);
        for lag in 0..longest.min(n_samples - k) {
            let model = plant.at(k + lag);
            let (effect, magnitude) = if lag == 0 {
                (model.d().clone(), model.d().abs())
            } else {
                (model.c() * &reached, model.c().abs() * &bound)
            };
            if lag > 0 {
                reached = model.a() * reached;
                bound = model.a().abs() * bound;
            }
            for (row, degree) in found.iter_mut().enumerate() {
                let answers =
                    |col: usize| effect[(row, col)].abs() > ROUNDING * magnitude[(row, col)];
                if lag < *degree && (0..model.n_inputs()).any(answers) {
                    *degree = lag;
                }
            }
        }
    }
    found.into_iter().map(Some).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::model::{Method, StateSpace, TimeVarying};
    use crate::model::{discretize, from_transfer_function, second_order};

    fn axis() -> StateSpace {
        discretize(&second_order(157.0, 0.5).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap()
    }

    #[test]
    fn delay_and_feedthrough_count() {
        let degrees = |model: &StateSpace| relative_degrees(model.into(), 9).unwrap();
        let lead = from_transfer_function(&[1.0, 0.2], &[1.0, 0.5], Some(2e-3)).unwrap();
        assert_eq!(degrees(&lead), [Some(0)]);
        assert_eq!(degrees(&axis()), [Some(1)]);
        let both = axis().delayed(3).unwrap().append(&lead).unwrap();
        assert_eq!(degrees(&both), [Some(4), Some(0)]);
        let mute = StateSpace::static_gain(DMatrix::zeros(1, 1), Some(2e-3)).unwrap();
        assert_eq!(degrees(&mute), [None]);
    }

    #[test]
    fn the_quickest_sample_decides() {
        let late = axis().delayed(2).unwrap();
        let mut c = late.c().clone();
        let same = TimeVarying::new(vec![late.clone(); 9]).unwrap();
        assert_eq!(relative_degrees((&same).into(), 9).unwrap(), [Some(3)]);
        // At sample 6 alone the delay line affects the output one sample before the axis does.
        c.fill(1.0);
        let (a, b, d) = (late.a().clone(), late.b().clone(), late.d().clone());
        let mut samples = vec![late; 9];
        samples[6] = StateSpace::discrete(a, b, c, d, 2e-3).unwrap();
        let once = TimeVarying::new(samples).unwrap();
        assert_eq!(relative_degrees((&once).into(), 9).unwrap(), [Some(1)]);
    }
}

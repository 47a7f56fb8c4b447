//! Relative degrees and delays (dead time) of a model, from its Markov parameters.

use nalgebra::DMatrix;

use super::{ModelError, StateSpace};

/// A Markov parameter counts as zero below this share of the sum of magnitudes of its terms.
const ROUNDING: f64 = 1e-13;

/// Returns the relative degree of each output: the index of its first Markov parameter that is
/// non-zero for any input, or `None` if no input affects the output.
///
/// `l_i = min { l : row i of (D, C B, C A B, ...)_l is non-zero }`
///
/// For a discrete model it is the delay in samples from input to output; for a continuous one, the
/// number of times the output must be differentiated until the input appears.
///
/// # Shapes
/// - one entry per output
/// # Errors
/// - [`ModelError::Numerics`] if a Markov parameter overflows.
/// # Source
/// - \[barton2010\], section 3.1: the lifted system shifted by the relative degree.
pub fn relative_degrees(model: &StateSpace) -> Result<Vec<Option<usize>>, ModelError> {
    Ok(delays(model)?.into_iter().map(|row| row.into_iter().flatten().min()).collect())
}

/// Returns the delay of each output and input: the index of the first non-zero Markov parameter, or
/// `None` if the input does not affect the output.
///
/// By the Cayley-Hamilton theorem, `n_states + 1` parameters suffice.
///
/// # Shapes
/// - `n_outputs` rows of `n_inputs` entries
/// # Errors
/// - [`ModelError::Numerics`] if a Markov parameter overflows.
pub fn delays(model: &StateSpace) -> Result<Vec<Vec<Option<usize>>>, ModelError> {
    let (a, c) = (model.a(), model.c());
    let (a_size, c_size) = (a.abs(), c.abs());
    let (mut reached, mut reached_size) = (model.b().clone(), model.b().abs());
    let mut found = vec![vec![None; model.n_inputs()]; model.n_outputs()];
    let mut note = |l: usize, parameter: &DMatrix<f64>, size: &DMatrix<f64>| {
        for (row, delays) in found.iter_mut().enumerate() {
            for (col, delay) in delays.iter_mut().enumerate() {
                let answers = parameter[(row, col)].abs() > ROUNDING * size[(row, col)];
                if delay.is_none() && answers {
                    *delay = Some(l);
                }
            }
        }
    };
    note(0, model.d(), &model.d().abs());
    for l in 1..=model.n_states() {
        let parameter = c * &reached;
        if parameter.iter().any(|value| !value.is_finite()) {
            return Err(ModelError::Numerics {
                what: "the relative degree",
                reason: "a Markov parameter overflows",
            });
        }
        note(l, &parameter, &(&c_size * &reached_size));
        reached = a * reached;
        reached_size = &a_size * reached_size;
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    fn axis() -> StateSpace {
        discretize(&second_order(157.0, 0.5).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap()
    }

    #[test]
    fn delay_and_feedthrough_are_counted() {
        let lead = from_transfer_function(&[1.0, 0.2], &[1.0, 0.5], Some(2e-3)).unwrap();
        assert_eq!(relative_degrees(&lead).unwrap(), [Some(0)]);
        let both = axis().delayed(3).unwrap().append(&lead).unwrap();
        assert_eq!(relative_degrees(&both).unwrap(), [Some(4), Some(0)]);
        assert_eq!(delays(&both).unwrap(), [vec![Some(4), None], vec![None, Some(0)]]);
    }

    #[test]
    fn a_continuous_model_has_the_excess_of_its_poles() {
        let plant = from_transfer_function(&[1.0, 3.0], &[1.0, 2.0, 5.0, 0.0], None).unwrap();
        assert_eq!(relative_degrees(&plant).unwrap(), [Some(2)]);
        let mute = StateSpace::static_gain(DMatrix::zeros(1, 1), None).unwrap();
        assert_eq!(relative_degrees(&mute).unwrap(), [None]);
    }
}

//! The closed loops of a plant and a controller: sensitivity functions.

use nalgebra::DMatrix;

use super::{ModelError, StateSpace};

impl StateSpace {
    /// Returns the sensitivity, from set point to control error.
    ///
    /// `S = (I + P K)^-1`, with `P` this model and `K` the controller.
    ///
    /// # Shapes
    /// - (`n_outputs`, `n_outputs`)
    /// # Errors
    /// - as [`StateSpace::feedback`].
    /// # Source
    /// - \[barton2010\], section 2.2.
    pub fn sensitivity(&self, controller: &Self) -> Result<Self, ModelError> {
        let open = controller.series(self)?;
        self.unity()?.feedback(&open)
    }

    /// Returns the complementary sensitivity, from set point to output with the controller in the
    /// forward path.
    ///
    /// `T = P K (I + P K)^-1 = I - S`
    ///
    /// # Shapes
    /// - (`n_outputs`, `n_outputs`)
    /// # Errors
    /// - as [`StateSpace::feedback`].
    pub fn complementary_sensitivity(&self, controller: &Self) -> Result<Self, ModelError> {
        controller.series(self)?.feedback(&self.unity()?)
    }

    /// Returns the process sensitivity, from a disturbance (or learned input) at the plant input to
    /// the output: the plant of parallel ILC.
    ///
    /// `P S = P (I + K P)^-1`
    ///
    /// # Shapes
    /// - (`n_outputs`, `n_inputs`)
    /// # Errors
    /// - as [`StateSpace::feedback`].
    pub fn process_sensitivity(&self, controller: &Self) -> Result<Self, ModelError> {
        self.feedback(controller)
    }

    fn unity(&self) -> Result<Self, ModelError> {
        let p = self.n_outputs();
        Self::static_gain(DMatrix::identity(p, p), self.dt_s)
    }
}

#[cfg(test)]
mod tests {
    use super::super::from_transfer_function;
    use super::*;

    #[test]
    fn sensitivities_of_static_gains_are_fractions() {
        let gain = |k| StateSpace::static_gain(DMatrix::from_element(1, 1, k), None).unwrap();
        let (plant, controller) = (gain(2.0), gain(1.5));
        let value = |model: StateSpace| model.d()[(0, 0)];
        assert!((value(plant.sensitivity(&controller).unwrap()) - 0.25).abs() < 1e-15);
        assert!(
            (value(plant.complementary_sensitivity(&controller).unwrap()) - 0.75).abs() < 1e-15
        );
        assert!((value(plant.process_sensitivity(&controller).unwrap()) - 0.5).abs() < 1e-15);
    }

    #[test]
    fn error_and_output_add_up_to_the_set_point() {
        let plant = from_transfer_function(&[0.1, 0.05], &[1.0, -1.4, 0.5], Some(1e-3)).unwrap();
        let controller = from_transfer_function(&[0.4], &[1.0], Some(1e-3)).unwrap();
        let step = [1.0; 40];
        let error = plant.sensitivity(&controller).unwrap().simulate(&step, None).unwrap();
        let output =
            plant.complementary_sensitivity(&controller).unwrap().simulate(&step, None).unwrap();
        for (e, y) in error.iter().zip(&output) {
            assert!((e + y - 1.0).abs() < 1e-12);
        }
    }
}

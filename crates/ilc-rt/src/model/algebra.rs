//! Algebra of models: sum, scaling, choice of channels, inverse.

use nalgebra::DMatrix;

use super::connect::{beside, block_diagonal, stack};
use super::{ModelError, StateSpace};

impl StateSpace {
    /// Returns the parallel connection with common inputs: `y = self(u) + other(u)`.
    ///
    /// # Errors
    /// - [`ModelError::TimeMismatch`] unless both have the same sample time.
    /// - [`ModelError::SignalMismatch`] unless both have the same numbers of inputs and outputs.
    pub fn sum(&self, other: &Self) -> Result<Self, ModelError> {
        let action = "add";
        let dt_s = self.same_time(action, other)?;
        for (first, second) in
            [(self.n_inputs(), other.n_inputs()), (self.n_outputs(), other.n_outputs())]
        {
            if first != second {
                return Err(ModelError::SignalMismatch { action, first, second });
            }
        }
        Self::new(
            block_diagonal(&self.a, &other.a),
            stack(&self.b, &other.b),
            beside(&self.c, &other.c),
            &self.d + &other.d,
            dt_s,
        )
    }

    /// Returns the model with all outputs multiplied by a number.
    ///
    /// # Errors
    /// - [`ModelError::NotFinite`] if a coefficient overflows.
    pub fn scaled(&self, factor: f64) -> Result<Self, ModelError> {
        let (a, b) = (self.a.clone(), self.b.clone());
        Self::new(a, b, &self.c * factor, &self.d * factor, self.dt_s)
    }

    /// Returns the model from some inputs to some outputs, in the order given.
    ///
    /// # Errors
    /// - [`ModelError::TooMany`] if there is no such output or input.
    pub fn select(&self, outputs: &[usize], inputs: &[usize]) -> Result<Self, ModelError> {
        for (what, chosen, count) in
            [("output", outputs, self.n_outputs()), ("input", inputs, self.n_inputs())]
        {
            if let Some(&value) = chosen.iter().find(|&&index| index >= count) {
                let allowed = count.saturating_sub(1);
                return Err(ModelError::TooMany { what, value, allowed });
            }
        }
        Self::new(
            self.a.clone(),
            self.b.select_columns(inputs),
            self.c.select_rows(outputs),
            self.d.select_rows(outputs).select_columns(inputs),
            self.dt_s,
        )
    }

    /// Returns the inverse, from output to input.
    ///
    /// `A - B D^-1 C`, `B D^-1`, `-D^-1 C`, `D^-1`
    ///
    /// # Errors
    /// - [`ModelError::SignalMismatch`] unless there are as many inputs as outputs.
    /// - [`ModelError::NoInverse`] if D is singular, so that the inverse is not proper.
    pub fn inverse(&self) -> Result<Self, ModelError> {
        let (first, second) = (self.n_outputs(), self.n_inputs());
        if first != second {
            return Err(ModelError::SignalMismatch { action: "invert", first, second });
        }
        let size = self.d.amax();
        let inverse = self.d.clone().try_inverse().ok_or(ModelError::NoInverse)?;
        // A condition number beyond this leaves no digits.
        if size * inverse.amax() > 1e14 {
            return Err(ModelError::NoInverse);
        }
        let b: DMatrix<f64> = &self.b * &inverse;
        Self::new(&self.a - &b * &self.c, b, -(&inverse * &self.c), inverse, self.dt_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(a: f64, b: f64, c: f64, d: f64) -> StateSpace {
        let e = |v| DMatrix::from_element(1, 1, v);
        StateSpace::discrete(e(a), e(b), e(c), e(d), 0.5).unwrap()
    }

    fn close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-13, "{found:?} is not {expected:?}");
        }
    }

    const U: [f64; 5] = [1.0, -2.0, 0.5, 3.0, 0.0];

    #[test]
    fn a_sum_adds_the_outputs() {
        let (x, y) = (scalar(0.5, 1.0, 2.0, 0.1), scalar(-0.3, 1.0, 1.0, 0.7));
        let both = x.sum(&y.scaled(-2.0).unwrap()).unwrap().simulate(&U, None).unwrap();
        let (x, y) = (x.simulate(&U, None).unwrap(), y.simulate(&U, None).unwrap());
        close(&both, &x.iter().zip(&y).map(|(x, y)| x - 2.0 * y).collect::<Vec<_>>());
    }

    #[test]
    fn an_inverse_undoes_the_model() {
        let model = scalar(0.5, 1.0, 2.0, 0.4);
        let y = model.simulate(&U, None).unwrap();
        close(&model.inverse().unwrap().simulate(&y, None).unwrap(), &U);
        assert_eq!(scalar(0.5, 1.0, 2.0, 0.0).inverse(), Err(ModelError::NoInverse));
    }

    #[test]
    fn channels_are_chosen_in_their_order() {
        let both = scalar(0.5, 1.0, 2.0, 0.1).append(&scalar(-0.3, 1.0, 1.0, 0.7)).unwrap();
        let crossed = both.select(&[1, 0], &[1]).unwrap();
        assert_eq!((crossed.n_outputs(), crossed.n_inputs()), (2, 1));
        let y = crossed.simulate(&U, None).unwrap();
        let only: Vec<f64> = y.iter().copied().step_by(2).collect();
        close(&only, &scalar(-0.3, 1.0, 1.0, 0.7).simulate(&U, None).unwrap());
        let line = both.select(&[2], &[0]).unwrap_err().to_string();
        assert!(line.contains("output = 2; at most 1"), "{line}");
    }
}

//! The linear time-invariant state-space model: simulation, Markov parameters, lifted system,
//! poles.

use nalgebra::{Complex, DMatrix, Schur};

use super::ModelError;
use super::rows::Stepper;

/// Largest number of values of all Markov parameters together.
const MAX_MARKOV: usize = 10_000_000;
/// Entries of a lifted operator, 400 MB.
const MAX_LIFTED: usize = 50_000_000;

/// A linear time-invariant model, discrete or continuous.
///
/// `x[k+1] = A x[k] + B u[k]`, `y[k] = C x[k] + D u[k]` (discrete), or the same with `dx/dt` on the
/// left (continuous).
///
/// # Shapes
/// - `a`: (`n_states`, `n_states`); `b`: (`n_states`, `n_inputs`); `c`: (`n_outputs`, `n_states`);
///   `d`: (`n_outputs`, `n_inputs`). Signals are time first: sample `k` of channel `i` is at
///   `k * n_channels + i`.
/// # Units
/// - sample time in seconds; inputs and outputs in the units of the axis (SI)
/// # Source
/// - \[haas2016\], Eq. (2).
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    pub(super) a: DMatrix<f64>,
    pub(super) b: DMatrix<f64>,
    pub(super) c: DMatrix<f64>,
    pub(super) d: DMatrix<f64>,
    pub(super) dt_s: Option<f64>,
}

impl StateSpace {
    /// Creates a discrete model with sample time `dt_s`.
    ///
    /// # Errors
    /// - [`ModelError::Shape`] if the shapes of the matrices do not match.
    /// - [`ModelError::NotFinite`] if a coefficient is infinite or NaN.
    /// - [`ModelError::SampleTime`] unless `dt_s` is finite and positive.
    pub fn discrete(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        dt_s: f64,
    ) -> Result<Self, ModelError> {
        Self::new(a, b, c, d, Some(dt_s))
    }

    /// Creates a continuous model.
    ///
    /// # Errors
    /// - [`ModelError::Shape`] if the shapes of the matrices do not match.
    /// - [`ModelError::NotFinite`] if a coefficient is infinite or NaN.
    pub fn continuous(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        Self::new(a, b, c, d, None)
    }

    /// Creates a discrete model if a sample time is given, else a continuous one.
    ///
    /// # Errors
    /// - as [`StateSpace::discrete`] and [`StateSpace::continuous`].
    pub fn new(
        a: DMatrix<f64>,
        b: DMatrix<f64>,
        c: DMatrix<f64>,
        d: DMatrix<f64>,
        dt_s: Option<f64>,
    ) -> Result<Self, ModelError> {
        let (n, m, p) = (a.nrows(), b.ncols(), c.nrows());
        for (matrix, given, rows, cols) in
            [("a", &a, n, n), ("b", &b, n, m), ("c", &c, p, n), ("d", &d, p, m)]
        {
            if given.shape() != (rows, cols) {
                let (found_rows, found_cols) = given.shape();
                return Err(ModelError::Shape { matrix, rows, cols, found_rows, found_cols });
            }
            for row in 0..rows {
                for col in 0..cols {
                    let value = given[(row, col)];
                    if !value.is_finite() {
                        return Err(ModelError::NotFinite { what: matrix, row, col, value });
                    }
                }
            }
        }
        if let Some(dt_s) = dt_s
            && !(dt_s.is_finite() && dt_s > 0.0)
        {
            return Err(ModelError::SampleTime { dt_s });
        }
        Ok(Self { a, b, c, d, dt_s })
    }

    /// Creates a model without states: `y = gain u`.
    ///
    /// # Errors
    /// - [`ModelError::NotFinite`] or [`ModelError::SampleTime`].
    pub fn static_gain(gain: DMatrix<f64>, dt_s: Option<f64>) -> Result<Self, ModelError> {
        let (p, m) = gain.shape();
        Self::new(DMatrix::zeros(0, 0), DMatrix::zeros(0, m), DMatrix::zeros(p, 0), gain, dt_s)
    }

    /// Returns the state matrix, (`n_states`, `n_states`).
    pub fn a(&self) -> &DMatrix<f64> {
        &self.a
    }

    /// Returns the input matrix, (`n_states`, `n_inputs`).
    pub fn b(&self) -> &DMatrix<f64> {
        &self.b
    }

    /// Returns the output matrix, (`n_outputs`, `n_states`).
    pub fn c(&self) -> &DMatrix<f64> {
        &self.c
    }

    /// Returns the feedthrough matrix, (`n_outputs`, `n_inputs`).
    pub fn d(&self) -> &DMatrix<f64> {
        &self.d
    }

    /// Returns the sample time in seconds, or `None` for a continuous model.
    pub fn dt_s(&self) -> Option<f64> {
        self.dt_s
    }

    /// Returns the number of states.
    pub fn n_states(&self) -> usize {
        self.a.nrows()
    }

    /// Returns the number of inputs.
    pub fn n_inputs(&self) -> usize {
        self.b.ncols()
    }

    /// Returns the number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.c.nrows()
    }

    /// Returns the output for an input and an initial state.
    ///
    /// # Shapes
    /// - `input`: `n_samples` x `n_inputs`, time first; `x0`: `n_states` (zero if `None`); the
    ///   result: `n_samples` x `n_outputs`, time first
    /// # Errors
    /// - [`ModelError::Continuous`] for a continuous model.
    /// - [`ModelError::Length`] if `input` is not a whole number of samples or `x0` does not match.
    /// - [`ModelError::Overflow`] if the output overflows.
    pub fn simulate(&self, input: &[f64], x0: Option<&[f64]>) -> Result<Vec<f64>, ModelError> {
        self.sampled("simulate")?;
        let m = self.n_inputs();
        if m == 0 || !input.len().is_multiple_of(m) {
            return Err(ModelError::Length {
                what: "input",
                found: input.len(),
                allowed: format!("a whole number of samples of {m} channels is needed"),
            });
        }
        let (n, p) = (self.n_states(), self.n_outputs());
        if let Some(x0) = x0.filter(|x0| x0.len() != n) {
            return Err(ModelError::Length {
                what: "x0",
                found: x0.len(),
                allowed: format!("one value for each of the {n} states is needed"),
            });
        }
        let mut stepper = Stepper::new([&self.a, &self.b, &self.c, &self.d]);
        stepper.start(x0);
        let mut output = vec![0.0; input.len() / m * p];
        for (u, y) in input.chunks_exact(m).zip(output.chunks_exact_mut(p.max(1))) {
            crate::interrupt::point();
            stepper.step(u, y);
        }
        if output.iter().all(|value| value.is_finite()) {
            Ok(output)
        } else {
            Err(ModelError::Overflow { what: "the simulated output" })
        }
    }

    /// Returns the first `count` Markov parameters: `D`, `C B`, `C A B`, ...
    ///
    /// # Shapes
    /// - each: (`n_outputs`, `n_inputs`)
    /// # Errors
    /// - [`ModelError::Continuous`] for a continuous model.
    /// - [`ModelError::TooMany`] for more than 10 000 000 numbers.
    pub fn markov(&self, count: usize) -> Result<Vec<DMatrix<f64>>, ModelError> {
        self.sampled("markov")?;
        self.bounded("count", count, MAX_MARKOV)?;
        let mut parameters = Vec::with_capacity(count);
        let mut reached = self.b.clone();
        for k in 0..count {
            crate::interrupt::point();
            if k == 0 {
                parameters.push(self.d.clone());
            } else {
                parameters.push(&self.c * &reached);
                reached = &self.a * reached;
            }
        }
        if parameters.iter().flat_map(|parameter| parameter.iter()).all(|value| value.is_finite()) {
            Ok(parameters)
        } else {
            Err(ModelError::Overflow { what: "a Markov parameter" })
        }
    }

    /// Returns the dense lifted system of `n_samples` samples, for analysis and as a test oracle.
    ///
    /// `y = P u` with `P` block lower-triangular Toeplitz, block (i, j) being Markov parameter
    /// `i - j`.
    ///
    /// # Shapes
    /// - (`n_samples * n_outputs`, `n_samples * n_inputs`)
    /// # Errors
    /// - [`ModelError::Continuous`] for a continuous model.
    /// - [`ModelError::TooMany`] for more than 50 000 000 entries.
    /// # Source
    /// - \[haas2016\], Eq. (3), which omits the first block row and the last block column.
    pub fn lifted(&self, n_samples: usize) -> Result<DMatrix<f64>, ModelError> {
        let (p, m) = (self.n_outputs(), self.n_inputs());
        self.sampled("lifted")?;
        let allowed = (MAX_LIFTED / (p * m).max(1)).isqrt();
        if n_samples > allowed {
            return Err(ModelError::TooMany { what: "n_samples", value: n_samples, allowed });
        }
        let parameters = self.markov(n_samples)?;
        let mut lifted = DMatrix::zeros(n_samples * p, n_samples * m);
        for row in 0..n_samples {
            crate::interrupt::point();
            for col in 0..=row {
                lifted.view_mut((row * p, col * m), (p, m)).copy_from(&parameters[row - col]);
            }
        }
        Ok(lifted)
    }

    /// Returns the poles, the eigenvalues of `A`.
    ///
    /// # Errors
    /// - [`ModelError::Numerics`] if the eigenvalue iteration does not converge.
    pub fn poles(&self) -> Result<Vec<Complex<f64>>, ModelError> {
        const MAX_SWEEPS: usize = 10_000;
        if self.n_states() == 0 {
            return Ok(Vec::new());
        }
        let schur = Schur::try_new(self.a.clone(), f64::EPSILON, MAX_SWEEPS).ok_or(
            ModelError::Numerics { what: "poles", reason: "the QR iteration did not converge" },
        )?;
        Ok(schur.complex_eigenvalues().iter().copied().collect())
    }

    /// Refuses a number of samples if all channels together exceed `max` numbers.
    fn bounded(&self, what: &'static str, value: usize, max: usize) -> Result<(), ModelError> {
        let allowed = max / (self.n_outputs() * self.n_inputs()).max(1);
        if value > allowed {
            return Err(ModelError::TooMany { what, value, allowed });
        }
        Ok(())
    }

    /// Returns the sample time, or an error for a continuous model; `action` names the operation.
    pub(super) fn sampled(&self, action: &'static str) -> Result<f64, ModelError> {
        self.dt_s.ok_or(ModelError::Continuous { action })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;

    fn integrator() -> StateSpace {
        let one = || DMatrix::from_element(1, 1, 1.0);
        StateSpace::discrete(one(), one() * 0.5, one(), one() * 0.0, 1.0).unwrap()
    }

    #[test]
    fn an_integrator_sums_its_input() {
        assert_eq!(integrator().simulate(&[1.0, 2.0, 4.0], None).unwrap(), [0.0, 0.5, 1.5]);
        assert_eq!(integrator().simulate(&[1.0, 2.0], Some(&[3.0])).unwrap(), [3.0, 3.5]);
    }

    #[test]
    fn the_lifted_operator_repeats_the_simulation() {
        let a = DMatrix::from_row_slice(2, 2, &[0.9, 0.2, -0.1, 0.7]);
        let b = DMatrix::from_row_slice(2, 2, &[1.0, 0.5, -0.3, 2.0]);
        let c = DMatrix::from_row_slice(1, 2, &[1.0, -1.0]);
        let d = DMatrix::from_row_slice(1, 2, &[0.25, 0.0]);
        let model = StateSpace::discrete(a, b, c, d, 0.1).unwrap();
        let u: Vec<f64> = (0..12).map(|k| f64::from(k * k % 7) - 3.0).collect();
        let y = model.simulate(&u, None).unwrap();
        let lifted = model.lifted(6).unwrap() * DVector::from_column_slice(&u);
        for (simulated, multiplied) in y.iter().zip(lifted.iter()) {
            assert!((simulated - multiplied).abs() < 1e-13);
        }
    }

    #[test]
    fn more_than_memory_holds_is_refused_at_once() {
        let line = integrator().markov(10_usize.pow(10)).unwrap_err().to_string();
        assert!(line.contains("count = 10000000000; at most 10000000"), "{line}");
        let line = integrator().lifted(100_000).unwrap_err().to_string();
        assert!(line.contains("n_samples = 100000; at most 7071"), "{line}");
        assert!(integrator().lifted(usize::MAX).is_err());
    }

    #[test]
    fn poles_of_a_rotation_are_complex() {
        let a = DMatrix::from_row_slice(2, 2, &[0.0, -0.5, 0.5, 0.0]);
        let model = StateSpace::discrete(
            a,
            DMatrix::zeros(2, 1),
            DMatrix::zeros(1, 2),
            DMatrix::zeros(1, 1),
            1.0,
        )
        .unwrap();
        let mut imaginary: Vec<f64> = model.poles().unwrap().iter().map(|p| p.im).collect();
        imaginary.sort_by(f64::total_cmp);
        assert!((imaginary[0] + 0.5).abs() < 1e-12 && (imaginary[1] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn each_misfit_is_named() {
        let m = DMatrix::zeros;
        let case = |a, b, c, d, dt| StateSpace::discrete(a, b, c, d, dt).unwrap_err().to_string();
        assert!(case(m(2, 1), m(2, 1), m(1, 2), m(1, 1), 1.0).contains("matrix a"));
        assert!(case(m(2, 2), m(1, 1), m(1, 2), m(1, 1), 1.0).contains("matrix b"));
        assert!(case(m(2, 2), m(2, 1), m(1, 3), m(1, 1), 1.0).contains("matrix c"));
        assert!(case(m(2, 2), m(2, 1), m(1, 2), m(2, 1), 1.0).contains("matrix d"));
        assert!(case(m(2, 2), m(2, 1), m(1, 2), m(1, 1), 0.0).contains("dt_s = 0"));
        let nan = DMatrix::from_element(1, 1, f64::NAN);
        assert!(case(nan, m(1, 1), m(1, 1), m(1, 1), 1.0).contains("NaN"));
    }
}

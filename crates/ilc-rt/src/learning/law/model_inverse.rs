//! Model-inverse ILC: removes the whole error at once, if the inverse is stable.

use nalgebra::DMatrix;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, check_cutoff};
use super::q_filter::{QFilter, QRunner};
use crate::learning::error::{check, check_adjoint, check_counts, check_update};
use crate::learning::operator::Operator;
use crate::learning::{Law, LearningError, LowPass, Result};
use crate::model::{ModelError, StateSpace, relative_degrees};
use crate::schema::{Violation, field_order};

/// `[learning.model_inverse]`: gain and zero-phase Butterworth low-pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ModelInverseParameters {
    /// Share of the predicted error that one update removes.
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 2.0))]
    pub gain: f64,
    /// Order of the zero-phase Butterworth low-pass (Q-filter).
    #[schemars(range(min = 1, max = 12))]
    pub order: usize,
    /// Cut-off of the low-pass, 0.001 to 0.95 of the Nyquist frequency: the inverse amplifies noise
    /// where the plant's gain is small.
    pub cutoff_hz: f64,
}

impl Default for ModelInverseParameters {
    fn default() -> Self {
        Self { gain: 0.5, order: 2, cutoff_hz: 10.0 }
    }
}

impl LawParameters for ModelInverseParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_cutoff("[learning.model_inverse] cutoff_hz", Some(self.cutoff_hz), cell)
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let filter = QFilter::low_pass(self.order, self.cutoff_hz, context.cell.cycle_s)
            .map_err(LearningError::from)?;
        Ok(Box::new(ModelInverse::new(context.model, context.n_samples(), self.gain, filter)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example {
                is_parallel: false,
                learning: "law = \"model_inverse\"\n[learning.model_inverse]\ncutoff_hz = 8.0",
                error_left: 0.1,
            },
            Example {
                is_parallel: true,
                learning: "law = \"model_inverse\"\ninput_max_m_s = 0.1",
                error_left: 0.2,
            },
        ]
    }
}

/// A zero nearer to the unit circle counts as on it: the inverse would ring for the whole run.
const STABLE: f64 = 1.0 - 1e-7;
/// Smallest ratio of singular values of the first Markov parameters; below it they count as
/// singular.
const SINGULAR: f64 = 1e-12;

/// Model-inverse ILC.
///
/// `u_{j+1} = Q (u_j + alpha P^{-1} e_j)`: with `alpha = 1`, an exact model and no filter, the
/// error is zero after one run
///
/// Each output is paired with the first sample at which it responds to the input (1 later without
/// delay), so that the inverse is causal: `v[k] = D~^{-1} (e~[k] - C~ x[k])`,
/// `x[k+1] = A x[k] + B v[k]` with `C~_i = C_i A^{l_i}`, `D~_i = C_i A^{l_i - 1} B`,
/// `e~_i[k] = e_i[k + l_i]`. Beyond the end of the run the error is held at its last value. The
/// inverse amplifies noise where the model's gain is small: a Q-filter is needed there.
///
/// # Shapes
/// - `input`, `error`, `next`: `n_samples` x `n_channels`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`]; `O(n_samples)`.
/// # Source
/// - \[barton2010\], Eq. (3.13) to (3.15), as the limit S = R = 0.
#[derive(Debug, Clone)]
pub struct ModelInverse {
    inverse: Operator,
    shifts: Vec<usize>,
    gain: f64,
    n_samples: usize,
    q_filter: QFilter,
    runner: QRunner,
    ahead: Vec<f64>,
}

impl ModelInverse {
    /// Creates the law for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`LearningError::NonMinimumPhase`] if the inverse is unstable; it names the outermost zero.
    /// - [`LearningError::NotSquare`] or [`LearningError::NoInverse`] if there is no inverse.
    /// - [`LearningError::Parameter`] unless `0 < gain < 2`.
    /// - [`LearningError::Empty`] for 0 samples or channels.
    /// - [`LearningError::Model`] for a continuous model.
    /// - [`LearningError::Signal`] if the run is too short for the filter.
    pub fn new(model: &StateSpace, n_samples: usize, gain: f64, q_filter: QFilter) -> Result<Self> {
        let Some(dt_s) = model.dt_s() else {
            return Err(ModelError::Continuous { action: "learning with the inverse" }.into());
        };
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        check_counts(&[
            ("n_samples", n_samples),
            ("n_inputs", n_inputs),
            ("n_outputs", n_outputs),
        ])?;
        if n_inputs != n_outputs {
            return Err(LearningError::NotSquare { n_inputs, n_outputs });
        }
        if !(gain > 0.0 && gain < 2.0) {
            let allowed = "a gain must lie above 0 and below 2, or the error grows";
            return Err(LearningError::Parameter { what: "gain", value: gain, allowed });
        }
        let (inverse, shifts) = inverse(model, dt_s)?;
        let poles = inverse.poles()?;
        let outermost = poles.iter().max_by(|a, b| a.norm().total_cmp(&b.norm()));
        if let Some(zero) = outermost.filter(|zero| zero.norm() >= STABLE) {
            let (re, im, radius) = (zero.re, zero.im, zero.norm());
            return Err(LearningError::NonMinimumPhase { re, im, radius });
        }
        let runner = q_filter.for_samples(n_samples)?;
        let ahead = vec![0.0; n_samples * n_outputs];
        let inverse = Operator::new(&inverse);
        Ok(Self { inverse, shifts, gain, n_samples, q_filter, runner, ahead })
    }
}

/// Returns the inverse of the model with its outputs advanced by their delays, and the delays.
fn inverse(model: &StateSpace, dt_s: f64) -> Result<(StateSpace, Vec<usize>)> {
    let mut shifts = Vec::new();
    let (mut c, mut d) = (model.c().clone(), model.d().clone());
    for (row, shift) in relative_degrees(model)?.into_iter().enumerate() {
        let shift = shift.ok_or(LearningError::NoInverse {
            reason: "an output answers to no input, so that nothing can be learned from it",
        })?;
        for _ in 0..shift {
            let (ahead, effect) = (c.row(row) * model.a(), c.row(row) * model.b());
            d.set_row(row, &effect);
            c.set_row(row, &ahead);
        }
        shifts.push(shift);
    }
    // Rows are normalised first: a small gain of one axis is not a singular matrix.
    let scaled = DMatrix::from_rows(&d.row_iter().map(|row| row / row.norm()).collect::<Vec<_>>());
    let sizes = scaled.svd(false, false).singular_values;
    let first_effect = d.try_inverse().filter(|_| sizes.min() > SINGULAR * sizes.max()).ok_or(
        LearningError::NoInverse {
            reason: "the first effects of its inputs on its outputs are not independent",
        },
    )?;
    let (c, d) = (-&first_effect * c, first_effect);
    let (a, b) = (model.a() + model.b() * &c, model.b() * &d);
    Ok((StateSpace::discrete(a, b, c, d, dt_s)?, shifts))
}

impl Law for ModelInverse {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let (n_samples, n_channels) = (self.n_samples, self.shifts.len());
        check_update(input, error, next, n_samples, [n_channels; 2])?;
        for (channel, shift) in self.shifts.iter().enumerate() {
            for k in 0..n_samples {
                let answer = (k + shift).min(n_samples - 1);
                self.ahead[k * n_channels + channel] = error[answer * n_channels + channel];
            }
        }
        self.inverse.forward(&self.ahead, next);
        for (next, input) in next.iter_mut().zip(input) {
            *next = input + self.gain * *next;
        }
        self.runner.apply(next, n_channels)?;
        check("next", next, n_samples, n_channels)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let (n_samples, n_channels) = (self.n_samples, self.shifts.len());
        check_adjoint(dual, to_input, to_error, n_samples, [n_channels; 2])?;
        to_input.copy_from_slice(dual);
        to_error.fill(0.0);
        self.runner.apply_transposed(to_input, n_channels)?;
        self.inverse.transposed(to_input, &mut self.ahead);
        for (channel, shift) in self.shifts.iter().enumerate() {
            for k in 0..n_samples {
                let answer = (k + shift).min(n_samples - 1);
                to_error[answer * n_channels + channel] +=
                    self.gain * self.ahead[k * n_channels + channel];
            }
        }
        Ok(true)
    }

    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        let cutoff_hz = self.q_filter.cutoff_hz(dt_s)?;
        let runner = QFilter::None.for_samples(self.n_samples).ok()?;
        let plain = Self { q_filter: QFilter::None, runner, ..self.clone() };
        Some(LowPass { cutoff_hz, unfiltered: Box::new(plain) })
    }

    fn reset(&mut self) {}

    fn describe(&self) -> String {
        format!(
            r#"{{"law":"model_inverse","gain":{},"q_filter":{},"n_samples":{},"n_channels":{}}}"#,
            self.gain,
            self.q_filter.describe(),
            self.n_samples,
            self.shifts.len()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Method, discretize, from_transfer_function, second_order};

    fn axis(w0: f64, damping: f64) -> StateSpace {
        discretize(&second_order(w0, damping).unwrap(), 2e-3, Method::ZeroOrderHold).unwrap()
    }

    /// The part of the error that the input can reach is gone after one run.
    fn remains(model: &StateSpace, shifts: &[usize]) -> f64 {
        let (n_samples, m) = (200, model.n_inputs());
        let reference: Vec<f64> =
            (0..n_samples * m).map(|k| (k as f64 / 15.0).sin() + (k % 7) as f64 * 0.1).collect();
        let mut law = ModelInverse::new(model, n_samples, 1.0, QFilter::None).unwrap();
        assert_eq!(law.shifts, shifts);
        let mut next = vec![0.0; n_samples * m];
        law.update(&vec![0.0; n_samples * m], &reference, &mut next).unwrap();
        let y = model.simulate(&next, None).unwrap();
        let reached = |i: usize| i / m >= shifts[i % m];
        (0..n_samples * m)
            .filter(|i| reached(*i))
            .map(|i| (reference[i] - y[i]).abs())
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_gain_with_delay_is_inverted_by_hand() {
        // y[k] = 2 u[k-2]: v[k] = e[k+2] / 2, the last value held.
        let model = from_transfer_function(&[2.0], &[1.0, 0.0, 0.0], Some(1.0)).unwrap();
        let mut law = ModelInverse::new(&model, 4, 0.5, QFilter::None).unwrap();
        let mut next = [0.0; 4];
        law.update(&[1.0; 4], &[9.0, 9.0, 4.0, 8.0], &mut next).unwrap();
        assert_eq!(next.to_vec(), [2.0, 3.0, 3.0, 3.0]);
    }

    #[test]
    fn one_run_removes_the_error_of_one_axis_and_of_coupled_ones() {
        assert!(remains(&axis(157.0, 0.5), &[1]) < 1e-10);
        assert!(remains(&axis(157.0, 0.5).delayed(3).unwrap(), &[4]) < 1e-10);
        let lead = from_transfer_function(&[1.0, 0.2], &[1.0, 0.5], Some(2e-3)).unwrap();
        assert!(remains(&lead, &[0]) < 1e-10);
        let separate = axis(157.0, 0.5).append(&axis(94.0, 1.0).delayed(1).unwrap()).unwrap();
        let mut c = separate.c().clone();
        c[(0, 2)] = 0.1;
        let (a, b, d) = (separate.a().clone(), separate.b().clone(), separate.d().clone());
        let coupled = StateSpace::discrete(a, b, c, d, 2e-3).unwrap();
        let shifts: Vec<usize> =
            relative_degrees(&coupled).unwrap().into_iter().map(Option::unwrap).collect();
        assert!(remains(&coupled, &shifts) < 1e-9);
    }

    #[test]
    fn a_zero_outside_is_named() {
        let refuse = |num: &[f64], den: &[f64]| {
            let model = from_transfer_function(num, den, Some(1.0)).unwrap();
            ModelInverse::new(&model, 50, 1.0, QFilter::None).unwrap_err().to_string()
        };
        let line = refuse(&[1.0, -1.5], &[1.0, -0.5, 0.06]);
        assert!(line.contains("a zero at 1.500000 +0.000000i, 1.500000"), "{line}");
        // The discrete double integrator has its zero on the unit circle.
        let line = refuse(&[0.5, 0.5], &[1.0, -2.0, 1.0]);
        assert!(line.contains("zero at -1.000000 "), "{line}");
        let line = refuse(&[1.0, 0.0, 2.25], &[1.0, -0.5, 0.06, 0.0]);
        assert!(line.contains("1.500000i"), "{line}");
        assert!(refuse(&[0.0], &[1.0, 0.5]).contains("answers to no input"));
    }

    #[test]
    fn what_has_no_inverse_is_refused() {
        let model = axis(157.0, 0.5);
        let refuse = |model: &StateSpace, n, gain| {
            ModelInverse::new(model, n, gain, QFilter::None).unwrap_err().to_string()
        };
        assert!(refuse(&model, 0, 1.0).contains("n_samples = 0"));
        for gain in [0.0, 2.0, -1.0, f64::NAN] {
            assert!(refuse(&model, 9, gain).contains("gain = "));
        }
        let matrix = |rows, cols| DMatrix::from_element(rows, cols, 0.5);
        let same =
            StateSpace::discrete(matrix(1, 1), matrix(1, 2), matrix(2, 1), matrix(2, 2), 1.0);
        assert!(refuse(&same.unwrap(), 9, 1.0).contains("not independent"));
        let wide =
            StateSpace::discrete(matrix(1, 1), matrix(1, 2), matrix(1, 1), matrix(1, 2), 1.0);
        assert!(refuse(&wide.unwrap(), 9, 1.0).contains("2 inputs and 1 outputs"));
        assert!(refuse(&second_order(1.0, 1.0).unwrap(), 9, 1.0).contains("continuous"));
    }
}

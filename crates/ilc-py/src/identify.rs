//! Identification: `FrequencyResponse`, `frequency_response`, the fits, excitations, uncertainty.

use ilc_rt::model::StateSpace;
use ilc_rt::model::identify::{
    self, Averaging, Excitation, FrequencyResponse, Known, RationalFit, SecondOrderFit,
    VelocityLoopFit,
};
use nalgebra::Complex;
use numpy::IntoPyArray;
use numpy::ndarray::Array1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::read_vector;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::experiment::read_waveform;
use crate::model::PyStateSpace;
use crate::whole;

/// Measured frequency response, and how far it can be trusted.
///
/// Parameters
/// ----------
/// frequency_hz : array_like, shape (n_frequencies,)
///     Frequencies in Hz, rising.
/// response : array_like of complex, shape (n_frequencies,)
///     Output over input.
/// coherence : array_like or None, shape (n_frequencies,)
///     Share of the output's power that follows the input, 0 to 1; 1 if None.
/// n_averages : float
///     Independent averages behind each estimate.
///
/// Raises
/// ------
/// ValueError
///     If the shapes differ or a number is not finite.
///
/// Examples
/// --------
/// >>> from ilc_rt.identify import FrequencyResponse
/// >>> FrequencyResponse([1.0, 2.0], [1.0, 0.5j]).band(1.5, 3.0).frequency_hz
/// array([2.])
#[pyclass(name = "FrequencyResponse", module = "ilc_rt._native", frozen)]
#[derive(Debug)]
pub(crate) struct PyFrequencyResponse(pub(crate) FrequencyResponse);

#[pymethods]
impl PyFrequencyResponse {
    /// Pickled and copied as its arrays.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let parts =
            (this.frequency_hz(py), this.response(py), this.coherence(py), this.n_averages());
        Ok((slf.get_type().into_any(), parts.into_pyobject(py)?.into_any()))
    }

    #[new]
    #[pyo3(signature = (frequency_hz, response, coherence=None, n_averages=1.0))]
    fn new(
        frequency_hz: &Bound<'_, PyAny>,
        response: &Bound<'_, PyAny>,
        coherence: Option<&Bound<'_, PyAny>>,
        n_averages: f64,
    ) -> PyResult<Self> {
        let frequency_hz = read_vector("frequency_hz", frequency_hz)?;
        let n = frequency_hz.len();
        let response = read_complex("response", response)?;
        let coherence = match coherence {
            None => vec![1.0; n],
            Some(coherence) => read_vector("coherence", coherence)?,
        };
        for (name, found) in [("response", response.len()), ("coherence", coherence.len())] {
            if found != n {
                let line =
                    format!("{name} has {found} entries; {n}, one for each frequency, are needed");
                return Err(PyValueError::new_err(line));
            }
        }
        if let Some(value) = coherence.iter().find(|value| !(0.0..=1.0).contains(*value)) {
            return Err(PyValueError::new_err(format!("coherence holds {value}; allowed 0 to 1")));
        }
        if !(n_averages.is_finite() && n_averages >= 1.0) {
            let line = format!("n_averages = {n_averages}; at least 1 is needed");
            return Err(PyValueError::new_err(line));
        }
        Ok(Self(FrequencyResponse { frequency_hz, response, coherence, n_averages }))
    }

    /// Frequencies in Hz, shape (n_frequencies,).
    #[getter]
    fn frequency_hz<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give(py, self.0.frequency_hz.clone())
    }

    /// Output over input, shape (n_frequencies,).
    #[getter]
    fn response<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_complex(py, self.0.response.clone())
    }

    /// Share of the output's power that follows the input, shape (n_frequencies,).
    #[getter]
    fn coherence<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give(py, self.0.coherence.clone())
    }

    /// Independent averages behind each estimate.
    #[getter]
    fn n_averages(&self) -> f64 {
        self.0.n_averages
    }

    /// Return the relative standard deviation of each estimate.
    ///
    /// ``sqrt((1 - gamma^2) / (2 gamma^2 n))``
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (n_frequencies,)
    ///     Of the magnitude, and of the phase in rad.
    ///
    /// References
    /// ----------
    /// [bendat2010], section 9.2.
    fn relative_deviation<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give(py, self.0.relative_deviation())
    }

    /// Return the part in a band, both ends included.
    ///
    /// Parameters
    /// ----------
    /// from_hz, to_hz : float
    ///     Lowest and highest frequency in Hz.
    ///
    /// Returns
    /// -------
    /// FrequencyResponse
    fn band(&self, from_hz: f64, to_hz: f64) -> Self {
        Self(self.0.band(from_hz, to_hz))
    }

    fn __repr__(&self) -> String {
        let f = &self.0.frequency_hz;
        match (f.first(), f.last()) {
            (Some(first), Some(last)) => {
                format!("FrequencyResponse({} frequencies, {first} to {last} Hz)", f.len())
            }
            _ => "FrequencyResponse(no frequencies)".to_owned(),
        }
    }
}

/// Return the frequency response from input to output, with coherence.
///
/// ``H = S_uy / S_uu``, ``gamma^2 = |S_uy|^2 / (S_uu S_yy)``
///
/// Parameters
/// ----------
/// u, y : array_like, shape (n_samples,)
///     Input and output.
/// dt_s : float
///     Sample time in seconds.
/// period_samples : int or None
///     Samples in a period of a periodic input: averages over whole periods,
///     without window and without leakage.
/// segment_samples : int or None
///     Samples in a segment of Welch's method for any other input: Hann window,
///     mean taken off; an eighth of the signal if neither is given.
/// overlap_samples : int or None
///     Samples that segments share; half a segment if None.
///
/// Returns
/// -------
/// FrequencyResponse
///     At the frequencies that the input holds.
///
/// Raises
/// ------
/// ModelError
///     If the lengths differ, a segment does not fit, or the input is zero.
/// ValueError, TypeError
///     If `u` or `y` has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [pintelon2012], section 2.5; [bendat2010], section 6.1.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt.identify import frequency_response
/// >>> u = np.tile([1.0, -1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0], 4)
/// >>> h = frequency_response(u, 3 * u, 0.1, period_samples=8).response
/// >>> np.allclose(h, 3.0)
/// True
#[pyfunction]
#[pyo3(signature = (u, y, dt_s, period_samples=None, segment_samples=None, overlap_samples=None))]
fn frequency_response(
    py: Python<'_>,
    u: &Bound<'_, PyAny>,
    y: &Bound<'_, PyAny>,
    dt_s: f64,
    #[pyo3(from_py_with = whole::maybe::period_samples)] period_samples: Option<usize>,
    #[pyo3(from_py_with = whole::maybe::segment_samples)] segment_samples: Option<usize>,
    #[pyo3(from_py_with = whole::maybe::overlap_samples)] overlap_samples: Option<usize>,
) -> PyResult<PyFrequencyResponse> {
    let (u, y) = (read_vector("u", u)?, read_vector("y", y)?);
    let averaging = match (period_samples, segment_samples) {
        (Some(_), Some(_)) => {
            let line = "period_samples and segment_samples exclude each other; give one of them";
            return Err(PyValueError::new_err(line));
        }
        (Some(period_samples), None) => Averaging::Periods { period_samples },
        (None, segment_samples) => {
            let segment_samples = segment_samples.unwrap_or(u.len() / 8);
            let overlap_samples = overlap_samples.unwrap_or(segment_samples / 2);
            Averaging::Welch { segment_samples, overlap_samples }
        }
    };
    detached(py, || identify::frequency_response(&u, &y, dt_s, averaging))
        .or_raise()
        .map(PyFrequencyResponse)
}

/// Fitted second-order model with delay.
///
/// ``G(s) = K w0^2 / (s^2 + 2 delta w0 s + w0^2) exp(-s tau)``, behind a
/// zero-order hold if sampled. What is known beforehand has the deviation 0.
#[pyclass(name = "SecondOrderFit", module = "ilc_rt._native", frozen, get_all)]
#[derive(Debug)]
pub(crate) struct PySecondOrderFit {
    /// Static gain K.
    gain: f64,
    /// Natural frequency w0 / (2 pi) in Hz.
    natural_frequency_hz: f64,
    /// Damping ratio delta.
    damping: f64,
    /// Delay tau in seconds, beyond that of the hold.
    delay_s: f64,
    /// Sample time in seconds; None for a continuous model.
    dt_s: Option<f64>,
    /// Standard deviation of the gain.
    gain_deviation: f64,
    /// Standard deviation of the natural frequency in Hz.
    natural_frequency_deviation_hz: f64,
    /// Standard deviation of the damping ratio.
    damping_deviation: f64,
    /// Standard deviation of the delay in seconds.
    delay_deviation_s: f64,
    /// Weighted RMS of the relative difference of measurement and model.
    residual_rms: f64,
}

impl PySecondOrderFit {
    fn model(&self) -> identify::SecondOrder {
        identify::SecondOrder {
            gain: self.gain,
            natural_frequency_hz: self.natural_frequency_hz,
            damping: self.damping,
            delay_s: self.delay_s,
            dt_s: self.dt_s,
        }
    }
}

impl From<SecondOrderFit> for PySecondOrderFit {
    fn from(fit: SecondOrderFit) -> Self {
        Self {
            gain: fit.model.gain,
            natural_frequency_hz: fit.model.natural_frequency_hz,
            damping: fit.model.damping,
            delay_s: fit.model.delay_s,
            dt_s: fit.model.dt_s,
            gain_deviation: fit.gain_deviation,
            natural_frequency_deviation_hz: fit.natural_frequency_deviation_hz,
            damping_deviation: fit.damping_deviation,
            delay_deviation_s: fit.delay_deviation_s,
            residual_rms: fit.residual_rms,
        }
    }
}

#[pymethods]
impl PySecondOrderFit {
    /// Pickled and copied as its figures.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let model = this.model();
        let parts = (
            (model.gain, model.natural_frequency_hz, model.damping, model.delay_s, model.dt_s),
            (
                this.gain_deviation,
                this.natural_frequency_deviation_hz,
                this.damping_deviation,
                this.delay_deviation_s,
            ),
            this.residual_rms,
        );
        let maker = py.import("ilc_rt._native")?.getattr("_second_order_fit")?;
        Ok((maker, parts.into_pyobject(py)?.into_any()))
    }

    /// Delay in whole samples; 0 for a continuous model.
    #[getter]
    fn delay_samples(&self) -> usize {
        self.model().delay_samples()
    }

    /// Return the response of the model, delay included.
    ///
    /// Parameters
    /// ----------
    /// frequency_hz : array_like, shape (n_frequencies,)
    ///     Frequencies in Hz.
    ///
    /// Returns
    /// -------
    /// ndarray of complex128, shape (n_frequencies,)
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If `frequency_hz` has the wrong shape or a number that is not finite.
    fn response<'py>(
        &self,
        py: Python<'py>,
        frequency_hz: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frequency_hz = read_vector("frequency_hz", frequency_hz)?;
        Ok(give_complex(py, self.model().response(&frequency_hz)))
    }

    /// Return the model in state space.
    ///
    /// Returns
    /// -------
    /// StateSpace
    ///     Sampled with `delay_samples` of delay, or continuous without delay.
    ///
    /// Raises
    /// ------
    /// ModelError
    ///     If frequency and damping cannot be used.
    fn state_space(&self) -> PyResult<PyStateSpace> {
        self.model().state_space().or_raise().map(PyStateSpace)
    }

    fn __repr__(&self) -> String {
        format!(
            "SecondOrderFit(gain={:.5}, natural_frequency_hz={:.4}, damping={:.4}, delay_s={:.6})",
            self.gain, self.natural_frequency_hz, self.damping, self.delay_s
        )
    }
}

/// Fit a second-order model with delay to a frequency response.
///
/// ``min sum_k w_k |ln(H_k / G(f_k))|^2``, ``w = gamma^2 / (1 - gamma^2)``
///
/// Parameters
/// ----------
/// frequency_hz : array_like, shape (n_frequencies,)
///     Frequencies in Hz, above 0 and rising.
/// response : array_like of complex, shape (n_frequencies,)
///     Measured response.
/// coherence : array_like or None, shape (n_frequencies,)
///     Coherence that weighs the frequencies; None for equal weights.
/// n_averages : float
///     Averages behind the response; with one, coherence says nothing.
/// dt_s : float or None
///     Sample time in seconds of the hold before the axis; None for a
///     continuous model.
/// gain, delay_s : float or None
///     What is known beforehand; fitted if None.
///
/// Returns
/// -------
/// SecondOrderFit
///     Stable by construction.
///
/// Raises
/// ------
/// ModelError
///     If the response cannot be fitted.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [pintelon2012], section 9.8.3.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt.identify import fit_second_order
/// >>> f = np.linspace(1.0, 50.0, 99)
/// >>> s = 2j * np.pi * f
/// >>> w0 = 2 * np.pi * 12.0
/// >>> fit = fit_second_order(f, w0**2 / (s**2 + w0 * s + w0**2) * np.exp(-0.004 * s))
/// >>> round(fit.natural_frequency_hz, 6), round(fit.damping, 6), round(fit.delay_s, 6)
/// (12.0, 0.5, 0.004)
#[pyfunction]
#[pyo3(signature = (frequency_hz, response, coherence=None, n_averages=2.0, dt_s=None, gain=None, delay_s=None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
fn fit_second_order(
    py: Python<'_>,
    frequency_hz: &Bound<'_, PyAny>,
    response: &Bound<'_, PyAny>,
    coherence: Option<&Bound<'_, PyAny>>,
    n_averages: f64,
    dt_s: Option<f64>,
    gain: Option<f64>,
    delay_s: Option<f64>,
) -> PyResult<PySecondOrderFit> {
    let measured = PyFrequencyResponse::new(frequency_hz, response, coherence, n_averages)?.0;
    let known = Known { gain, delay_s };
    let fit = detached(py, || identify::fit_second_order(&measured, dt_s, known));
    fit.or_raise().map(PySecondOrderFit::from)
}

/// Fitted velocity loop with delay, in a position loop of known gain.
///
/// ``G / (1 + kv z^-1 G)`` with G the zero-order hold of
/// ``K a / (s (s + a)) exp(-s tau)``. With a known delay the gain is 1.
#[pyclass(name = "VelocityLoopFit", module = "ilc_rt._native", frozen)]
#[derive(Debug)]
pub(crate) struct PyVelocityLoopFit(pub(crate) VelocityLoopFit);

#[pymethods]
impl PyVelocityLoopFit {
    /// Pickled and copied as its figures.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let (fit, model) = (&this.0, &this.0.model);
        let parts = (
            (model.gain, model.bandwidth_hz, model.delay_s, model.position_gain_per_s, model.dt_s),
            (fit.gain_deviation, fit.bandwidth_deviation_hz, fit.delay_deviation_s),
            fit.residual_rms,
        );
        let maker = py.import("ilc_rt._native")?.getattr("_velocity_loop_fit")?;
        Ok((maker, parts.into_pyobject(py)?.into_any()))
    }

    /// Gain K of the velocity loop.
    #[getter]
    fn gain(&self) -> f64 {
        self.0.model.gain
    }

    /// Bandwidth a / (2 pi) in Hz.
    #[getter]
    fn bandwidth_hz(&self) -> f64 {
        self.0.model.bandwidth_hz
    }

    /// Delay tau in seconds, beyond that of the hold.
    #[getter]
    fn delay_s(&self) -> f64 {
        self.0.model.delay_s
    }

    /// Delay in whole samples.
    #[getter]
    fn delay_samples(&self) -> usize {
        self.0.model.delay_samples()
    }

    /// Standard deviation of the gain.
    #[getter]
    fn gain_deviation(&self) -> f64 {
        self.0.gain_deviation
    }

    /// Standard deviation of the bandwidth in Hz.
    #[getter]
    fn bandwidth_deviation_hz(&self) -> f64 {
        self.0.bandwidth_deviation_hz
    }

    /// Standard deviation of the delay in seconds.
    #[getter]
    fn delay_deviation_s(&self) -> f64 {
        self.0.delay_deviation_s
    }

    /// Weighted RMS of the relative difference of measurement and model.
    #[getter]
    fn residual_rms(&self) -> f64 {
        self.0.residual_rms
    }

    /// Return the response from velocity input to position, loop closed.
    ///
    /// Parameters
    /// ----------
    /// frequency_hz : array_like, shape (n_frequencies,)
    ///     Frequencies in Hz.
    ///
    /// Returns
    /// -------
    /// ndarray of complex128, shape (n_frequencies,)
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If `frequency_hz` has the wrong shape or a number that is not finite.
    fn response<'py>(
        &self,
        py: Python<'py>,
        frequency_hz: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frequency_hz = read_vector("frequency_hz", frequency_hz)?;
        Ok(give_complex(py, self.0.model.response(&frequency_hz)))
    }

    fn __repr__(&self) -> String {
        let model = &self.0.model;
        format!(
            "VelocityLoopFit(gain={:.5}, bandwidth_hz={:.4}, delay_s={:.6})",
            model.gain, model.bandwidth_hz, model.delay_s
        )
    }
}

/// Fit a velocity loop in a position loop of known gain.
///
/// ``min sum_k w_k |ln(H_k / T(f_k))|^2`` with ``T = G / (1 + kv z^-1 G)``
///
/// Parameters
/// ----------
/// frequency_hz : array_like, shape (n_frequencies,)
///     Frequencies in Hz, above 0 and rising.
/// response : array_like of complex, shape (n_frequencies,)
///     Measured response from velocity input to position.
/// position_gain_per_s : float
///     Gain kv of the position loop in 1/s.
/// dt_s : float
///     Servo cycle in seconds.
/// coherence : array_like or None, shape (n_frequencies,)
///     Coherence that weighs the frequencies; None for equal weights.
/// n_averages : float
///     Averages behind the response; with one, coherence says nothing.
/// delay_s : float or None
///     Known delay in seconds, with which the gain is 1; both are fitted if
///     None.
///
/// Returns
/// -------
/// VelocityLoopFit
///
/// Raises
/// ------
/// ModelError
///     If the response cannot be fitted.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [pintelon2012], section 9.8.3.
#[pyfunction]
#[pyo3(signature = (frequency_hz, response, position_gain_per_s, dt_s, coherence=None, n_averages=2.0, delay_s=None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
fn fit_velocity_loop(
    py: Python<'_>,
    frequency_hz: &Bound<'_, PyAny>,
    response: &Bound<'_, PyAny>,
    position_gain_per_s: f64,
    dt_s: f64,
    coherence: Option<&Bound<'_, PyAny>>,
    n_averages: f64,
    delay_s: Option<f64>,
) -> PyResult<PyVelocityLoopFit> {
    let measured = PyFrequencyResponse::new(frequency_hz, response, coherence, n_averages)?.0;
    let fit =
        detached(py, || identify::fit_velocity_loop(&measured, position_gain_per_s, dt_s, delay_s));
    fit.or_raise().map(PyVelocityLoopFit)
}

/// Fitted fraction of any order.
#[pyclass(name = "RationalFit", module = "ilc_rt._native", frozen)]
#[derive(Debug)]
struct PyRationalFit(RationalFit);

#[pymethods]
impl PyRationalFit {
    /// Pickled and copied as its figures.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let fit = &this.0;
        let parts = (this.model(), fit.delay_s, fit.reflected_poles, fit.residual_rms);
        let maker = py.import("ilc_rt._native")?.getattr("_rational_fit")?;
        Ok((maker, parts.into_pyobject(py)?.into_any()))
    }

    /// The model in state space, without the delay.
    #[getter]
    fn model(&self) -> PyStateSpace {
        PyStateSpace(self.0.model.clone())
    }

    /// Delay in seconds that was taken out before the fit.
    #[getter]
    fn delay_s(&self) -> f64 {
        self.0.delay_s
    }

    /// Poles that came out unstable and were reflected.
    #[getter]
    fn reflected_poles(&self) -> usize {
        self.0.reflected_poles
    }

    /// Weighted RMS of the relative difference of measurement and model.
    #[getter]
    fn residual_rms(&self) -> f64 {
        self.0.residual_rms
    }

    /// Return the response of the model, delay included.
    ///
    /// Parameters
    /// ----------
    /// frequency_hz : array_like, shape (n_frequencies,)
    ///     Frequencies in Hz.
    ///
    /// Returns
    /// -------
    /// ndarray of complex128, shape (n_frequencies,)
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If `frequency_hz` has the wrong shape or a number that is not finite.
    fn response<'py>(
        &self,
        py: Python<'py>,
        frequency_hz: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let frequency_hz = read_vector("frequency_hz", frequency_hz)?;
        let response = late_response(&self.0.model, self.0.delay_s, &frequency_hz)?;
        Ok(give_complex(py, response))
    }

    fn __repr__(&self) -> String {
        format!("RationalFit(n_poles={}, delay_s={})", self.0.model.n_states(), self.0.delay_s)
    }
}

/// Fit a stable fraction of given degrees to a frequency response.
///
/// ``min sum_k w_k |ln(H_k exp(j w_k tau) / G(f_k))|^2``, begun by Sanathanan's
/// and Koerner's rounds; unstable poles are reflected.
///
/// Parameters
/// ----------
/// frequency_hz : array_like, shape (n_frequencies,)
///     Frequencies in Hz, above 0 and rising.
/// response : array_like of complex, shape (n_frequencies,)
///     Measured response.
/// n_zeros, n_poles : int
///     Degrees of numerator and denominator.
/// coherence : array_like or None, shape (n_frequencies,)
///     Coherence that weighs the frequencies; None for equal weights.
/// n_averages : float
///     Averages behind the response; with one, coherence says nothing.
/// delay_s : float
///     Known delay in seconds that is taken out first.
/// dt_s : float or None
///     Sample time in seconds for a sampled model; None for a continuous one.
///
/// Returns
/// -------
/// RationalFit
///
/// Raises
/// ------
/// ModelError
///     If the degrees are out of range or the response cannot be fitted.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// References
/// ----------
/// [sanathanan1963]; [pintelon2012], section 9.8.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt.identify import fit_rational
/// >>> f = np.linspace(0.1, 5.0, 50)
/// >>> fit = fit_rational(f, 3.0 / (2j * np.pi * f + 4.0), n_zeros=0, n_poles=1)
/// >>> round(float(fit.model.poles()[0].real), 6)
/// -4.0
#[pyfunction]
#[pyo3(signature = (frequency_hz, response, n_zeros, n_poles, coherence=None, n_averages=2.0, delay_s=0.0, dt_s=None))]
#[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
fn fit_rational(
    py: Python<'_>,
    frequency_hz: &Bound<'_, PyAny>,
    response: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = whole::n_zeros)] n_zeros: usize,
    #[pyo3(from_py_with = whole::n_poles)] n_poles: usize,
    coherence: Option<&Bound<'_, PyAny>>,
    n_averages: f64,
    delay_s: f64,
    dt_s: Option<f64>,
) -> PyResult<PyRationalFit> {
    let measured = PyFrequencyResponse::new(frequency_hz, response, coherence, n_averages)?.0;
    let fit = detached(py, || identify::fit_rational(&measured, n_zeros, n_poles, delay_s, dt_s));
    fit.or_raise().map(PyRationalFit)
}

/// Return a bound of what a model leaves over of a measured response.
///
/// ``bound(f) = max(|H/G - 1| + z sigma |H/G|)`` over a third of an octave.
///
/// Parameters
/// ----------
/// measured : FrequencyResponse
///     What was measured.
/// model : array_like of complex, shape (n_frequencies,)
///     Response of the model at the same frequencies.
/// deviations : float
///     Standard deviations z of the measurement that the bound allows for.
///
/// Returns
/// -------
/// frequency_hz : ndarray of float64, shape (n_frequencies,)
/// bound : ndarray of float64, shape (n_frequencies,)
///     Multiplicative uncertainty, as a robust-convergence test takes it.
///
/// Raises
/// ------
/// ModelError
///     If the lengths differ, the model is 0 somewhere or `deviations` negative.
///
/// References
/// ----------
/// [barton2010], section 3.3.
///
/// Examples
/// --------
/// >>> from ilc_rt.identify import FrequencyResponse, uncertainty
/// >>> uncertainty(FrequencyResponse([1.0, 2.0], [1.0, 1.1]), [1.0, 1.0])[1].round(3)
/// array([0. , 0.1])
#[pyfunction]
#[pyo3(signature = (measured, model, deviations=3.0))]
fn uncertainty<'py>(
    py: Python<'py>,
    measured: &Bound<'py, PyFrequencyResponse>,
    model: &Bound<'py, PyAny>,
    deviations: f64,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let model = read_complex("model", model)?;
    let found = identify::uncertainty(&measured.get().0, &model, deviations).or_raise()?;
    Ok((give(py, found.frequency_hz), give(py, found.bound)))
}

/// Return an excitation from rest to rest.
///
/// Parameters
/// ----------
/// waveform : {"sweep", "linear-sweep", "multisine"}
///     A sine of rising frequency and then rest, or all harmonics at once.
/// amplitude : float
///     Peak, in the unit of the input.
/// from_hz, to_hz : float
///     Band in Hz, at most to 0.45 / dt_s.
/// period_s : float
///     Length of a period in seconds, at least five cycles of the lowest
///     frequency.
/// periods : int
///     Periods that are evaluated.
/// dt_s : float
///     Sample time in seconds.
///
/// Returns
/// -------
/// values : ndarray of float64, shape (n_samples,)
/// first_sample : int
///     First sample of the first period that is evaluated.
/// period_samples : int
///     Samples in a period.
///
/// Raises
/// ------
/// ModelError
///     If a value is out of range.
/// ValueError
///     If `waveform` is not one of those offered.
///
/// References
/// ----------
/// [schroeder1970]; [pintelon2012], section 5.2.
///
/// Examples
/// --------
/// >>> from ilc_rt.identify import excitation
/// >>> values, first, period = excitation("sweep", 1e-3, 1.0, 40.0, 8.0, 3, 0.001)
/// >>> values.shape, first, period
/// ((24000,), 0, 8000)
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "a keyword each, as Python has it")]
fn excitation<'py>(
    py: Python<'py>,
    waveform: &str,
    amplitude: f64,
    from_hz: f64,
    to_hz: f64,
    period_s: f64,
    #[pyo3(from_py_with = whole::periods)] periods: usize,
    dt_s: f64,
) -> PyResult<(Bound<'py, PyAny>, usize, usize)> {
    let waveform = read_waveform(waveform)?;
    let excitation = Excitation { waveform, amplitude, from_hz, to_hz, period_s, periods };
    let signal = detached(py, || excitation.signal(dt_s)).or_raise()?;
    Ok((give(py, signal.values), signal.first_sample, signal.period_samples))
}

/// The response of a model without its delay, delayed.
fn late_response(
    model: &StateSpace,
    delay_s: f64,
    frequency_hz: &[f64],
) -> PyResult<Vec<Complex<f64>>> {
    let w: Vec<f64> = frequency_hz.iter().map(|f| std::f64::consts::TAU * f).collect();
    let response = model.frequency_response(&w).or_raise()?;
    let late = |(g, w): (nalgebra::DMatrix<Complex<f64>>, &f64)| {
        g[(0, 0)] * Complex::new(0.0, -w * delay_s).exp()
    };
    Ok(response.into_iter().zip(&w).map(late).collect())
}

fn read_complex(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<Complex<f64>>> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (object,)).map_err(|error| {
        PyValueError::new_err(format!("{name} is no array of numbers: {error}"))
    })?;
    let real = read_vector(name, &array.getattr("real")?)?;
    let imag = read_vector(name, &array.getattr("imag")?)?;
    Ok(real.into_iter().zip(imag).map(|(re, im)| Complex::new(re, im)).collect())
}

fn give(py: Python<'_>, values: Vec<f64>) -> Bound<'_, PyAny> {
    Array1::from(values).into_pyarray(py).into_any()
}

fn give_complex(py: Python<'_>, values: Vec<Complex<f64>>) -> Bound<'_, PyAny> {
    Array1::from(values).into_pyarray(py).into_any()
}

/// Makes a fit again from its figures, for copies.
#[pyfunction]
fn _second_order_fit(
    model: (f64, f64, f64, f64, Option<f64>),
    deviations: (f64, f64, f64, f64),
    residual_rms: f64,
) -> PySecondOrderFit {
    let (gain, natural_frequency_hz, damping, delay_s, dt_s) = model;
    PySecondOrderFit {
        gain,
        natural_frequency_hz,
        damping,
        delay_s,
        dt_s,
        gain_deviation: deviations.0,
        natural_frequency_deviation_hz: deviations.1,
        damping_deviation: deviations.2,
        delay_deviation_s: deviations.3,
        residual_rms,
    }
}

/// Makes a fit again from its figures, for copies.
#[pyfunction]
fn _velocity_loop_fit(
    model: (f64, f64, f64, f64, f64),
    deviations: (f64, f64, f64),
    residual_rms: f64,
) -> PyVelocityLoopFit {
    let (gain, bandwidth_hz, delay_s, position_gain_per_s, dt_s) = model;
    PyVelocityLoopFit(VelocityLoopFit {
        model: identify::VelocityLoop { gain, bandwidth_hz, delay_s, position_gain_per_s, dt_s },
        gain_deviation: deviations.0,
        bandwidth_deviation_hz: deviations.1,
        delay_deviation_s: deviations.2,
        residual_rms,
    })
}

/// Makes a fit again from its figures, for copies.
#[pyfunction]
fn _rational_fit(
    model: &Bound<'_, PyStateSpace>,
    delay_s: f64,
    #[pyo3(from_py_with = whole::n_poles)] reflected_poles: usize,
    residual_rms: f64,
) -> PyRationalFit {
    let model = model.get().model().clone();
    PyRationalFit(RationalFit { model, delay_s, reflected_poles, residual_rms })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyFrequencyResponse>()?;
    module.add_class::<PySecondOrderFit>()?;
    module.add_class::<PyVelocityLoopFit>()?;
    module.add_class::<PyRationalFit>()?;
    module.add_function(wrap_pyfunction!(frequency_response, module)?)?;
    module.add_function(wrap_pyfunction!(fit_second_order, module)?)?;
    module.add_function(wrap_pyfunction!(fit_velocity_loop, module)?)?;
    module.add_function(wrap_pyfunction!(fit_rational, module)?)?;
    module.add_function(wrap_pyfunction!(uncertainty, module)?)?;
    module.add_function(wrap_pyfunction!(_second_order_fit, module)?)?;
    module.add_function(wrap_pyfunction!(_velocity_loop_fit, module)?)?;
    module.add_function(wrap_pyfunction!(_rational_fit, module)?)?;
    module.add_function(wrap_pyfunction!(excitation, module)?)
}

//! Identification: frequency responses, fits, excitations, uncertainty.
//!
//! Each function returns its figures by name; the classes that hold them are those of `ilc_rt.fits`.

use ilc_rt::identification::WAVEFORMS;
use ilc_rt::model::identify::{
    self, Averaging, Excitation, FrequencyResponse, Known, SecondOrder, SecondOrderFit,
    VelocityLoop, VelocityLoopFit,
};
use nalgebra::Complex;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::answer::{Array, ByName, by_name, give_vector};
use crate::argument::read_vector;
use crate::arguments::{Arguments, read};
use crate::detached::computed;
use crate::error::OrRaise;
use crate::model::PyStateSpace;
use crate::whole::whole;

/// Reads a measured response.
fn read_measured(a: Arguments<'_, '_>) -> PyResult<FrequencyResponse> {
    let frequency_hz = a.vector("frequency_hz")?;
    let n = frequency_hz.len();
    let response = read_complex("response", &a.get("response")?)?;
    let coherence = a.maybe("coherence", read_vector)?.unwrap_or_else(|| vec![1.0; n]);
    let n_averages = a.number("n_averages")?;
    FrequencyResponse { frequency_hz, response, coherence, n_averages }.checked().or_raise()
}

/// Returns a measured response by the names of `ilc_rt.fits.FrequencyResponse`.
pub(crate) fn give_measured(py: Python<'_>, measured: FrequencyResponse) -> ByName<'_> {
    Ok(by_name!(py,
        [measured => n_averages]
        frequency_hz: give_vector(py, measured.frequency_hz),
        response: give_vector(py, measured.response),
        coherence: give_vector(py, measured.coherence),
    ))
}

#[pyfunction]
pub(crate) fn check_response<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    give_measured(a.py(), read_measured(a)?)
}

#[pyfunction]
pub(crate) fn relative_deviation<'py>(a: Arguments<'_, 'py>) -> Array<'py> {
    Ok(give_vector(a.py(), read_measured(a)?.relative_deviation()))
}

#[pyfunction]
pub(crate) fn frequency_response<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (u, y, dt_s) = (a.vector("u")?, a.vector("y")?, a.number("dt_s")?);
    let overlap_samples = a.maybe("overlap_samples", whole)?;
    let averaging = match (a.maybe("period_samples", whole)?, a.maybe("segment_samples", whole)?) {
        (Some(_), Some(_)) => {
            let line = "period_samples and segment_samples exclude each other; give one of them";
            return Err(PyValueError::new_err(line));
        }
        (Some(period_samples), None) => Averaging::Periods { period_samples },
        (None, segment_samples) => Averaging::welch(u.len(), segment_samples, overlap_samples),
    };
    let found = computed(a.py(), || identify::frequency_response(&u, &y, dt_s, averaging))?;
    give_measured(a.py(), found)
}

#[pyfunction]
pub(crate) fn fit_second_order<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (measured, dt_s) = (read_measured(a)?, a.maybe_number("dt_s")?);
    let known = read!(a, Known: [maybe_number => gain, delay_s]);
    let fit = computed(a.py(), || identify::fit_second_order(&measured, dt_s, known))?;
    give_second_order(a.py(), &fit)
}

/// Returns a fit by the names of `ilc_rt.fits.SecondOrderFit`.
pub(crate) fn give_second_order<'py>(py: Python<'py>, fit: &SecondOrderFit) -> ByName<'py> {
    Ok(by_name!(py,
        [fit.model => gain, natural_frequency_hz, damping, delay_s, dt_s]
        [fit => gain_deviation, natural_frequency_deviation_hz, damping_deviation]
        [fit => delay_deviation_s, residual_rms]
        delay_samples: fit.model.delay_samples(),
    ))
}

fn read_second_order(a: Arguments<'_, '_>) -> PyResult<SecondOrder> {
    Ok(read!(a, SecondOrder:
        [number => gain, natural_frequency_hz, damping, delay_s]
        [maybe_number => dt_s]
    ))
}

#[pyfunction]
pub(crate) fn second_order_response<'py>(
    frequency_hz: &Bound<'py, PyAny>,
    a: Arguments<'_, 'py>,
) -> Array<'py> {
    let frequency_hz = read_vector("frequency_hz", frequency_hz)?;
    Ok(give_vector(a.py(), read_second_order(a)?.response(&frequency_hz)))
}

#[pyfunction]
pub(crate) fn second_order_model(a: Arguments<'_, '_>) -> PyResult<PyStateSpace> {
    read_second_order(a)?.state_space().or_raise().map(PyStateSpace::from)
}

#[pyfunction]
pub(crate) fn fit_velocity_loop<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (measured, gain_per_s) = (read_measured(a)?, a.number("position_gain_per_s")?);
    let (dt_s, delay_s) = (a.number("dt_s")?, a.maybe_number("delay_s")?);
    let fit = || identify::fit_velocity_loop(&measured, gain_per_s, dt_s, delay_s);
    give_velocity_loop(a.py(), &computed(a.py(), fit)?)
}

/// Returns a fit by the names of `ilc_rt.fits.VelocityLoopFit`.
pub(crate) fn give_velocity_loop<'py>(py: Python<'py>, fit: &VelocityLoopFit) -> ByName<'py> {
    Ok(by_name!(py,
        [fit.model => gain, bandwidth_hz, delay_s, position_gain_per_s, dt_s]
        [fit => gain_deviation, bandwidth_deviation_hz, delay_deviation_s, residual_rms]
        delay_samples: fit.model.delay_samples(),
    ))
}

#[pyfunction]
pub(crate) fn velocity_loop_response<'py>(
    frequency_hz: &Bound<'py, PyAny>,
    a: Arguments<'_, 'py>,
) -> Array<'py> {
    let frequency_hz = read_vector("frequency_hz", frequency_hz)?;
    let model = read!(a, VelocityLoop:
        [number => gain, bandwidth_hz, delay_s, position_gain_per_s, dt_s]
    );
    Ok(give_vector(a.py(), model.response(&frequency_hz)))
}

#[pyfunction]
pub(crate) fn fit_rational<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (n_zeros, n_poles) = (a.whole("n_zeros")?, a.whole("n_poles")?);
    let (measured, dt_s) = (read_measured(a)?, a.maybe_number("dt_s")?);
    let delay_s = a.number("delay_s")?;
    let fit = || identify::fit_rational(&measured, n_zeros, n_poles, delay_s, dt_s);
    let fit = computed(a.py(), fit)?;
    let model = PyStateSpace::from(fit.model);
    Ok(by_name!(a.py(), [fit => delay_s, reflected_poles, residual_rms] model: model))
}

/// Frequencies and bounds.
type Bounds<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>);

#[pyfunction]
pub(crate) fn uncertainty<'py>(a: Arguments<'_, 'py>) -> PyResult<Bounds<'py>> {
    let (measured, model) = (read_measured(a)?, read_complex("model", &a.get("model")?)?);
    let found = identify::uncertainty(&measured, &model, a.number("deviations")?).or_raise()?;
    Ok((give_vector(a.py(), found.frequency_hz), give_vector(a.py(), found.bound)))
}

#[pyfunction]
pub(crate) fn excitation<'py>(
    a: Arguments<'_, 'py>,
) -> PyResult<(Bound<'py, PyAny>, usize, usize)> {
    let dt_s = a.number("dt_s")?;
    let excitation = read!(a, Excitation:
        [number => amplitude, from_hz, to_hz, period_s]
        [whole => periods]
        waveform: a.choice("waveform", &WAVEFORMS)?,
    );
    let signal = computed(a.py(), || excitation.signal(dt_s))?;
    Ok((give_vector(a.py(), signal.values), signal.first_sample, signal.period_samples))
}

/// Reads a one-dimensional array of complex or real numbers.
fn read_complex(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Vec<Complex<f64>>> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (object,)).map_err(|error| {
        PyValueError::new_err(format!("{name} is not an array of numbers: {error}"))
    })?;
    let real = read_vector(name, &array.getattr("real")?)?;
    let imag = read_vector(name, &array.getattr("imag")?)?;
    Ok(real.into_iter().zip(imag).map(|(re, im)| Complex::new(re, im)).collect())
}

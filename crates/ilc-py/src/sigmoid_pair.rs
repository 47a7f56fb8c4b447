//! `sigmoid_pair`: an E/S motion of which every alpha is given.

use ilc_rt::trajectory::exponential::listing::{ListedLeg, Listing};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::read_vector;
use crate::trajectory::{PyTrajectory, planned};

/// Sample two legs on one axis, joined by sigmoids, every alpha given.
///
/// ``x = (x1 a/(a + exp(s c)) + x2 b/(b + exp(-s c))) (1 - exp(-a0 t^2))``
///
/// with c the time from the corner, ``a = |v2/v1|``, ``b = 1/a``, and
/// oscillations on x1 and x2 that fade before the corner and after it.
///
/// Parameters
/// ----------
/// velocity_m_s : array_like of float64, shape (2,)
///     Velocity of each leg, signed, in m/s.
/// amplitude_m : array_like of float64, shape (2,)
///     Amplitude of each oscillation, in m.
/// omega_rad_s : array_like of float64, shape (2,)
///     Its angular frequency, in rad/s.
/// phase_zero_s : array_like of float64, shape (2,)
///     Time at which its phase is 0, in s.
/// corner_s : float
///     When the first leg gives way to the second, in s.
/// duration_s : float
///     Length of the motion, in s; it does not come to rest.
/// start_alpha : float
///     Of the start, a0 in 1/s^2.
/// transition_alpha : float
///     Of the sigmoids between the legs, s in 1/s.
/// sine_alpha : float
///     Of the sigmoids that fade the oscillations, in 1/s.
/// sine_offset_s : float
///     How far from the corner these are half open, in s.
/// dt_s : float
///     Sample time in s.
///
/// Returns
/// -------
/// Trajectory
///     `programmed_m` is without start and transition.
///
/// Raises
/// ------
/// TrajectoryError
///     If a velocity is 0, an alpha or a time is not above 0, or a number is not
///     finite.
/// ValueError, TypeError
///     If an array has the wrong shape, dtype or a number that is not finite.
///
/// Notes
/// -----
/// No limit is held: it is the thesis's own program, to compare with and to
/// make its reference again. `exponential_sigmoid` plans for a machine.
///
/// References
/// ----------
/// [dimarco2016], Appendix A.
///
/// Examples
/// --------
/// >>> from ilc_rt import trajectory
/// >>> path = trajectory.sigmoid_pair(
/// ...     velocity_m_s=[10.0, -5.0], amplitude_m=[2.0, 1.0], omega_rad_s=[10.0, 20.0],
/// ...     phase_zero_s=[0.0, 6.01], corner_s=6.0, duration_s=14.0, start_alpha=5.0,
/// ...     transition_alpha=2.0, sine_alpha=3.0, sine_offset_s=1.0, dt_s=0.01)
/// >>> path.n_samples
/// 1401
#[pyfunction]
#[pyo3(signature = (*, velocity_m_s, amplitude_m, omega_rad_s, phase_zero_s, corner_s, duration_s, start_alpha, transition_alpha, sine_alpha, sine_offset_s, dt_s))]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
fn sigmoid_pair(
    py: Python<'_>,
    velocity_m_s: &Bound<'_, PyAny>,
    amplitude_m: &Bound<'_, PyAny>,
    omega_rad_s: &Bound<'_, PyAny>,
    phase_zero_s: &Bound<'_, PyAny>,
    corner_s: f64,
    duration_s: f64,
    start_alpha: f64,
    transition_alpha: f64,
    sine_alpha: f64,
    sine_offset_s: f64,
    dt_s: f64,
) -> PyResult<PyTrajectory> {
    let velocity = read_pair("velocity_m_s", velocity_m_s)?;
    let amplitude = read_pair("amplitude_m", amplitude_m)?;
    let omega = read_pair("omega_rad_s", omega_rad_s)?;
    let phase_zero = read_pair("phase_zero_s", phase_zero_s)?;
    let legs = std::array::from_fn(|i| ListedLeg {
        velocity_m_s: velocity[i],
        amplitude_m: amplitude[i],
        omega_rad_s: omega[i],
        phase_zero_s: phase_zero[i],
    });
    let pair = Listing { legs, corner_s, start_alpha, transition_alpha, sine_alpha, sine_offset_s };
    planned(py, || Ok((pair.sample(duration_s, dt_s)?, Vec::new())))
}

/// Reads a number for each leg.
fn read_pair(name: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    let values = read_vector(name, object)?;
    values.as_slice().try_into().map_err(|_| {
        PyValueError::new_err(format!("{name} has {} entries; 2 are needed", values.len()))
    })
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(sigmoid_pair, module)?)
}

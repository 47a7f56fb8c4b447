//! Controllers, tick by tick: `Pid`, `Cascade`, `CrossCoupled`.

use std::sync::Mutex;

use ilc_rt::control::{
    Bounded, Cascade, CascadeGains, CascadeReference, CrossCoupled, Derivative, Pid, PidGains,
    PidMatrices, variable_gains,
};
use ilc_rt::model::StateSpace;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::{Matrix, Signal, give_signal, misfit, read_vector};
use crate::error::OrRaise;
use crate::held::held;
use crate::made::{Made, made};
use crate::model::PyStateSpace;

/// PID controller with a filtered derivative that does not wind up.
///
/// ``u[k] = kp e[k] + ki dt sum(e[:k]) + kd (de/dt)[k]``, cut to +-output_max
///
/// Parameters
/// ----------
/// kp : float
///     Proportional gain.
/// ki_per_s : float
///     Integral gain in 1/s.
/// kd_s : float
///     Derivative gain in s.
/// dt_s : float
///     Sample time in s.
/// derivative : {"difference", "delayed", "filtered"}
///     ``(e[k] - e[k-1]) / dt``, the same one sample late, or ``s / (T s + 1)``,
///     exact for an error that is held over the sample.
/// filter_s : float
///     T of the filtered derivative in s.
/// output_max : float or None
///     Largest output, either way.
///
/// Raises
/// ------
/// ValueError
///     If a number is not finite, or a time or limit is not above 0.
///
/// References
/// ----------
/// [barton2010], Eq. (8.3); [dimarco2016], Sect. 4.1.
///
/// Examples
/// --------
/// >>> from ilc_rt.control import Pid
/// >>> pid = Pid(kp=2.0, kd_s=0.5, dt_s=0.1)
/// >>> pid.step(1.0), pid.step(1.0)
/// (7.0, 2.0)
#[pyclass(name = "Pid", module = "ilc_rt.control", frozen)]
#[derive(Debug)]
struct PyPid {
    made: Made,
    dt_s: f64,
    pid: Mutex<Pid>,
}

#[pymethods]
impl PyPid {
    #[new]
    #[pyo3(signature = (kp, ki_per_s=0.0, kd_s=0.0, *, dt_s, derivative="difference", filter_s=0.01, output_max=None))]
    fn new(
        kp: f64,
        ki_per_s: f64,
        kd_s: f64,
        dt_s: f64,
        derivative: &str,
        filter_s: f64,
        output_max: Option<f64>,
    ) -> PyResult<Self> {
        let made = made!(kp, ki_per_s, kd_s, dt_s, derivative, filter_s, output_max);
        for (name, value) in [("kp", kp), ("ki_per_s", ki_per_s), ("kd_s", kd_s)] {
            finite(name, value)?;
        }
        positive("dt_s", dt_s)?;
        positive("filter_s", filter_s)?;
        let derivative = match derivative {
            "difference" => Derivative::Difference,
            "delayed" => Derivative::DelayedDifference,
            "filtered" => Derivative::Filtered { time_constant_s: filter_s },
            other => {
                return Err(PyValueError::new_err(format!(
                    "derivative = {other:?}; \"difference\", \"delayed\" or \"filtered\" is needed"
                )));
            }
        };
        let output_max = limit("output_max", output_max)?;
        let gains = PidGains { kp, ki_per_s, kd_s, derivative, output_max };
        Ok(Self { made, dt_s, pid: Mutex::new(Pid::new(gains, dt_s)) })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.made.shown(py, "Pid")
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Return the output for the error of this tick.
    ///
    /// Parameters
    /// ----------
    /// error : float
    ///     Error.
    ///
    /// Returns
    /// -------
    /// float
    ///     Output, within its limit.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If the error is not finite; it is then not remembered.
    fn step(&self, error: f64) -> PyResult<f64> {
        give("error", error, held(&self.pid).step(error))
    }

    /// Return the outputs for a whole error signal, from the present state on.
    ///
    /// Parameters
    /// ----------
    /// error : ndarray of float64, shape (n_samples,)
    ///     Errors.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (n_samples,)
    ///     Outputs.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If the array has the wrong shape, dtype or a number that is not finite.
    fn run<'py>(&self, py: Python<'py>, error: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut signal = Signal::read("error", error)?.with_channels("error", 1)?;
        let mut pid = held(&self.pid);
        for value in &mut signal.values {
            *value = pid.step(*value).value;
        }
        give_signal(py, signal.values, 1, signal.is_flat)
    }

    /// Return the controller without its limit, as a model from error to output.
    ///
    /// Returns
    /// -------
    /// StateSpace
    ///     With three states: the integral and what the derivative remembers.
    fn model(&self) -> PyResult<PyStateSpace> {
        let PidMatrices { a, b, c, d } = held(&self.pid).matrices();
        let model = StateSpace::new(
            Matrix::from_fn(3, 3, |row, col| a[row][col]),
            Matrix::from_fn(3, 1, |row, _| b[row]),
            Matrix::from_fn(1, 3, |_, col| c[col]),
            Matrix::from_element(1, 1, d),
            Some(self.dt_s),
        );
        Ok(PyStateSpace::from(model.or_raise()?))
    }

    /// Start again from rest.
    fn reset(&self) {
        held(&self.pid).reset();
    }
}

/// Cascade of proportional position and proportional-integral velocity control.
///
/// ``v* = kv (r - y) + f r'``, ``F = kp (v* - y') + kp dt / Tn sum(v* - y') + m r''``
///
/// Parameters
/// ----------
/// position_gain_per_s : float
///     kv in 1/s.
/// velocity_gain_n_s_m : float
///     kp in N s/m.
/// integral_time_s : float or None
///     Tn in s; None for no integral part.
/// dt_s : float
///     Sample time in s.
/// velocity_feedforward : float
///     f, the share of the reference velocity that is fed forward.
/// acceleration_feedforward_kg : float
///     m, the mass that is fed forward.
/// velocity_max_m_s, force_max_n : float or None
///     Limits.
///
/// Raises
/// ------
/// ValueError
///     If a number is not finite, or a time or limit is not above 0.
///
/// References
/// ----------
/// [haas2016], Sect. 3.
///
/// Examples
/// --------
/// >>> from ilc_rt.control import Cascade
/// >>> Cascade(50.0, 100.0, dt_s=0.001).step(0.001, 0.0, 0.0)
/// 5.0
#[pyclass(name = "Cascade", module = "ilc_rt.control", frozen)]
#[derive(Debug)]
struct PyCascade(Mutex<Cascade>, Made);

#[pymethods]
impl PyCascade {
    #[new]
    #[pyo3(signature = (position_gain_per_s, velocity_gain_n_s_m, integral_time_s=None, *, dt_s, velocity_feedforward=0.0, acceleration_feedforward_kg=0.0, velocity_max_m_s=None, force_max_n=None))]
    #[expect(clippy::too_many_arguments, reason = "all but the gains are named in Python")]
    fn new(
        position_gain_per_s: f64,
        velocity_gain_n_s_m: f64,
        integral_time_s: Option<f64>,
        dt_s: f64,
        velocity_feedforward: f64,
        acceleration_feedforward_kg: f64,
        velocity_max_m_s: Option<f64>,
        force_max_n: Option<f64>,
    ) -> PyResult<Self> {
        let made = made!(
            position_gain_per_s,
            velocity_gain_n_s_m,
            integral_time_s,
            dt_s,
            velocity_feedforward,
            acceleration_feedforward_kg,
            velocity_max_m_s,
            force_max_n
        );
        for (name, value) in [
            ("position_gain_per_s", position_gain_per_s),
            ("velocity_gain_n_s_m", velocity_gain_n_s_m),
            ("velocity_feedforward", velocity_feedforward),
            ("acceleration_feedforward_kg", acceleration_feedforward_kg),
        ] {
            finite(name, value)?;
        }
        positive("dt_s", dt_s)?;
        let gains = CascadeGains {
            position_gain_per_s,
            velocity_gain_n_s_m,
            integral_time_s: limit("integral_time_s", integral_time_s)?,
            velocity_feedforward,
            acceleration_feedforward_kg,
            velocity_max_m_s: limit("velocity_max_m_s", velocity_max_m_s)?,
            force_max_n: limit("force_max_n", force_max_n)?,
        };
        Ok(Self(Mutex::new(Cascade::new(gains, dt_s)), made))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.1.shown(py, "Cascade")
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().1.reduce(slf.get_type().as_any())
    }

    /// Return the force of this tick.
    ///
    /// Parameters
    /// ----------
    /// position_m : float
    ///     Reference position.
    /// actual_m, actual_m_s : float
    ///     Measured position and velocity.
    /// velocity_m_s, acceleration_m_s2 : float
    ///     Reference velocity and acceleration, for the feed-forward.
    /// learned_n : float
    ///     Learned force, added before the limit.
    ///
    /// Returns
    /// -------
    /// float
    ///     Force in N, within its limit.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If what comes out is not finite; nothing is then remembered.
    #[pyo3(signature = (position_m, actual_m, actual_m_s, velocity_m_s=0.0, acceleration_m_s2=0.0, learned_n=0.0))]
    fn step(
        &self,
        position_m: f64,
        actual_m: f64,
        actual_m_s: f64,
        velocity_m_s: f64,
        acceleration_m_s2: f64,
        learned_n: f64,
    ) -> PyResult<f64> {
        let reference = CascadeReference { position_m, velocity_m_s, acceleration_m_s2 };
        let force = held(&self.0).step(reference, actual_m, actual_m_s, learned_n);
        give("position_m, actual_m or another number", f64::NAN, force)
    }

    /// Start again from rest.
    fn reset(&self) {
        held(&self.0).reset();
    }
}

/// Cross-coupled control of two axes.
///
/// ``epsilon = c1 e1 + c2 e2``, ``w = PID(epsilon)``, ``u_i += c_i w``
///
/// Parameters
/// ----------
/// controller : Pid
///     Controller of the contour error; a copy of it is taken, at rest.
///
/// References
/// ----------
/// [koren1991]; [barton2010], Eq. (4.1).
///
/// Examples
/// --------
/// >>> from ilc_rt.control import CrossCoupled, Pid
/// >>> CrossCoupled(Pid(10.0, dt_s=0.001)).step([0.0, 0.5], [0.0, 1.0])
/// (array([0., 5.]), 0.5)
#[pyclass(name = "CrossCoupled", module = "ilc_rt.control", frozen)]
#[derive(Debug)]
struct PyCrossCoupled(Mutex<CrossCoupled>, Made);

#[pymethods]
impl PyCrossCoupled {
    #[new]
    fn new(controller: &Bound<'_, PyPid>) -> PyResult<Self> {
        let made = made!(controller);
        let mut pid = *held(&controller.get().pid);
        pid.reset();
        Ok(Self(Mutex::new(CrossCoupled::new(pid)), made))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.1.shown(py, "CrossCoupled")
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().1.reduce(slf.get_type().as_any())
    }

    /// Return what to add to the two commands, and the contour error.
    ///
    /// Parameters
    /// ----------
    /// error_m : sequence of 2 floats
    ///     Tracking errors.
    /// gains : sequence of 2 floats
    ///     Coupling gains, as `trajectory.coupling_gains` gives them.
    /// curvature_per_m : float
    ///     Curvature of the path, positive to the left: the gains then follow it.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (2,)
    ///     Corrections.
    /// float
    ///     Contour error in m.
    ///
    /// Raises
    /// ------
    /// ValueError, TypeError
    ///     If an array has the wrong shape, dtype or a number that is not finite.
    #[pyo3(signature = (error_m, gains, curvature_per_m=0.0))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        error_m: &Bound<'py, PyAny>,
        gains: &Bound<'py, PyAny>,
        curvature_per_m: f64,
    ) -> PyResult<(Bound<'py, PyAny>, f64)> {
        let (error_m, gains) = (read_pair("error_m", error_m)?, read_pair("gains", gains)?);
        finite("curvature_per_m", curvature_per_m)?;
        let gains = variable_gains([gains[1], -gains[0]], error_m, curvature_per_m);
        let (added, contour_m) = held(&self.0).step(error_m, gains);
        let added = added.iter().map(|part| part.value).collect();
        Ok((give_signal(py, added, 1, true)?, contour_m))
    }

    /// Start again from rest.
    fn reset(&self) {
        held(&self.0).reset();
    }
}

fn give(name: &str, value: f64, output: Bounded) -> PyResult<f64> {
    if output.finite { Ok(output.value) } else { finite(name, value).map(|()| output.value) }
}

fn finite(name: &str, value: f64) -> PyResult<()> {
    if value.is_finite() {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{name} = {value}; only finite numbers are allowed")))
}

fn positive(name: &str, value: f64) -> PyResult<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{name} = {value}; it must be finite and above 0")))
}

/// Reads a limit; none is infinite.
fn limit(name: &str, value: Option<f64>) -> PyResult<f64> {
    value.map_or(Ok(f64::INFINITY), |value| positive(name, value).map(|()| value))
}

fn read_pair(name: &str, object: &Bound<'_, PyAny>) -> PyResult<[f64; 2]> {
    match read_vector(name, object)?[..] {
        [first, second] => Ok([first, second]),
        ref other => Err(misfit(name, &[other.len()], "(2,)")),
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyPid>()?;
    module.add_class::<PyCascade>()?;
    module.add_class::<PyCrossCoupled>()
}

//! Controllers, tick by tick: the native side of `Pid`, `Cascade` and `CrossCoupled` of
//! `ilc_rt.control`.

use ilc_rt::control::{
    Bounded, Cascade, CascadeGains, CascadeReference, CrossCoupled, Derivative, Pid, PidGains,
    PidMatrices, variable_gains,
};
use ilc_rt::model::StateSpace;
use pyo3::prelude::*;

use crate::answer::{Array, give_signal, give_vector};
use crate::argument::{Matrix, Signal, read_pair};
use crate::arguments::{Arguments, read};
use crate::error::OrRaise;
use crate::guard::Guarded;
use crate::made::{Made, New, made};
use crate::model::PyStateSpace;
use crate::whole::{Real, finite, number};

#[pyclass(name = "Pid", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyPid {
    dt_s: f64,
    pid: Guarded<Pid>,
}

#[pymethods]
impl PyPid {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let (dt_s, time_constant_s) = (a.positive("dt_s")?, a.positive("filter_s")?);
        let derivatives = [
            ("difference", Derivative::Difference),
            ("delayed", Derivative::DelayedDifference),
            ("filtered", Derivative::Filtered { time_constant_s }),
        ];
        let gains = read!(a, PidGains:
            [finite => kp, ki_per_s, kd_s]
            [limit => output_max]
            derivative: a.choice("derivative", &derivatives)?,
        );
        made(a, Self { dt_s, pid: Guarded::new(Pid::new(gains, dt_s)) })
    }

    /// Return the output for the error of this tick, saturated (anti-windup).
    ///
    /// Raises ValueError if the error is not finite; the state is then unchanged.
    fn step(&self, py: Python<'_>, error: &Bound<'_, PyAny>) -> PyResult<f64> {
        let error = number("error", error)?;
        give("error", error, self.pid.borrow(py)?.step(error))
    }

    /// Return the outputs for a whole error signal of shape (n_samples,), from the current state.
    fn run<'py>(&self, error: &Bound<'py, PyAny>) -> Array<'py> {
        let mut signal = Signal::read("error", error)?.with_channels("error", 1)?;
        let mut pid = self.pid.borrow(error.py())?;
        for value in &mut signal.values {
            *value = pid.step(*value).value;
        }
        let Signal { values, layout } = signal;
        give_signal(error.py(), values, 1, layout.is_flat)
    }

    /// Return the controller without saturation, as a `StateSpace` from error to output.
    ///
    /// It has three states: the integral and two of the derivative.
    fn model(&self, py: Python<'_>) -> PyResult<PyStateSpace> {
        let PidMatrices { a, b, c, d } = self.pid.borrow(py)?.matrices();
        let model = StateSpace::new(
            Matrix::from_fn(3, 3, |row, col| a[row][col]),
            Matrix::from_fn(3, 1, |row, _| b[row]),
            Matrix::from_fn(1, 3, |_, col| c[col]),
            Matrix::from_element(1, 1, d),
            Some(self.dt_s),
        );
        Ok(PyStateSpace::from(model.or_raise()?))
    }

    /// Reset to rest.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.pid.borrow(py)?.reset();
        Ok(())
    }
}

#[pyclass(name = "Cascade", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyCascade(Guarded<Cascade>);

#[pymethods]
impl PyCascade {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let gains = read!(a, CascadeGains:
            [finite => position_gain_per_s, velocity_gain_n_s_m]
            [finite => velocity_feedforward, acceleration_feedforward_kg]
            [limit => integral_time_s, velocity_max_m_s, force_max_n]
        );
        made(a, Self(Guarded::new(Cascade::new(gains, a.positive("dt_s")?))))
    }

    /// Return the force of this tick in N, saturated.
    ///
    /// Reference position, measured position and velocity; reference velocity and acceleration for the
    /// feed-forward; learned force, added before the limit. Raises ValueError if the force is not finite;
    /// nothing is then remembered.
    #[pyo3(signature = (position_m, actual_m, actual_m_s, velocity_m_s=Real(0.0), acceleration_m_s2=Real(0.0), learned_n=Real(0.0)),
           text_signature = "($self, position_m, actual_m, actual_m_s, velocity_m_s=0.0, acceleration_m_s2=0.0, learned_n=0.0)")]
    #[expect(clippy::too_many_arguments, reason = "all but the first are named in Python")]
    fn step(
        &self,
        py: Python<'_>,
        position_m: Real,
        actual_m: Real,
        actual_m_s: Real,
        velocity_m_s: Real,
        acceleration_m_s2: Real,
        learned_n: Real,
    ) -> PyResult<f64> {
        let reference = CascadeReference {
            position_m: position_m.0,
            velocity_m_s: velocity_m_s.0,
            acceleration_m_s2: acceleration_m_s2.0,
        };
        let force = self.0.borrow(py)?.step(reference, actual_m.0, actual_m_s.0, learned_n.0);
        give("position_m, actual_m or another number", f64::NAN, force)
    }

    /// Reset to rest.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.0.borrow(py)?.reset();
        Ok(())
    }
}

#[pyclass(name = "CrossCoupled", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyCrossCoupled(Guarded<CrossCoupled>);

#[pymethods]
impl PyCrossCoupled {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let controller = a.get("controller")?;
        let mut pid = *controller.cast::<PyPid>()?.get().pid.borrow(a.py())?;
        pid.reset();
        made(a, Self(Guarded::new(CrossCoupled::new(pid))))
    }

    /// Return the corrections of the two commands, shape (2,), and the contour error in m.
    ///
    /// Two tracking errors in m; coupling gains, as `trajectory.coupling_gains` gives them; curvature of the
    /// path, positive to the left, which the gains then follow.
    #[pyo3(signature = (error_m, gains, curvature_per_m=Real(0.0)),
           text_signature = "($self, error_m, gains, curvature_per_m=0.0)")]
    fn step<'py>(
        &self,
        py: Python<'py>,
        error_m: &Bound<'py, PyAny>,
        gains: &Bound<'py, PyAny>,
        curvature_per_m: Real,
    ) -> PyResult<(Bound<'py, PyAny>, f64)> {
        let (error_m, gains) = (read_pair("error_m", error_m)?, read_pair("gains", gains)?);
        let curvature_per_m = finite("curvature_per_m", curvature_per_m.0)?;
        let gains = variable_gains([gains[1], -gains[0]], error_m, curvature_per_m);
        let (added, contour_m) = self.0.borrow(py)?.step(error_m, gains);
        let added: Vec<f64> = added.iter().map(|part| part.value).collect();
        Ok((give_vector(py, added), contour_m))
    }

    /// Reset to rest.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        self.0.borrow(py)?.reset();
        Ok(())
    }
}

fn give(name: &str, value: f64, output: Bounded) -> PyResult<f64> {
    if output.finite { Ok(output.value) } else { finite(name, value).map(|_| output.value) }
}

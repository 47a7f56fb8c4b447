//! `ThroughJacobian`.

use std::sync::Mutex;

use ilc_rt::learning::Law;
use ilc_rt::learning::law::through_jacobian::ThroughJacobian;
use pyo3::prelude::*;

use super::inner::{InnerLaw, look, shown};
use super::next;
use crate::argument::{Signal, give_signal};
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::weights::read_matrices;

/// Learn in the joints from errors at the tool, with any law.
///
/// ``e_joint[k] = pinv(J_k) e_tool[k]``
///
/// Parameters
/// ----------
/// law : object
///     A law of the joints: one of this package, or an object with
///     ``update(u, e, disturbance)``.
/// jacobian : ndarray of float64, shape (n_coordinates, n_joints) or \
/// (n_samples, n_coordinates, n_joints)
///     What joint motion does to the tool, as `Delta.jacobian` returns it; one
///     matrix for runs of any length, or one a sample. Several mechanisms side
///     by side have theirs on the diagonal.
///
/// Raises
/// ------
/// LearningError
///     If a Jacobian is singular: its largest singular value may be 1e6 times
///     the smallest.
/// ValueError, TypeError
///     If the array has the wrong shape, dtype or a number that is not finite,
///     or `law` is no law.
///
/// Notes
/// -----
/// The law sees errors of the joints. To weigh errors at the tool by Q, give a
/// norm-optimal law of the joints ``q = J.T @ Q @ J``; for a constant square J
/// this is the law of the model ``J P``.
///
/// References
/// ----------
/// [barton2010], Eq. (8.1), (8.5) to (8.7).
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from ilc_rt import PdIlc, ThroughJacobian
/// >>> law = ThroughJacobian(PdIlc(kp=1.0, kd=0.0, lead=0), [[2.0, 0.0], [0.0, 4.0]])
/// >>> law.update(np.zeros((3, 2)), np.ones((3, 2)))[0]
/// array([0.5 , 0.25])
#[pyclass(name = "ThroughJacobian", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(super) struct PyThroughJacobian {
    made: Made,
    /// The law inside.
    #[pyo3(get)]
    law: Py<PyAny>,
    n_joints: usize,
    n_coordinates: usize,
    through: Mutex<ThroughJacobian<InnerLaw>>,
}

#[pymethods]
impl PyThroughJacobian {
    #[new]
    fn new(law: &Bound<'_, PyAny>, jacobian: &Bound<'_, PyAny>) -> PyResult<Self> {
        let made = made!(law, jacobian);
        let jacobians = read_matrices("jacobian", jacobian)?;
        let through = ThroughJacobian::new(InnerLaw::new(law)?, &jacobians).or_raise()?;
        let (n_joints, n_coordinates) = through.shape();
        let law = law.clone().unbind();
        Ok(Self { made, law, n_joints, n_coordinates, through: Mutex::new(through) })
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Number of joints: channels of the input.
    #[getter]
    fn n_joints(&self) -> usize {
        self.n_joints
    }

    /// Number of coordinates of the tool: channels of the error.
    #[getter]
    fn n_coordinates(&self) -> usize {
        self.n_coordinates
    }

    /// Return the input of the next run.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n_samples, n_joints)
    ///     Input of the run, in the unit of the joints.
    /// e : ndarray of float64, shape (n_samples, n_coordinates)
    ///     Error of the run at the tool, reference minus measurement, in m.
    /// disturbance : object
    ///     Handed on to the law inside.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, same shape as `u`
    ///     Input of the next run.
    ///
    /// Raises
    /// ------
    /// LearningError
    ///     If there are Jacobians for another number of samples.
    /// ValueError, TypeError
    ///     If an array has the wrong shape, dtype or a number that is not finite.
    /// Exception
    ///     Whatever the law inside raises.
    #[pyo3(signature = (u, e, disturbance=None))]
    fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let u = Signal::read("u", u)?.with_channels("u", self.n_joints)?;
        let e = Signal::read("e", e)?
            .with_samples("e", u.n_samples)?
            .with_channels("e", self.n_coordinates)?;
        let disturbance = disturbance.map(|given| given.clone().unbind());
        // What the law inside learns from has the shape of the input.
        let joints = (self.n_joints, u.is_flat);
        let (result, raised) = look(py, &self.through, |through| {
            through.law_mut().prepare_shapes(joints, joints, disturbance);
            let result = next(through, &u, &e);
            (result, through.law_mut().take_raised())
        });
        match raised {
            Some(raised) => Err(raised),
            None => give_signal(py, result.or_raise()?, self.n_joints, u.is_flat),
        }
    }

    /// Forget every run; the law inside too.
    fn reset(&self, py: Python<'_>) {
        look(py, &self.through, Law::reset);
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!(
            "ThroughJacobian({}, {} coordinates, {} joints)",
            shown(py, &self.through)?,
            self.n_coordinates,
            self.n_joints
        ))
    }
}

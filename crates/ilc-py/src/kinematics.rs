//! Mechanisms: the native side of `Delta` and `Gantry` of `ilc_rt.kinematics`.

use ilc_rt::kinematics::{Delta, Gantry, KinematicsError};
use pyo3::prelude::*;

use crate::answer::{Array, give_matrices, give_matrix, give_signal};
use crate::argument::{Matrix, Signal, misfit};
use crate::arguments::Arguments;
use crate::error::OrRaise;
use crate::exceptions;
use crate::made::{Made, New, made};

#[pyclass(name = "Delta", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyDelta {
    delta: Delta,
    /// Base radius in m.
    #[pyo3(get)]
    base_m: f64,
    /// Crank length in m.
    #[pyo3(get)]
    crank_m: f64,
    /// Rod length in m.
    #[pyo3(get)]
    rod_m: f64,
}

#[pymethods]
impl PyDelta {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let (base_m, crank_m, rod_m) =
            (a.number("base_m")?, a.number("crank_m")?, a.number("rod_m")?);
        let delta = Delta::new(base_m, crank_m, rod_m).or_raise()?;
        made(a, Self { delta, base_m, crank_m, rod_m })
    }

    /// Return tool positions in m for crank angles in rad: both (3,) or (n_samples, 3).
    fn forward<'py>(&self, theta_rad: &Bound<'py, PyAny>) -> Array<'py> {
        let poses = Poses::read("theta_rad", theta_rad)?;
        poses.mapped(theta_rad.py(), |joints| self.delta.forward(joints))
    }

    /// Return crank angles in rad, knees outward, for tool positions in m: both (3,) or (n_samples, 3).
    fn inverse<'py>(&self, p_m: &Bound<'py, PyAny>) -> Array<'py> {
        Poses::read("p_m", p_m)?.mapped(p_m.py(), |pose| self.delta.inverse(pose))
    }

    /// Return Jacobians ``dp = J dtheta`` in m/rad for crank angles: (3, 3) or (n_samples, 3, 3).
    fn jacobian<'py>(&self, theta_rad: &Bound<'py, PyAny>) -> Array<'py> {
        let poses = Poses::read("theta_rad", theta_rad)?;
        let found = poses.each(|joints| self.delta.jacobian(joints))?;
        if poses.is_single {
            return Ok(give_matrix(theta_rad.py(), &square(&found[0])));
        }
        let shape = (found.len(), 3, 3);
        Ok(give_matrices(theta_rad.py(), shape, |k, row, col| found[k][row][col]))
    }

    /// Return True if the tool can reach a place in m, shape (3,), and leave it in every direction.
    fn in_workspace(&self, p_m: &Bound<'_, PyAny>) -> PyResult<bool> {
        let poses = Poses::read("p_m", p_m)?;
        Ok(poses.values.iter().all(|pose| self.delta.is_in_workspace(*pose)))
    }

    /// Return the condition number of the Jacobian for crank angles in rad, shape (3,); 1 is
    /// isotropic.
    fn condition(&self, theta_rad: &Bound<'_, PyAny>) -> PyResult<f64> {
        let poses = Poses::read("theta_rad", theta_rad)?;
        if !poses.is_single {
            return Err(misfit("theta_rad", &[poses.values.len(), 3], "(3,)"));
        }
        self.delta.condition(poses.values[0]).or_raise()
    }
}

#[pyclass(name = "Gantry", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyGantry {
    gantry: Gantry,
    /// Orthogonality error in rad.
    #[pyo3(get)]
    orthogonality_rad: f64,
}

#[pymethods]
impl PyGantry {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let orthogonality_rad = a.number("orthogonality_rad")?;
        let gantry = Gantry::new(orthogonality_rad).or_raise()?;
        made(a, Self { gantry, orthogonality_rad })
    }

    /// Return tool positions for axis positions in m: both (2,) or (n_samples, 2).
    fn forward<'py>(&self, axes_m: &Bound<'py, PyAny>) -> Array<'py> {
        Poses::read("axes_m", axes_m)?.mapped(axes_m.py(), |axes| Ok(self.gantry.forward(axes)))
    }

    /// Return axis positions for tool positions in m: both (2,) or (n_samples, 2).
    fn inverse<'py>(&self, tool_m: &Bound<'py, PyAny>) -> Array<'py> {
        Poses::read("tool_m", tool_m)?.mapped(tool_m.py(), |tool| Ok(self.gantry.inverse(tool)))
    }

    /// Return the Jacobian, shape (2, 2), the same everywhere.
    fn jacobian<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        give_matrix(py, &square(&self.gantry.jacobian()))
    }
}

/// `N` coordinates, or as many per sample.
struct Poses<const N: usize> {
    values: Vec<[f64; N]>,
    is_single: bool,
}

impl<const N: usize> Poses<N> {
    fn read(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let signal = Signal::read(name, object)?;
        let is_single = signal.is_flat;
        let coordinates = if is_single { signal.n_samples } else { signal.n_channels };
        if coordinates != N {
            return Err(misfit(name, &signal.shape(), &format!("({N},) or (n_samples, {N})")));
        }
        Ok(Self { values: signal.values.as_chunks().0.to_vec(), is_single })
    }

    /// Applies a map of one pose to all; an error names the sample.
    fn each<T>(&self, map: impl Fn([f64; N]) -> Result<T, KinematicsError>) -> PyResult<Vec<T>> {
        let mapped = |(sample, pose): (usize, &[f64; N])| {
            map(*pose).map_err(|error| {
                let place =
                    if self.is_single { String::new() } else { format!("sample {sample}: ") };
                exceptions::KinematicsError::new_err(format!("{place}{error}"))
            })
        };
        self.values.iter().enumerate().map(mapped).collect()
    }

    /// Returns the mapped poses to Python, in the same shape.
    fn mapped(
        self,
        py: Python<'_>,
        map: impl Fn([f64; N]) -> Result<[f64; N], KinematicsError>,
    ) -> Array<'_> {
        give_signal(py, self.each(map)?.concat(), N, self.is_single)
    }
}

fn square<const N: usize>(rows: &[[f64; N]; N]) -> Matrix {
    Matrix::from_fn(N, N, |row, col| rows[row][col])
}

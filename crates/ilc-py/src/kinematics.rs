//! Mechanisms: the native side of `Delta` and `Gantry` of `ilc_rt.kinematics`.

use ilc_rt::kinematics::{Delta, Gantry, KinematicsError};
use numpy::IntoPyArray;
use numpy::ndarray::{Array2, Array3};
use pyo3::prelude::*;

use crate::argument::{Signal, give_signal, misfit};
use crate::arguments::{Arguments, Keywords};
use crate::error::OrRaise;
use crate::exceptions;
use crate::made::Made;

#[pyclass(name = "Delta", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyDelta {
    made: Made,
    delta: Delta,
}

#[pymethods]
impl PyDelta {
    #[new]
    #[pyo3(signature = (**keywords))]
    fn new(keywords: Option<Keywords<'_, '_>>) -> PyResult<Self> {
        let a = Arguments::of(keywords)?;
        let delta = Delta::new(a.number("base_m")?, a.number("crank_m")?, a.number("rod_m")?);
        Ok(Self { made: Made::of(a)?, delta: delta.or_raise()? })
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Base radius in m.
    #[getter]
    fn base_m(&self) -> f64 {
        self.delta.lengths_m()[0]
    }

    /// Crank length in m.
    #[getter]
    fn crank_m(&self) -> f64 {
        self.delta.lengths_m()[1]
    }

    /// Rod length in m.
    #[getter]
    fn rod_m(&self) -> f64 {
        self.delta.lengths_m()[2]
    }

    /// Return tool positions in m for crank angles in rad: both (3,) or (n_samples, 3).
    fn forward<'py>(
        &self,
        py: Python<'py>,
        theta_rad: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut poses = Poses::read("theta_rad", theta_rad)?;
        poses.each(|joints| self.delta.forward(joints))?;
        poses.give(py)
    }

    /// Return crank angles in rad, knees outward, for tool positions in m: both (3,) or (n_samples, 3).
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        p_m: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut poses = Poses::read("p_m", p_m)?;
        poses.each(|pose| self.delta.inverse(pose))?;
        poses.give(py)
    }

    /// Return Jacobians ``dp = J dtheta`` in m/rad for crank angles: (3, 3) or (n_samples, 3, 3).
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        theta_rad: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let poses = Poses::read("theta_rad", theta_rad)?;
        let mut rows = Vec::with_capacity(poses.values.len());
        for (sample, joints) in poses.values.iter().enumerate() {
            let jacobian = self.delta.jacobian(*joints);
            rows.push(jacobian.map_err(|error| poses.raise(&error, sample))?);
        }
        if poses.is_single {
            let jacobian = Array2::from_shape_fn((3, 3), |(row, col)| rows[0][row][col]);
            return Ok(jacobian.into_pyarray(py).into_any());
        }
        let jacobians =
            Array3::from_shape_fn((rows.len(), 3, 3), |(k, row, col)| rows[k][row][col]);
        Ok(jacobians.into_pyarray(py).into_any())
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

    fn __repr__(&self) -> String {
        let [base_m, crank_m, rod_m] = self.delta.lengths_m();
        format!("Delta(base_m={base_m}, crank_m={crank_m}, rod_m={rod_m})")
    }
}

#[pyclass(name = "Gantry", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyGantry {
    made: Made,
    gantry: Gantry,
}

#[pymethods]
impl PyGantry {
    #[new]
    #[pyo3(signature = (**keywords))]
    fn new(keywords: Option<Keywords<'_, '_>>) -> PyResult<Self> {
        let a = Arguments::of(keywords)?;
        let gantry = Gantry::new(a.number("orthogonality_rad")?).or_raise()?;
        Ok(Self { made: Made::of(a)?, gantry })
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Orthogonality error in rad.
    #[getter]
    fn orthogonality_rad(&self) -> f64 {
        self.gantry.orthogonality_rad()
    }

    /// Return tool positions for axis positions in m: both (2,) or (n_samples, 2).
    fn forward<'py>(
        &self,
        py: Python<'py>,
        axes_m: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        pairs(py, "axes_m", axes_m, |axes| self.gantry.forward(axes))
    }

    /// Return axis positions for tool positions in m: both (2,) or (n_samples, 2).
    fn inverse<'py>(
        &self,
        py: Python<'py>,
        tool_m: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        pairs(py, "tool_m", tool_m, |tool| self.gantry.inverse(tool))
    }

    /// Return the Jacobian, shape (2, 2), the same everywhere.
    fn jacobian<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        let rows = self.gantry.jacobian();
        Array2::from_shape_fn((2, 2), |(row, col)| rows[row][col]).into_pyarray(py).into_any()
    }

    fn __repr__(&self) -> String {
        format!("Gantry(orthogonality_rad={})", self.gantry.orthogonality_rad())
    }
}

/// One triple, or one per sample.
struct Poses {
    values: Vec<[f64; 3]>,
    is_single: bool,
}

impl Poses {
    fn read(name: &str, object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let signal = Signal::read(name, object)?;
        let is_single = signal.is_flat;
        let coordinates = if is_single { signal.n_samples } else { signal.n_channels };
        if coordinates != 3 {
            return Err(misfit(name, &signal.shape(), "(3,) or (n_samples, 3)"));
        }
        Ok(Self { values: signal.values.as_chunks().0.to_vec(), is_single })
    }

    fn each(
        &mut self,
        map: impl Fn([f64; 3]) -> Result<[f64; 3], KinematicsError>,
    ) -> PyResult<()> {
        for sample in 0..self.values.len() {
            let mapped = map(self.values[sample]);
            self.values[sample] = mapped.map_err(|error| self.raise(&error, sample))?;
        }
        Ok(())
    }

    fn raise(&self, error: &KinematicsError, sample: usize) -> PyErr {
        let place = if self.is_single { String::new() } else { format!("sample {sample}: ") };
        exceptions::KinematicsError::new_err(format!("{place}{error}"))
    }

    fn give(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        give_signal(py, self.values.concat(), 3, self.is_single)
    }
}

fn pairs<'py>(
    py: Python<'py>,
    name: &str,
    object: &Bound<'py, PyAny>,
    map: impl Fn([f64; 2]) -> [f64; 2],
) -> PyResult<Bound<'py, PyAny>> {
    let signal = Signal::read(name, object)?;
    let coordinates = if signal.is_flat { signal.n_samples } else { signal.n_channels };
    if coordinates != 2 {
        return Err(misfit(name, &signal.shape(), "(2,) or (n_samples, 2)"));
    }
    let mapped: Vec<f64> = signal.values.as_chunks().0.iter().flat_map(|pair| map(*pair)).collect();
    give_signal(py, mapped, 2, signal.is_flat)
}

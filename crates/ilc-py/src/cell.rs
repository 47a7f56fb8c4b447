//! The cell description: `Cell`.

use std::path::Path;

use ilc_rt::config::{Axis, Cell, mode};
use ilc_rt::design::{self, Plan};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::answer::{Array, by_name, give_signal, give_vector};
use crate::error::OrRaise;
use crate::made::Made;
use crate::model::PyStateSpace;

/// A validated cell description.
///
/// Attributes are those of the file; `reference` returns the set points of a run.
///
/// Examples
/// --------
/// >>> from ilc_rt import Cell
/// >>> cell = Cell.load("examples/01_gantry.toml")
/// >>> cell.n_axes
/// 2
#[pyclass(name = "Cell", module = "ilc_rt", extends = Made, frozen)]
#[derive(Debug)]
pub(crate) struct PyCell {
    pub(crate) cell: Cell,
    reference_m: Vec<f64>,
    /// Name of the cell.
    #[pyo3(get)]
    name: String,
    /// Path of the file that it was read from.
    #[pyo3(get)]
    path: String,
    /// Servo cycle in seconds.
    #[pyo3(get)]
    cycle_s: f64,
    /// Samples in a run.
    #[pyo3(get)]
    n_samples: usize,
    /// Number of axes.
    #[pyo3(get)]
    n_axes: usize,
    /// Names of the axes, in the order of the coordinates.
    #[pyo3(get)]
    axis_names: Vec<String>,
    /// Command interface of each axis: `csp`, `csv` or `cst`.
    #[pyo3(get)]
    interfaces: Vec<&'static str>,
    /// Quantity that the learned input of each axis is added to: `position` (in m), `velocity` (in m/s)
    /// or `torque` (in N).
    #[pyo3(get)]
    inputs: Vec<&'static str>,
    /// Bound of the learned input of each axis: its key in `[learning]`, and the value.
    #[pyo3(get)]
    input_bounds: Vec<(&'static str, f64)>,
    /// Unit in which the weights of a law count the learned input of each axis, per unit of that input: the
    /// travel in metres that a newton holds if it learns a torque, 1 otherwise.
    #[pyo3(get)]
    input_scales: Vec<f64>,
    /// Natural frequency of the position loop of each axis in Hz, by its model.
    #[pyo3(get)]
    natural_frequencies_hz: Vec<f64>,
    /// Unit of the position of each axis: `m`, or `rad` for a rotary one.
    #[pyo3(get)]
    axis_units: Vec<&'static str>,
    /// Position gain kv of each axis in 1/s; None if the loop is in the drive.
    #[pyo3(get)]
    position_gains_per_s: Vec<Option<f64>>,
    /// Bus address.
    #[pyo3(get)]
    bus: String,
    /// Measurement to learn from: `encoder` or `tcp`.
    #[pyo3(get)]
    measure: &'static str,
    /// Name of the law, as in `[learning] law`.
    #[pyo3(get)]
    law: &'static str,
    /// Warnings of the analysis of the law, which may start nevertheless.
    #[pyo3(get)]
    warnings: Vec<String>,
}

#[pymethods]
impl PyCell {
    /// Read a cell description from a TOML file.
    ///
    /// - path : str or os.PathLike: The file.
    /// - allow_divergent : bool: Accept a law that does not converge with the cell's model, even if
    ///   the file does not.
    ///
    /// Returns Cell. Raises ValueError in one line: file, key, value and the allowed values.
    #[staticmethod]
    #[pyo3(signature = (path, allow_divergent=false))]
    fn load(
        py: Python<'_>,
        path: std::path::PathBuf,
        allow_divergent: bool,
    ) -> PyResult<Bound<'_, Self>> {
        let arguments = by_name!(py, path: &path, allow_divergent: allow_divergent);
        let mut cell = Cell::load(Path::new(&path)).or_raise()?;
        cell.learning.allow_divergent |= allow_divergent;
        let plan = Plan::new(&cell, None, false).or_raise()?;
        // Refuses a model or weights that cannot learn, before any drive is touched.
        let warnings = plan.law(&cell).or_raise()?.warnings;
        let made = PyClassInitializer::from(Made::by("load", &arguments));
        Bound::new(py, made.add_subclass(Self::of(cell, plan, warnings)))
    }

    /// Refuse a text that `load` would refuse as the contents of this file.
    ///
    /// A diverging law is accepted.
    #[staticmethod]
    fn _check(text: &str, path: std::path::PathBuf) -> PyResult<()> {
        let mut cell = Cell::parse(text, &path.display().to_string()).or_raise()?;
        cell.learning.allow_divergent = true;
        Plan::new(&cell, None, false).or_raise()?.law(&cell).or_raise().map(drop)
    }

    /// Return the set points of a run, as sent by the loop.
    ///
    /// Returns ndarray of float64, shape (n_samples, n_axes): Positions in metres.
    fn reference<'py>(&self, py: Python<'py>) -> Array<'py> {
        give_signal(py, self.reference_m.clone(), self.n_axes, false)
    }

    /// Return the model that learning uses, from learned input to position.
    ///
    /// Returns StateSpace: Inputs in the unit of each axis's interface, positions in metres.
    fn model(&self) -> PyResult<PyStateSpace> {
        design::learning_model(&self.cell).or_raise().map(PyStateSpace::from)
    }

    /// Return the error of a run without learning, by the model.
    ///
    /// Returns ndarray of float64, shape (n_samples, n_axes): Set point minus response in metres.
    fn first_error<'py>(&self, py: Python<'py>) -> Array<'py> {
        let error = design::first_error(&self.cell, &self.reference_m).or_raise()?;
        give_signal(py, error, self.n_axes, false)
    }

    /// Return an axis that differs from its model, for trials of weights.
    ///
    /// - axis : int: Its index.
    /// - frequency : float: Factor of the natural frequency (csp), of the velocity bandwidth (csv), or of the
    ///   natural frequency by another mass (cst).
    /// - damping : float: Factor of the damping (csp).
    /// - delay : int: Cycles in addition to `delay_samples`.
    ///
    /// Returns tuple of StateSpace and ndarray of float64, shape (n_samples,): The model from the learned
    /// input, counted by `input_scales`, to the position, and the way of a run without learning. Raises
    /// ValueError for factors that give no model.
    #[pyo3(signature = (axis, frequency=1.0, damping=1.0, delay=0))]
    fn perturbed<'py>(
        &self,
        py: Python<'py>,
        axis: usize,
        frequency: f64,
        damping: f64,
        delay: i64,
    ) -> PyResult<(PyStateSpace, Bound<'py, PyAny>)> {
        if axis >= self.n_axes {
            let message = format!("axis = {axis}; 0 to {} is needed", self.n_axes - 1);
            return Err(PyValueError::new_err(message));
        }
        let factors = [frequency, damping];
        if !factors.iter().all(|factor| factor.is_finite() && *factor > 0.0) {
            let message = format!("factors = {frequency}, {damping}; positive numbers are needed");
            return Err(PyValueError::new_err(message));
        }
        let (model, way_m) =
            design::perturbed_axis(&self.cell, &self.reference_m, axis, factors, delay)
                .or_raise()?;
        Ok((PyStateSpace::from(model), give_vector(py, way_m)))
    }

    fn __repr__(&self) -> String {
        format!("Cell({:?}, {} axes, {})", self.name, self.n_axes, self.bus)
    }
}

impl PyCell {
    fn of(cell: Cell, plan: Plan, warnings: Vec<String>) -> Self {
        fn each<T>(cell: &Cell, of: impl Fn(&Axis) -> T) -> Vec<T> {
            cell.axes.iter().map(of).collect()
        }
        let bound = |axis: &Axis| {
            let input = axis.input_kind();
            (mode::bound_key(input), mode::bound_of(input, &cell.learning))
        };
        let natural_hz = |axis: &Axis| mode::of(axis.interface).natural_frequency_hz(axis);
        let gain_per_s = |axis: &Axis| axis.position_loop.map(|of_axis| of_axis.gain_per_s);
        Self {
            n_samples: plan.n_samples(),
            reference_m: plan.reference_m,
            name: cell.cell.name.clone(),
            path: cell.file.display().to_string(),
            cycle_s: cell.cycle_s(),
            n_axes: cell.n_axes(),
            axis_names: each(&cell, |axis| axis.name.clone()),
            interfaces: each(&cell, |axis| axis.interface.name()),
            inputs: each(&cell, |axis| axis.input_kind().name()),
            input_bounds: each(&cell, bound),
            input_scales: each(&cell, mode::scale_of),
            natural_frequencies_hz: each(&cell, natural_hz),
            axis_units: each(&cell, |axis| axis.unit.symbol()),
            position_gains_per_s: each(&cell, gain_per_s),
            bus: cell.bus.address.clone(),
            measure: cell.learning.measure.name(),
            law: cell.learning.law.as_str(),
            warnings,
            cell,
        }
    }
}

//! The cell description: `Cell`.

use std::path::Path;

use ilc_rt::config::{Axis, Cell, Measure, mode};
use ilc_rt::design::{self, Plan};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::give_signal;
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
#[pyclass(name = "Cell", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyCell {
    made: Made,
    pub(crate) cell: Cell,
    reference_m: Vec<f64>,
    n_samples: usize,
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
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn load(path: std::path::PathBuf, allow_divergent: bool) -> PyResult<Self> {
        let made = Made::new("load", |call| {
            call.set_item("path", &path)?;
            call.set_item("allow_divergent", allow_divergent)
        })?;
        let mut cell = Cell::load(Path::new(&path)).or_raise()?;
        cell.learning.allow_divergent |= allow_divergent;
        let plan = Plan::new(&cell, None, false).or_raise()?;
        // Refuses a model or weights that cannot learn, before any drive is touched.
        let warnings = plan.law(&cell).or_raise()?.warnings;
        Ok(Self {
            made,
            n_samples: plan.n_samples(),
            reference_m: plan.reference_m,
            cell,
            warnings,
        })
    }

    /// Refuse a text that `load` would refuse as the contents of this file.
    ///
    /// A diverging law is accepted.
    #[staticmethod]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn _check(text: &str, path: std::path::PathBuf) -> PyResult<()> {
        let mut cell = Cell::parse(text, &path.display().to_string()).or_raise()?;
        cell.learning.allow_divergent = true;
        Plan::new(&cell, None, false).or_raise()?.law(&cell).or_raise().map(drop)
    }

    /// Pickled and copied as the file that it is read from.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Name of the cell.
    #[getter]
    fn name(&self) -> &str {
        &self.cell.cell.name
    }

    /// Path of the file that it was read from.
    #[getter]
    fn path(&self) -> String {
        self.cell.file.display().to_string()
    }

    /// Servo cycle in seconds.
    #[getter]
    fn cycle_s(&self) -> f64 {
        self.cell.cycle_s()
    }

    /// Samples in a run.
    #[getter]
    fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Number of axes.
    #[getter]
    fn n_axes(&self) -> usize {
        self.cell.n_axes()
    }

    /// Names of the axes, in the order of the coordinates.
    #[getter]
    fn axis_names(&self) -> Vec<String> {
        self.cell.axes.iter().map(|axis| axis.name.clone()).collect()
    }

    /// Command interface of each axis: `csp`, `csv` or `cst`.
    #[getter]
    fn interfaces(&self) -> Vec<&'static str> {
        let name = |axis: &Axis| axis.interface.name();
        self.cell.axes.iter().map(name).collect()
    }

    /// Quantity that the learned input of each axis is added to: `position` (in m), `velocity` (in m/s)
    /// or `torque` (in N).
    #[getter]
    fn inputs(&self) -> Vec<&'static str> {
        self.cell.axes.iter().map(|axis| axis.input_kind().name()).collect()
    }

    /// Bound of the learned input of each axis: its key in `[learning]`, and the value.
    #[getter]
    fn input_bounds(&self) -> Vec<(&'static str, f64)> {
        let bound = |axis: &Axis| {
            let input = axis.input_kind();
            (mode::bound_key(input), mode::bound_of(input, &self.cell.learning))
        };
        self.cell.axes.iter().map(bound).collect()
    }

    /// Unit in which the weights of a law count the learned input of each axis, per unit of that input: the
    /// travel in metres that a newton holds if it learns a torque, 1 otherwise.
    #[getter]
    fn input_scales(&self) -> Vec<f64> {
        self.cell.axes.iter().map(mode::scale_of).collect()
    }

    /// Natural frequency of the position loop of each axis in Hz, by its model.
    #[getter]
    fn natural_frequencies_hz(&self) -> Vec<f64> {
        let of = |axis: &Axis| mode::of(axis.interface).natural_frequency_hz(axis);
        self.cell.axes.iter().map(of).collect()
    }

    /// Unit of the position of each axis: `m`, or `rad` for a rotary one.
    #[getter]
    fn axis_units(&self) -> Vec<&'static str> {
        self.cell.axes.iter().map(|axis| axis.unit.symbol()).collect()
    }

    /// Position gain kv of each axis in 1/s; None if the loop is in the drive.
    #[getter]
    fn position_gains_per_s(&self) -> Vec<Option<f64>> {
        let gain = |axis: &Axis| axis.position_loop.map(|position_loop| position_loop.gain_per_s);
        self.cell.axes.iter().map(gain).collect()
    }

    /// Bus address.
    #[getter]
    fn bus(&self) -> &str {
        &self.cell.bus.address
    }

    /// Measurement to learn from: `encoder` or `tcp`.
    #[getter]
    fn measure(&self) -> &'static str {
        match self.cell.learning.measure {
            Measure::Encoder => "encoder",
            Measure::Tcp => "tcp",
        }
    }

    /// Name of the law, as in `[learning] law`.
    #[getter]
    fn law(&self) -> &'static str {
        self.cell.learning.law.as_str()
    }

    /// Warnings of the analysis of the law, which may start nevertheless.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Return the set points of a run, as sent by the loop.
    ///
    /// Returns ndarray of float64, shape (n_samples, n_axes): Positions in metres.
    fn reference<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_signal(py, self.reference_m.clone(), self.cell.n_axes(), false)
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
    fn first_error<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let error = design::first_error(&self.cell, &self.reference_m).or_raise()?;
        give_signal(py, error, self.cell.n_axes(), false)
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
        if axis >= self.cell.n_axes() {
            let message = format!("axis = {axis}; 0 to {} is needed", self.cell.n_axes() - 1);
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
        Ok((PyStateSpace::from(model), give_signal(py, way_m, 1, true)?))
    }

    fn __repr__(&self) -> String {
        format!("Cell({:?}, {} axes, {})", self.name(), self.n_axes(), self.bus())
    }
}

//! The iteration library: `Library`.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use ilc_rt::library::{Library, Row};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::give_signal;
use crate::detached::detached;
use crate::error::OrRaise;

/// Every run of every campaign, in one SQLite file.
///
/// Parameters
/// ----------
/// path : str or os.PathLike
///     The file; it is made if it is not there.
///
/// Raises
/// ------
/// OSError
///     If the file cannot be opened or is no library.
///
/// Examples
/// --------
/// >>> from ilc_rt import Library
/// >>> Library(":memory:").list()
/// []
#[pyclass(name = "Library", module = "ilc_rt", frozen)]
#[derive(Debug)]
struct PyLibrary {
    library: Mutex<Library>,
}

#[pymethods]
impl PyLibrary {
    #[new]
    #[expect(clippy::needless_pass_by_value, reason = "extracted from Python")]
    fn new(path: PathBuf) -> PyResult<Self> {
        Ok(Self { library: Mutex::new(Library::open(&path).or_raise()?) })
    }

    /// Return the runs kept, oldest first, without their arrays.
    ///
    /// Parameters
    /// ----------
    /// cell : str or None
    ///     Only runs of the cell of this name.
    ///
    /// Returns
    /// -------
    /// list of dict
    ///     Provenance and figures of each run; lengths in metres.
    ///
    /// Raises
    /// ------
    /// OSError
    ///     If the file cannot be read.
    #[pyo3(signature = (cell=None))]
    fn list<'py>(&self, py: Python<'py>, cell: Option<&str>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = detached(py, || self.lock().list(None)).or_raise()?;
        rows.iter()
            .filter(|row| cell.is_none_or(|name| row.meta.cell == name))
            .map(|row| describe(py, row))
            .collect()
    }

    /// Return one run with its arrays.
    ///
    /// Parameters
    /// ----------
    /// id : int
    ///     Key of the run, as `list` gives it.
    ///
    /// Returns
    /// -------
    /// dict
    ///     What `list` gives, and ``law_parameters`` and ``program`` (JSON),
    ///     ``reference_m``, ``input``, ``encoder_m``, ``tool_m`` (or None),
    ///     ``error_m`` of shape (n_samples, n_axes), ``contour_m`` of shape
    ///     (n_samples,), ``disturbance`` (None: none is measured).
    ///
    /// Raises
    /// ------
    /// OSError
    ///     If there is no such run, or its arrays do not match their digest.
    fn load<'py>(&self, py: Python<'py>, id: i64) -> PyResult<Bound<'py, PyDict>> {
        let row = detached(py, || self.lock().load(id)).or_raise()?;
        let run = describe(py, &row)?;
        let n_axes = row.meta.n_axes;
        let record = row.record;
        let signal = |values| give_signal(py, values, n_axes, false);
        run.set_item("law_parameters", &row.meta.law_parameters)?;
        run.set_item("program", &row.meta.program)?;
        run.set_item("reference_m", signal(record.reference_m)?)?;
        run.set_item("input", signal(record.input)?)?;
        run.set_item("encoder_m", signal(record.encoder_m)?)?;
        let tool_m = if record.tool_m.is_empty() { None } else { Some(signal(record.tool_m)?) };
        run.set_item("tool_m", tool_m)?;
        run.set_item("error_m", signal(record.error_m)?)?;
        run.set_item("contour_m", give_signal(py, record.contour_m, 1, true)?)?;
        run.set_item("disturbance", py.None())?;
        Ok(run)
    }
}

impl PyLibrary {
    fn lock(&self) -> std::sync::MutexGuard<'_, Library> {
        self.library.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn describe<'py>(py: Python<'py>, row: &Row) -> PyResult<Bound<'py, PyDict>> {
    let run = PyDict::new(py);
    let figures = &row.record.figures;
    run.set_item("id", row.id)?;
    run.set_item("created_utc", &row.created_utc)?;
    run.set_item("cell", &row.meta.cell)?;
    run.set_item("campaign", &row.meta.campaign)?;
    run.set_item("index", row.record.index)?;
    run.set_item("law", &row.meta.law)?;
    run.set_item("measure", &row.meta.measure)?;
    run.set_item("n_samples", row.n_samples)?;
    run.set_item("n_axes", row.meta.n_axes)?;
    run.set_item("cycle_s", row.meta.cycle_s)?;
    run.set_item("axis_names", &row.meta.axis_names)?;
    run.set_item("input_units", &row.meta.input_units)?;
    run.set_item("tracking_inf_m", figures.tracking_inf_m)?;
    run.set_item("tracking_rms_m", figures.tracking_rms_m)?;
    run.set_item("contour_inf_m", figures.contour_inf_m)?;
    run.set_item("contour_rms_m", figures.contour_rms_m)?;
    run.set_item("encoder_tracking_inf_m", figures.encoder_tracking_inf_m)?;
    run.set_item("tool_tracking_inf_m", figures.tool_tracking_inf_m)?;
    run.set_item("overruns", figures.overruns)?;
    run.set_item("missing_samples", figures.missing_samples)?;
    run.set_item("late_updates", figures.late_updates)?;
    run.set_item("update_ms", figures.update_ms)?;
    run.set_item("rolled_back", figures.rolled_back)?;
    run.set_item("digest", &row.digest)?;
    Ok(run)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLibrary>()
}

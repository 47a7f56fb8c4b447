//! The iteration library: `Library`.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use ilc_rt::library::{Library, LibraryError, Row, Task};
use ilc_rt::record::{AxisKinds, Figures, IterationRecord, Meta, distances_m, fingerprint};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::{Signal, give_signal, misfit, read_disturbance};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::{Made, made};
use crate::whole;

/// Longest name of a cell, a campaign or a law.
const NAME_MAX: usize = 200;

/// Every run of every campaign, in one SQLite file.
///
/// - path : str or os.PathLike: The file; it is made if it is not there. ``:memory:`` is a library
///     in memory. The name is never taken for an address.
///
/// Raises OSError if the file cannot be opened or is no library; it is left as it is.
/// What reads opens the file for reading only, and for no longer than that: a
/// library that cannot be written is read all the same, and nothing is left
/// beside it.
///
/// Examples
/// --------
/// >>> from ilc_rt import Library
/// >>> Library(":memory:").list()
/// []
#[pyclass(name = "Library", module = "ilc_rt", frozen)]
#[derive(Debug)]
pub(crate) struct PyLibrary {
    made: Made,
    held: Held,
}

/// Where the runs are.
#[derive(Debug)]
enum Held {
    /// In memory, for as long as this object lives.
    Memory(Box<Mutex<Library>>),
    /// In a file, which is opened for each thing that is done.
    File(PathBuf),
}

#[pymethods]
impl PyLibrary {
    #[new]
    fn new(path: PathBuf) -> PyResult<Self> {
        let made = made!(path);
        if path.as_os_str() == ":memory:" {
            let library = Library::in_memory().or_raise()?;
            return Ok(Self { made, held: Held::Memory(Box::new(Mutex::new(library))) });
        }
        match Library::read(&path) {
            Ok(_) => {}
            // A new file is made at once, so that a name that cannot be used is refused here.
            Err(LibraryError::Missing { .. } | LibraryError::Empty { .. }) => {
                Library::open(&path).or_raise()?;
            }
            refused @ Err(_) => drop(refused.or_raise()?),
        }
        Ok(Self { made, held: Held::File(path) })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.made.shown(py, "Library")
    }

    /// Pickled and copied as the call that made it.
    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Return the runs kept, oldest first, without their arrays.
    ///
    /// - cell : str or None: Only runs of the cell of this name.
    ///
    /// Returns list of dict: Provenance and figures of each run; lengths in metres, angles in
    ///     radians. A figure over several axes is over the linear ones, or over all of a cell whose
    ///     axes are all rotary; contour errors are None where the path has none.
    /// Raises OSError if the file cannot be read.
    #[pyo3(signature = (cell=None))]
    fn list<'py>(&self, py: Python<'py>, cell: Option<&str>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = detached(py, || self.read(|library| library.list(None))).or_raise()?;
        rows.iter()
            .filter(|row| cell.is_none_or(|name| row.meta.cell == name))
            .map(|row| describe(py, row))
            .collect()
    }

    /// Return one run with its arrays.
    ///
    /// - id : int: Key of the run, as `list` gives it.
    ///
    /// Returns dict: What `list` gives, and ``law_parameters`` and ``program`` (JSON),
    ///     ``reference_m``, ``input``, ``encoder_m``, ``tool_m`` (or None), ``error_m`` of shape
    ///     (n_samples, n_axes), ``contour_m`` of shape (n_samples,) (None: the path has no
    ///     contour), ``disturbance`` of shape (n_disturbances,) (None: none is measured).
    /// Raises OSError if there is no such run, or its arrays do not match their digest.
    fn load<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = whole::id)] id: i64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let row = detached(py, || self.read(|library| library.load(id))).or_raise()?;
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
        let contour_m = record.contour_m;
        let has_contour = record.figures.contour_inf_m.is_some() && !contour_m.is_empty();
        let contour_m = has_contour.then(|| give_signal(py, contour_m, 1, true)).transpose()?;
        run.set_item("contour_m", contour_m)?;
        let disturbance = record.disturbance;
        let disturbance = (!disturbance.is_empty()).then(|| give_signal(py, disturbance, 1, true));
        run.set_item("disturbance", disturbance.transpose()?)?;
        Ok(run)
    }

    /// Return the runs made under a disturbance like this one, nearest first.
    ///
    /// - disturbance : float or shape (n_disturbances,): The disturbance.
    /// - top : int: How many runs at most.
    /// - cell : str or None: Only runs of the cell of this name.
    ///
    /// Returns list of dict: What `list` gives of each, and ``distance``, in the unit of the
    ///     disturbance. Of equally near runs the older comes first.
    /// Raises ValueError, TypeError if the disturbance is no number, or not finite.
    /// Raises OSError if the file cannot be read.
    #[pyo3(signature = (disturbance, top=30, cell=None))]
    fn recall<'py>(
        &self,
        py: Python<'py>,
        disturbance: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = whole::top)] top: usize,
        cell: Option<String>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let disturbance = read_disturbance("disturbance", disturbance)?;
        let task = Task { cell };
        let found = detached(py, || self.read(|library| library.recall(&disturbance, top, &task)))
            .or_raise()?;
        found
            .iter()
            .map(|near| {
                let run = describe(py, &near.row)?;
                run.set_item("distance", near.distance)?;
                Ok(run)
            })
            .collect()
    }

    /// Keep a run that was made elsewhere.
    ///
    /// - u : shape (n_samples,) or (n_samples, n_axes): Its learned input, in m or m/s.
    /// - e : ndarray of float64, same shape as `u`: Its error in m, reference minus measurement.
    /// - cycle_s : float: Its sample time in s.
    /// - disturbance : float, array_like of float64 or None: The disturbance it was made under,
    ///     shape (n_disturbances,).
    /// - reference_m : ndarray of float64 or None: Its set points in m, same shape as `u`; None:
    ///     zero, so that its path is one point. The contour error is the distance to the path near
    ///     the same time.
    /// - cell, campaign, law : str: Names; its number follows the last one of the campaign.
    ///
    /// Returns int: Key of the run.
    /// Raises OSError if the file cannot be written.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from ilc_rt import Library
    /// >>> library = Library(":memory:")
    /// >>> library.append(np.zeros(3), np.ones(3), cycle_s=0.01, disturbance=21.5)
    /// 1
    /// >>> library.recall(20.0)[0]["distance"]
    /// 1.5
    #[pyo3(signature = (u, e, cycle_s, disturbance=None, reference_m=None, *, cell="elsewhere", campaign="elsewhere", law="elsewhere"))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments in Python")]
    fn append(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        e: &Bound<'_, PyAny>,
        cycle_s: f64,
        disturbance: Option<&Bound<'_, PyAny>>,
        reference_m: Option<&Bound<'_, PyAny>>,
        cell: &str,
        campaign: &str,
        law: &str,
    ) -> PyResult<i64> {
        let u = Signal::read("u", u)?;
        let alike = |name: &str, signal: &Bound<'_, PyAny>| {
            let signal = Signal::read(name, signal)?;
            if (signal.n_samples, signal.n_channels) == (u.n_samples, u.n_channels) {
                return Ok(signal.values);
            }
            let allowed = format!("({}, {})", u.n_samples, u.n_channels);
            Err(misfit(name, &signal.shape(), &allowed))
        };
        let error_m = alike("e", e)?;
        let reference_m = match reference_m {
            Some(reference_m) => alike("reference_m", reference_m)?,
            None => vec![0.0; error_m.len()],
        };
        if !(cycle_s.is_finite() && cycle_s > 0.0) {
            let line = format!("cycle_s = {cycle_s}: a sample time must be finite and above 0");
            return Err(PyValueError::new_err(line));
        }
        let disturbance = match disturbance.filter(|given| !given.is_none()) {
            Some(given) => read_disturbance("disturbance", given)?,
            None => Vec::new(),
        };
        let n_axes = u.n_channels;
        if u.n_samples == 0 || n_axes == 0 {
            let line = format!(
                "u has shape ({}, {n_axes}): at least one sample of one axis is needed",
                u.n_samples
            );
            return Err(PyValueError::new_err(line));
        }
        for (key, name) in [("cell", cell), ("campaign", campaign), ("law", law)] {
            if name.is_empty() || name.len() > NAME_MAX || name.chars().any(char::is_control) {
                let line = format!(
                    "{key} = {}: 1 to {NAME_MAX} bytes without control characters are allowed",
                    name.chars().take(40).collect::<String>().escape_debug()
                );
                return Err(PyValueError::new_err(line));
            }
        }
        let encoder_m: Vec<f64> = reference_m.iter().zip(&error_m).map(|(r, e)| r - e).collect();
        let meta = Meta {
            cell: cell.to_owned(),
            campaign: campaign.to_owned(),
            fingerprint: fingerprint(&format!("elsewhere {cell} {campaign} {law}")),
            law: law.to_owned(),
            law_parameters: "{}".to_owned(),
            measure: "encoder".to_owned(),
            program: "[]".to_owned(),
            cycle_s,
            n_axes,
            axis_names: (1..=n_axes).map(|axis| format!("axis {axis}")).collect(),
            input_units: vec!["m".to_owned(); n_axes],
        };
        let kinds = AxisKinds::new(&meta.input_units, n_axes);
        let contour_m = distances_m(&reference_m, &encoder_m, &kinds, cycle_s);
        let mut figures = Figures::default();
        figures.set_tracking(&error_m, &kinds);
        figures.set_places(&reference_m, &encoder_m, &[], &kinds);
        figures.set_contour(&contour_m);
        let input = u.values;
        let told = [figures.tracking_inf_m, figures.tracking_rms_m, figures.encoder_tracking_inf_m];
        let contour = [figures.contour_inf_m, figures.contour_rms_m];
        if told.iter().chain(contour.iter().flatten()).any(|figure| !figure.is_finite()) {
            let line = "e or reference_m is too large: the figures of this run are not finite";
            return Err(PyValueError::new_err(line));
        }
        detached(py, || {
            self.write(|library| {
                let index = library.next_index(campaign)?;
                let record = IterationRecord {
                    index,
                    reference_m,
                    input,
                    encoder_m,
                    tool_m: Vec::new(),
                    error_m,
                    contour_m,
                    disturbance,
                    figures,
                };
                library.append(&meta, &record)
            })
        })
        .or_raise()
    }

    /// Delete all but the most relevant runs, and return how many were deleted.
    ///
    /// - keep : int: How many runs stay.
    /// - cell : str or None: Only among runs of the cell of this name.
    ///
    /// Returns int: Runs deleted.
    /// Raises OSError if the file cannot be written, or the runs have different numbers of
    ///     disturbances (nothing is deleted then), or the file could not be made smaller.
    /// The relevance of DPW-ILC with RMS error and disturbance in units of their
    /// spread over these runs, summed over the disturbances of all of them; without
    /// disturbances the smallest errors stay. The file becomes smaller.
    #[pyo3(signature = (keep, cell=None))]
    fn trim(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole::keep)] keep: usize,
        cell: Option<String>,
    ) -> PyResult<usize> {
        let task = Task { cell };
        detached(py, || self.write(|library| library.trim(keep, &task))).or_raise()
    }

    /// Write one run to a file: ``.npz``, ``.csv`` or ``.json`` by its ending.
    ///
    /// - id : int: Key of the run, as `list` gives it.
    /// - path : str or os.PathLike: The file.
    ///
    /// Raises BadInputError if the ending is unknown or the file cannot be written.
    /// Raises OSError if there is no such run, or its arrays do not match their digest.
    fn export(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole::id)] id: i64,
        path: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let run = self.load(py, id)?;
        py.import("ilc_rt.export")?.call_method1("export_run", (run, path)).map(drop)
    }
}

impl PyLibrary {
    /// Reads from the library.
    pub(crate) fn read<T>(
        &self,
        work: impl FnOnce(&Library) -> Result<T, LibraryError>,
    ) -> Result<T, LibraryError> {
        match &self.held {
            Held::Memory(library) => work(&library.lock().unwrap_or_else(PoisonError::into_inner)),
            Held::File(path) => work(&Library::read(path)?),
        }
    }

    /// Writes to the library.
    fn write<T>(
        &self,
        work: impl FnOnce(&Library) -> Result<T, LibraryError>,
    ) -> Result<T, LibraryError> {
        match &self.held {
            Held::Memory(library) => work(&library.lock().unwrap_or_else(PoisonError::into_inner)),
            Held::File(path) => work(&Library::open(path)?),
        }
    }
}

fn describe<'py>(py: Python<'py>, row: &Row) -> PyResult<Bound<'py, PyDict>> {
    let run = PyDict::new(py);
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
    let disturbance = &row.record.disturbance;
    run.set_item("disturbance", (!disturbance.is_empty()).then_some(disturbance))?;
    let described = serde_json::to_string(&row.record.figures)
        .map_err(|error| PyValueError::new_err(error.to_string()))?;
    run.update(py.import("json")?.call_method1("loads", (described,))?.cast()?)?;
    run.set_item("digest", &row.digest)?;
    Ok(run)
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<PyLibrary>()
}

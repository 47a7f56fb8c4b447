//! The iteration library: `Library`.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use ilc_rt::library::{Library, LibraryError, Row, Task};
use ilc_rt::record::{AxisKinds, Figures, IterationRecord, Meta, distances_m, fingerprint};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::argument::{Signal, give_signal, misfit, read_disturbance};
use crate::arguments::{Arguments, ByName, Keywords};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::made::Made;
use crate::whole;

/// Longest name of a cell, a campaign or a law.
const NAME_MAX: usize = 200;

/// Runs of all campaigns, in memory or in one SQLite file.
#[pyclass(name = "Library", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyLibrary {
    made: Made,
    held: Held,
}

/// Storage of the runs.
#[derive(Debug)]
enum Held {
    /// In memory, for the lifetime of this object.
    Memory(Box<Mutex<Library>>),
    /// In a file, opened for each operation.
    File(PathBuf),
}

#[pymethods]
impl PyLibrary {
    #[new]
    #[pyo3(signature = (**keywords))]
    fn new(keywords: Option<Keywords<'_, '_>>) -> PyResult<Self> {
        let a = Arguments::of(keywords)?;
        let (made, path) = (Made::of(a)?, a.get("path")?.extract::<PathBuf>()?);
        if path.as_os_str() == ":memory:" {
            let library = Library::in_memory().or_raise()?;
            return Ok(Self { made, held: Held::Memory(Box::new(Mutex::new(library))) });
        }
        match Library::read(&path) {
            Ok(_) => {}
            // A new file is created at once, so that an unusable name is refused here.
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

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        slf.get().made.reduce(slf.get_type().as_any())
    }

    /// Return the stored runs, oldest first, without their arrays.
    fn list<'py>(&self, py: Python<'py>, cell: Option<&str>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = detached(py, || self.read(|library| library.list(None))).or_raise()?;
        rows.iter()
            .filter(|row| cell.is_none_or(|name| row.meta.cell == name))
            .map(|row| describe(py, row))
            .collect()
    }

    /// Return a run with its arrays.
    fn load<'py>(&self, py: Python<'py>, id: &Bound<'py, PyAny>) -> ByName<'py> {
        let id = whole::id(id)?;
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

    /// Return the runs made under a similar disturbance, nearest first.
    fn recall<'py>(
        &self,
        py: Python<'py>,
        disturbance: &Bound<'py, PyAny>,
        top: &Bound<'py, PyAny>,
        cell: Option<String>,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let (disturbance, top) =
            (read_disturbance("disturbance", disturbance)?, whole::whole("top", top)?);
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

    /// Store a run that was made elsewhere.
    #[pyo3(signature = (**keywords))]
    fn _append(&self, py: Python<'_>, keywords: Option<Keywords<'_, '_>>) -> PyResult<i64> {
        let a = Arguments::of(keywords)?;
        let u = a.signal("u")?;
        let alike = |name: &str, signal: &Bound<'_, PyAny>| {
            let signal = Signal::read(name, signal)?;
            if (signal.n_samples, signal.n_channels) == (u.n_samples, u.n_channels) {
                return Ok(signal.values);
            }
            let allowed = format!("({}, {})", u.n_samples, u.n_channels);
            Err(misfit(name, &signal.shape(), &allowed))
        };
        let error_m = alike("e", &a.get("e")?)?;
        let reference_m =
            a.maybe("reference_m", alike)?.unwrap_or_else(|| vec![0.0; error_m.len()]);
        let (cell, campaign, law) = (a.text("cell")?, a.text("campaign")?, a.text("law")?);
        let cycle_s = a.number("cycle_s")?;
        if !(cycle_s.is_finite() && cycle_s > 0.0) {
            let line = format!("cycle_s = {cycle_s}: a sample time must be finite and above 0");
            return Err(PyValueError::new_err(line));
        }
        let disturbance = a.maybe("disturbance", read_disturbance)?.unwrap_or_default();
        let n_axes = u.n_channels;
        for (key, name) in [("cell", &cell), ("campaign", &campaign), ("law", &law)] {
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
            fingerprint: fingerprint(&format!("elsewhere {cell} {campaign} {law}")),
            cell,
            campaign,
            law,
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
                let index = library.next_index(&meta.campaign)?;
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
    fn trim(
        &self,
        py: Python<'_>,
        keep: &Bound<'_, PyAny>,
        cell: Option<String>,
    ) -> PyResult<usize> {
        let (task, keep) = (Task { cell }, whole::whole("keep", keep)?);
        detached(py, || self.write(|library| library.trim(keep, &task))).or_raise()
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

fn describe<'py>(py: Python<'py>, row: &Row) -> ByName<'py> {
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

//! The iteration library: `Library`.

use std::sync::Arc;

use ilc_rt::library::{Elsewhere, Held, Library, LibraryError, Near, Page, Row, Task};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator};
use pythonize::pythonize;

use crate::answer::{ByName, by_name, give_signal, give_vector};
use crate::argument::{Signal, read_disturbance};
use crate::arguments::{Arguments, read};
use crate::detached::detached;
use crate::error::{OrRaise, Raised};
use crate::library_rows::{give_row, next_row};
use crate::made::{Made, New, made};
use crate::whole;

/// Runs of all campaigns, in memory or in one SQLite file.
#[pyclass(name = "Library", module = "ilc_rt._native", extends = Made, subclass, frozen)]
#[derive(Debug)]
pub(crate) struct PyLibrary(pub(crate) Arc<Held>);

#[pymethods]
impl PyLibrary {
    #[new]
    fn new(a: Arguments<'_, '_>) -> New<Self> {
        let library = Held::new(a.get("path")?.extract()?).or_raise()?;
        made(a, Self(Arc::new(library)))
    }

    /// Return a part of the stored runs, oldest first, without their arrays.
    fn _page<'py>(&self, a: Arguments<'_, 'py>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let page = read!(a, Page:
            [maybe_text => cell, campaign]
            limit: a.maybe("limit", |_, limit| limit.extract())?,
            offset: a.get("offset")?.extract()?,
        );
        let rows = self.read(a.py(), |library| library.page(&page))?;
        rows.iter().map(|row| describe(a.py(), row)).collect()
    }

    /// Return the number of stored runs.
    fn _count(&self, py: Python<'_>) -> PyResult<usize> {
        self.read(py, |library| library.count(None))
    }

    /// Return runs with their arrays, unchecked, to be stored elsewhere.
    fn _rows<'py>(&self, py: Python<'py>, ids: Vec<i64>) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let rows = self.read(py, |library| {
            ids.iter().map(|id| library.load_unchecked(*id)).collect::<Result<Vec<_>, _>>()
        })?;
        rows.iter().map(|row| give_row(py, row)).collect()
    }

    /// Store runs of another library in one transaction, and return how many were new.
    fn _insert(&self, py: Python<'_>, rows: &Bound<'_, PyAny>) -> PyResult<usize> {
        let rows: Py<PyIterator> = rows.try_iter()?.unbind();
        let next = || next_row(&rows);
        self.write(py, |library| Ok(library.insert::<Raised>(std::iter::from_fn(next))))?.or_raise()
    }

    /// Delete runs in one transaction.
    fn _remove(&self, py: Python<'_>, ids: Vec<i64>) -> PyResult<()> {
        self.write(py, |library| library.remove(&ids))
    }

    /// Return the space of deleted runs to the system.
    fn _shrink(&self, py: Python<'_>, n_deleted: usize) -> PyResult<()> {
        self.write(py, |library| library.shrink(n_deleted))
    }

    /// Return a run with its arrays.
    fn load<'py>(&self, py: Python<'py>, id: &Bound<'py, PyAny>) -> ByName<'py> {
        let id = whole::id(id)?;
        let row = self.read(py, |library| library.load(id))?;
        let run = describe(py, &row)?;
        let Row { meta, record, .. } = row;
        let signal = |values| give_signal(py, values, meta.n_axes, false);
        let has_contour = record.figures.contour_inf_m.is_some() && !record.contour_m.is_empty();
        let has_tool = !record.tool_m.is_empty();
        let arrays = by_name!(py,
            [meta => law_parameters, program]
            reference_m: signal(record.reference_m)?,
            input: signal(record.input)?,
            encoder_m: signal(record.encoder_m)?,
            tool_m: has_tool.then(|| signal(record.tool_m)).transpose()?,
            error_m: signal(record.error_m)?,
            contour_m: has_contour.then(|| give_vector(py, record.contour_m)),
            disturbance: some(record.disturbance).map(|values| give_vector(py, values)),
        );
        run.update(arrays.as_mapping())?;
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
        let found = self.read(py, |library| library.recall(&disturbance, top, &task))?;
        let given = |near: &Near| {
            let run = describe(py, &near.row)?;
            run.set_item("distance", near.distance)?;
            Ok(run)
        };
        found.iter().map(given).collect()
    }

    /// Store a run that was made elsewhere.
    fn _append(&self, py: Python<'_>, a: Arguments<'_, '_>) -> PyResult<i64> {
        let u = a.signal("u")?;
        let alike = |name: &str, signal: &Bound<'_, PyAny>| {
            let signal = Signal::read(name, signal)?;
            signal.require_exactly(name, u.n_samples, u.n_channels)?;
            Ok(signal.values)
        };
        let error_m = alike("e", &a.get("e")?)?;
        let reference_m =
            a.maybe("reference_m", alike)?.unwrap_or_else(|| vec![0.0; error_m.len()]);
        let run = read!(a, Elsewhere:
            [text => cell, campaign, law]
            [number => cycle_s]
            n_axes: u.n_channels,
            reference_m: reference_m,
            error_m: error_m,
            disturbance: a.maybe("disturbance", read_disturbance)?.unwrap_or_default(),
            input: u.values,
        );
        let (meta, record) = run.record().or_raise()?;
        self.write(py, |library| library.append_next(&meta, record))
    }

    /// Return the keys of all but the most relevant runs.
    fn _least_relevant(
        &self,
        py: Python<'_>,
        keep: &Bound<'_, PyAny>,
        cell: Option<String>,
    ) -> PyResult<Vec<i64>> {
        let (task, keep) = (Task { cell }, whole::whole("keep", keep)?);
        self.read(py, |library| library.least_relevant(keep, &task))
    }
}

impl PyLibrary {
    /// Reads from the library while other Python threads run.
    fn read<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnMut(&Library) -> Result<T, LibraryError> + Send,
    ) -> PyResult<T> {
        detached(py, || self.0.read(work)).or_raise()
    }

    /// Writes to the library while other Python threads run.
    fn write<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&Library) -> Result<T, LibraryError> + Send,
    ) -> PyResult<T> {
        detached(py, || self.0.write(work)).or_raise()
    }
}

fn describe<'py>(py: Python<'py>, row: &Row) -> ByName<'py> {
    let meta = &row.meta;
    let run = by_name!(py,
        [row => id, created_utc]
        [meta => cell, campaign]
        [row.record => index]
        [meta => law, measure]
        [row => n_samples]
        [meta => n_axes, cycle_s, axis_names, input_units]
        disturbance: some(row.record.disturbance.clone()),
    );
    run.update(pythonize(py, &row.record.figures)?.cast()?)?;
    run.set_item("digest", &row.digest)?;
    Ok(run)
}

/// Returns a list unless it is empty.
fn some(values: Vec<f64>) -> Option<Vec<f64>> {
    Some(values).filter(|values| !values.is_empty())
}

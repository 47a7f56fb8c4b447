//! Record of an object's creation, for copies and pickles.
//!
//! Every class is pickled and copied by this mechanism: the call that created it, with its
//! arguments by name. So a copy starts from the initial state: it does not contain what a law, a
//! gate or a controller has learned or integrated since.

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::Arguments;

/// The call that created an object.
#[derive(Debug)]
pub(crate) struct Made {
    /// The static method called; `None` for the class itself.
    how: Option<&'static str>,
    arguments: Py<PyDict>,
}

impl Made {
    /// Records a call of a static method.
    pub(crate) fn new(
        how: &'static str,
        fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>,
    ) -> PyResult<Self> {
        Python::attach(|py| {
            let arguments = PyDict::new(py);
            fill(&arguments)?;
            Ok(Self { how: Some(how), arguments: Arguments::new(&arguments).kept()?.unbind() })
        })
    }

    /// Records a call of the class with these keywords.
    pub(crate) fn of(arguments: Arguments<'_, '_>) -> PyResult<Self> {
        Ok(Self { how: None, arguments: arguments.kept()?.unbind() })
    }

    /// Returns the call in Python's notation, for a class of this name.
    pub(crate) fn shown(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        Arguments::new(self.arguments.bind(py)).call(name)
    }

    /// Returns the result of `__reduce__` for an object of a class.
    pub(crate) fn reduce(&self, class: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let py = class.py();
        let maker = py.import("ilc_rt._native")?.getattr("_made")?;
        let parts = (class, self.how, &self.arguments);
        Ok((maker, parts).into_pyobject(py)?.into_any().unbind())
    }
}

/// Creates an object again by its recorded call.
#[pyfunction(signature = (cls, how, arguments))]
pub(crate) fn _made<'py>(
    cls: &Bound<'py, PyAny>,
    how: Option<&str>,
    arguments: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let maker = how.map_or_else(|| Ok(cls.clone()), |how| cls.getattr(how))?;
    maker.call((), Some(arguments))
}

/// Makes a law or a filter again from its kind, for copies and pickles: `native` is its class here.
#[pyfunction]
pub(crate) fn _made_of_kind<'py>(
    class: &Bound<'py, PyAny>,
    native: &str,
    kind: &str,
    arguments: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let native = class.py().import("ilc_rt._native")?.getattr(native)?;
    native.getattr("__new__")?.call((class, kind), Some(arguments))
}

/// Returns the result of `__reduce__` for a law or a filter, including the attributes of a derived
/// class.
pub(crate) fn reduce_kind<'py>(
    object: &Bound<'py, PyAny>,
    native: &str,
    kind: &str,
    arguments: &Py<PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let maker = object.py().import("ilc_rt._native")?.getattr("_made_of_kind")?;
    let parts = (object.get_type(), native, kind, arguments);
    let attributes = object.getattr_opt("__dict__")?;
    Ok((maker, parts, attributes).into_pyobject(object.py())?.into_any())
}

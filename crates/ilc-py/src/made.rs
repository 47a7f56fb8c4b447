//! How an object was made, so that a copy can be made in the same way: in another process, too.
//!
//! Every class is pickled and copied by this one mechanism: the call that made it, with its arguments by
//! name. So a copy begins as the original did: what a law, a gate or a controller has learned or summed
//! up since is not in it.

use pyo3::prelude::*;
use pyo3::types::PyDict;
use pyo3::wrap_pyfunction;

use crate::arguments::Arguments;

/// The call that made an object.
#[derive(Debug)]
pub(crate) struct Made {
    /// The static method that was called, if not the class itself.
    how: Option<&'static str>,
    arguments: Py<PyDict>,
}

impl Made {
    /// Takes down a call of a static method.
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

    /// Takes down a call of the class with these keywords.
    pub(crate) fn of(arguments: Arguments<'_, '_>) -> PyResult<Self> {
        Ok(Self { how: None, arguments: arguments.kept()?.unbind() })
    }

    /// Returns the call as Python would write it, for a class of this name.
    pub(crate) fn shown(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        Arguments::new(self.arguments.bind(py)).call(name)
    }

    /// Returns what `__reduce__` returns for an object of a class.
    pub(crate) fn reduce(&self, class: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let py = class.py();
        let maker = py.import("ilc_rt._native")?.getattr("_made")?;
        let parts = (class, self.how, &self.arguments);
        Ok((maker, parts).into_pyobject(py)?.into_any().unbind())
    }
}

/// Makes an object again by the call that made it.
#[pyfunction]
#[pyo3(signature = (cls, how, arguments))]
fn _made<'py>(
    cls: &Bound<'py, PyAny>,
    how: Option<&str>,
    arguments: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let maker = how.map_or_else(|| Ok(cls.clone()), |how| cls.getattr(how))?;
    maker.call((), Some(arguments))
}

/// Makes a law or a filter again from its kind, for copies and pickles: `native` is its class here.
#[pyfunction]
fn _made_of_kind<'py>(
    class: &Bound<'py, PyAny>,
    native: &str,
    kind: &str,
    arguments: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let native = class.py().import("ilc_rt._native")?.getattr(native)?;
    native.getattr("__new__")?.call((class, kind), Some(arguments))
}

/// Returns what `__reduce__` returns for a law or a filter: with what a class derived from it keeps.
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

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_made, module)?)?;
    module.add_function(wrap_pyfunction!(_made_of_kind, module)?)
}

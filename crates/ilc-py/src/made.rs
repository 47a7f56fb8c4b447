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
    /// Name of what was called if not the class itself: one of its static methods, or a function.
    how: Option<&'static str>,
    arguments: Py<PyDict>,
}

impl Made {
    /// Takes down a call of the class, or of what is named.
    pub(crate) fn new(
        how: Option<&'static str>,
        fill: impl FnOnce(&Bound<'_, PyDict>) -> PyResult<()>,
    ) -> PyResult<Self> {
        Python::attach(|py| {
            let arguments = PyDict::new(py);
            fill(&arguments)?;
            Ok(Self { how, arguments: Arguments::new(&arguments).kept()?.unbind() })
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

/// Takes down a call with arguments of these names: of the class, or of what is named before them.
macro_rules! made {
    ($how:literal: $($name:ident),* $(,)?) => { $crate::made::made!(@ Some($how); $($name),*) };
    ($($name:ident),* $(,)?) => { $crate::made::made!(@ None; $($name),*) };
    (@ $how:expr; $($name:ident),*) => {
        $crate::made::Made::new($how, |arguments| {
            $(pyo3::types::PyDictMethods::set_item(arguments, stringify!($name), &$name)?;)*
            Ok(())
        })?
    };
}
pub(crate) use made;

/// Makes an object again by the call that made it.
#[pyfunction]
#[pyo3(signature = (cls, how, arguments))]
fn _made<'py>(
    cls: &Bound<'py, PyAny>,
    how: Option<&str>,
    arguments: &Bound<'py, PyDict>,
) -> PyResult<Bound<'py, PyAny>> {
    let maker = match how {
        None => cls.clone(),
        Some(how) if cls.hasattr(how)? => cls.getattr(how)?,
        Some(how) => cls.py().import("ilc_rt._native")?.getattr(how)?,
    };
    maker.call((), Some(arguments))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_made, module)?)
}

//! How an object was made, so that a copy can be made in the same way: in another process, too.
//!
//! Every class is pickled and copied by this one mechanism: the call that made it, with its arguments by
//! name. So a copy begins as the original did: what a law, a gate or a controller has learned or summed
//! up since is not in it.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use pyo3::wrap_pyfunction;

/// The call that made an object.
#[derive(Debug)]
pub(crate) struct Made {
    /// Name of what was called if not the class itself: one of its static methods, or a function.
    how: Option<&'static str>,
    arguments: Py<PyDict>,
    /// The attribute of the result that the object is.
    part: Option<&'static str>,
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
            // What the caller may change later is copied now.
            for (name, value) in &arguments {
                if value.is_instance_of::<PyList>() || value.hasattr("__array_interface__")? {
                    let copy = py.import("copy")?.getattr("deepcopy")?.call1((value,))?;
                    arguments.set_item(name, copy)?;
                }
            }
            Ok(Self { how, arguments: arguments.unbind(), part: None })
        })
    }

    /// The same call, for what is one attribute of its result.
    pub(crate) fn part(&self, py: Python<'_>, part: &'static str) -> Self {
        Self { how: self.how, arguments: self.arguments.clone_ref(py), part: Some(part) }
    }

    /// Returns the call as Python would write it, for a class of this name.
    pub(crate) fn shown(&self, py: Python<'_>, name: &str) -> PyResult<String> {
        let mut words = Vec::new();
        for (key, value) in self.arguments.bind(py) {
            words.push(format!("{key}={}", value.repr()?));
        }
        Ok(format!("{name}({})", words.join(", ")))
    }

    /// Returns what `__reduce__` returns for an object of a class.
    pub(crate) fn reduce(&self, class: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
        let py = class.py();
        let maker = py.import("ilc_rt._native")?.getattr("_made")?;
        let parts = (class, self.how, &self.arguments, self.part);
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
#[pyo3(signature = (cls, how, arguments, part))]
fn _made<'py>(
    cls: &Bound<'py, PyAny>,
    how: Option<&str>,
    arguments: &Bound<'py, PyDict>,
    part: Option<&str>,
) -> PyResult<Bound<'py, PyAny>> {
    let maker = match how {
        None => cls.clone(),
        Some(how) if cls.hasattr(how)? => cls.getattr(how)?,
        Some(how) => cls.py().import("ilc_rt._native")?.getattr(how)?,
    };
    let object = maker.call((), Some(arguments))?;
    part.map_or(Ok(object.clone()), |part| object.getattr(part))
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_made, module)?)
}

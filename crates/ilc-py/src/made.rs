//! Record of an object's creation, for copies and pickles.
//!
//! Every class is pickled and copied by this mechanism: the call that created it, with its
//! arguments by name. So a copy starts from the initial state: it does not contain what a law, a
//! gate or a controller has learned or integrated since.

use pyo3::PyClass;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answer::Array;
use crate::arguments::Arguments;

/// Base class of what is shown, copied and pickled as the call that created it.
#[pyclass(name = "Made", module = "ilc_rt._native", subclass, frozen)]
#[derive(Debug)]
pub(crate) struct Made {
    /// The static method called; `None` for the class itself.
    how: Option<&'static str>,
    arguments: Py<PyDict>,
}

#[pymethods]
impl Made {
    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let class = slf.get_type().name()?.to_string();
        Arguments::new(slf.get().arguments.bind(slf.py())).call(&class)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        let (py, this) = (slf.py(), slf.get());
        let maker = py.import("ilc_rt._native")?.getattr("_made")?;
        let parts = (slf.get_type(), this.how, &this.arguments);
        Ok((maker, parts).into_pyobject(py)?.into_any())
    }
}

impl Made {
    /// Records a call of a static method with these keywords.
    pub(crate) fn by(how: &'static str, arguments: &Bound<'_, PyDict>) -> Self {
        Self { how: Some(how), arguments: arguments.clone().unbind() }
    }
}

/// A new object of a class derived from [`Made`].
pub(crate) type New<T> = PyResult<PyClassInitializer<T>>;

/// Returns a new object, made by a call of its class with these keywords.
pub(crate) fn made<T: PyClass<BaseType = Made>>(a: Arguments<'_, '_>, object: T) -> New<T> {
    let made = Made { how: None, arguments: a.kept()?.unbind() };
    Ok(PyClassInitializer::from(made).add_subclass(object))
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
    native.getattr("__new__")?.call1((class, kind, arguments))
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

//! Laws for an analysis or a batch: built separately from their Python objects, and queried through their
//! trait.

use std::sync::Arc;

use ilc_rt::learning::Law;
use pyo3::prelude::*;

use super::{Call, Fits, PyLaw, Size};
use crate::argument::Channels;
use crate::arguments::Arguments;
use crate::python_law::{Frame, PythonLaw};

/// Returns a separate law for an analysis or a batch, for runs of this size: the object itself is not used,
/// unless it is written in Python.
pub(crate) fn apart(
    name: &str,
    object: &Bound<'_, PyAny>,
    n_samples: usize,
    channels: Channels,
    n_disturbances: usize,
) -> PyResult<Box<dyn Law>> {
    let Ok(law) = object.cast::<PyLaw>() else {
        let frame = Arc::new(Frame::default());
        return Ok(Box::new(PythonLaw::new(name, object, channels, frame)?));
    };
    let this = law.get();
    let size = Size { n_samples, channels, n_disturbances };
    let arguments = Arguments::new(this.arguments.bind(object.py()));
    Ok((this.build)(&Call { arguments, size: Some(size), live: None })?.law)
}

/// Returns true if a law, or its inner law, is written in Python.
pub(crate) fn is_python(object: &Bound<'_, PyAny>) -> PyResult<bool> {
    match inside(object)? {
        Some(inner) => is_python(&inner),
        None => Ok(!object.is_instance_of::<PyLaw>()),
    }
}

/// Returns the number of samples that a law, or its inner law, was created for.
pub(crate) fn samples_of(object: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    if let Ok(law) = object.cast::<PyLaw>()
        && let Fits::Fixed(n_samples, _) = law.get().fits
    {
        return Ok(Some(n_samples));
    }
    inside(object)?.map_or(Ok(None), |inner| samples_of(&inner))
}

/// Returns the inner law of a native one.
fn inside<'py>(object: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let Ok(law) = object.cast::<PyLaw>() else { return Ok(None) };
    let arguments = Arguments::new(law.get().arguments.bind(object.py()));
    Ok(arguments.given("law")?.or(arguments.given("core")?))
}

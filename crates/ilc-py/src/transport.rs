//! The kinds of bus: `transports`.

use ilc_rt::fieldbus::transport::SCHEMES;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Return the description of each kind of bus, with the keys of `ilc_rt.transports.Transport`.
#[pyfunction]
pub(crate) fn transports(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    SCHEMES
        .iter()
        .map(|scheme| {
            let kind = PyDict::new(py);
            kind.set_item("name", scheme.name)?;
            kind.set_item("syntax", scheme.syntax)?;
            kind.set_item("example", scheme.example)?;
            kind.set_item("summary", scheme.summary)?;
            kind.set_item("has_bits", scheme.has_bits)?;
            kind.set_item("in_process", scheme.in_process)?;
            Ok(kind)
        })
        .collect()
}

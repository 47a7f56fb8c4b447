//! The kinds of bus: `transports`.

use ilc_rt::fieldbus::transport::{SCHEMES, Scheme};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::answer::by_name;

/// Return the description of each kind of bus, with the keys of `ilc_rt.transports.Transport`.
#[pyfunction]
pub(crate) fn transports(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let describe = |scheme: &&Scheme| {
        Ok(by_name!(py, [scheme => name, syntax, example, summary, has_bits, in_process]))
    };
    SCHEMES.iter().map(describe).collect()
}

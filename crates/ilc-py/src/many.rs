//! Learning on many plants at once: `simulate_many`.
//!
//! Its arguments are prepared, and its figures shaped, by `ilc_rt.many`.

use ilc_rt::learning::batch::{self, Laws, Task};
use pyo3::prelude::*;

use crate::answer::{ByName, by_name, give_vector};
use crate::argument::{Channels, read_disturbance, read_vector};
use crate::arguments::Arguments;
use crate::detached::computed;
use crate::laws::apart;
use crate::model_argument::read_model;
use crate::whole::{each, whole};

#[pyfunction]
pub(crate) fn simulate_many<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let list = |name: &str, read: fn(&str, &Bound<'py, PyAny>) -> PyResult<Vec<f64>>| {
        each(name, &a.get(name)?, "a list of arrays", |one| read(name, one))
    };
    let plants =
        each("plants", &a.get("plants")?, "a list of models", |plant| read_model("plants", plant))?;
    let (reference, initial_input) = (a.vector("reference")?, a.vector("initial_input")?);
    let (n_samples, threads) = (a.whole("n_samples")?, a.whole("threads")?);
    let disturbance = list("disturbance", read_disturbance)?;
    let output_disturbance = list("output_disturbance", read_vector)?;
    let seeds: Vec<u64> = a.get("seeds")?.extract()?;
    let n_samples_each = n_samples.max(1);
    let channels = Channels {
        n_inputs: initial_input.len() / n_samples_each,
        n_outputs: reference.len() / n_samples_each,
    };
    let n_disturbances = disturbance.first().map_or(0, Vec::len);
    let objects: Vec<Bound<'py, PyAny>> = a.get("laws")?.extract()?;
    let of_plant = each("law", &a.get("law_of_plant")?, "indices", |one| whole("law", one))?;
    let laws = Laws::new(of_plant, threads, |index| {
        apart("law", &objects[index], n_samples, channels, n_disturbances)
    })?;
    let task = Task {
        plants: &plants,
        reference: &reference,
        initial_input: &initial_input,
        n_samples,
        trials: a.whole("trials")?,
        output_disturbance: &output_disturbance,
        disturbance: &disturbance,
        noise_std: a.number("noise_std")?,
        seeds: &seeds,
        kept: [a.whole("kept_errors")?, a.whole("kept_inputs")?],
    };
    let found = computed(a.py(), || batch::learn(&task, &laws))?;
    let array = |values: Vec<f64>| give_vector(a.py(), values);
    Ok(by_name!(a.py(),
        rms: array(found.rms),
        inf: array(found.inf),
        errors: array(found.errors),
        inputs: array(found.inputs),
    ))
}

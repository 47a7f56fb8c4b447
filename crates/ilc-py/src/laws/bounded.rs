//! Builder of constrained norm-optimal ILC: `constrained`.

use ilc_rt::learning::law::constrained::{Bound as Limits, Bounds, Constrained, Limit};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use super::figure::readable;
use super::kinds::modelled;
use super::optimal::read_cost;
use super::{Builder, Built, Call};
use crate::argument::{Signal, misfit, read_numbers};

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[("constrained", constrained)];

readable! {
    Constrained as law =>
    status: Text(Constrained::status(law).name()),
    message: Text(Constrained::status(law).to_string()),
    iterations: Count(law.iterations()),
    gap: Number(law.gap());

    fn in_place_max(&self) -> usize {
        0
    }
}

pub(super) fn constrained(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let (model, n_samples, fits) = modelled(call)?;
    let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
    let cost = read_cost(a, a.weight("q", n_samples, n_outputs)?, n_samples, n_inputs)?;
    let limits = |name: &str, n_channels| {
        a.maybe(name, |name, given| read_limits(name, given, n_samples, n_channels))
    };
    let signal = |name: &str, n_channels| {
        a.maybe(name, |name, given| {
            let signal = Signal::read(name, given)?.with_samples(name, n_samples)?;
            signal.with_channels(name, n_channels).map(|signal| signal.values)
        })
    };
    let position = limits("position_bounds", n_inputs)?;
    let velocity = limits("velocity_bounds", n_inputs)?;
    let acceleration = limits("acceleration_bounds", n_inputs)?;
    // Bounds of the output alone may use `reference` as the reference of the outputs.
    let is_setpoint = n_inputs == n_outputs
        || [&position, &velocity, &acceleration].iter().any(|bound| bound.is_some());
    let reference = signal("reference", if is_setpoint { n_inputs } else { n_outputs })?;
    let output_reference = signal("output_reference", n_outputs)?;
    let bounds = Bounds {
        input: limits("input_max", n_inputs)?,
        change: limits("change_max", n_inputs)?,
        step: limits("step_max", n_inputs)?,
        position,
        velocity,
        acceleration,
        output: limits("output_bounds", n_outputs)?,
        output_reference: match (output_reference, is_setpoint) {
            (None, false) => reference.clone(),
            (given, _) => given,
        },
        reference: reference.filter(|_| is_setpoint),
    };
    call.built(fits, || Constrained::new(&model, n_samples, cost, bounds))
}

/// Reads a bound b, for -b to b, or a pair (lower, upper) in which `None` is infinite.
fn read_limits(
    name: &str,
    object: &Bound<'_, PyAny>,
    n_samples: usize,
    n_channels: usize,
) -> PyResult<Limits> {
    if let Ok(bound) = object.extract::<f64>() {
        return Ok(Limits { lower: Limit::Scalar(-bound), upper: Limit::Scalar(bound) });
    }
    if !(object.is_instance_of::<PyTuple>() || object.is_instance_of::<PyList>()) {
        let kind = object.get_type().name()?;
        return Err(PyTypeError::new_err(format!(
            "{name} is a {kind}; a number b for -b to b, or a pair (lower, upper), is needed"
        )));
    }
    let length = object.len()?;
    if length != 2 {
        let line = format!("{name} has {length} sides; a pair (lower, upper) is needed");
        return Err(PyValueError::new_err(line));
    }
    let side = |place: usize, unbounded: f64| -> PyResult<Limit> {
        let given = object.get_item(place)?;
        if given.is_none() {
            return Ok(Limit::Scalar(unbounded));
        }
        let name = format!("{name}[{place}]");
        let (values, shape) = read_numbers(&name, &given)?;
        if let Some(index) = values.iter().position(|value| value.is_nan()) {
            return Err(PyValueError::new_err(format!(
                "{name} holds NaN as its value {index}; a number or infinity is needed"
            )));
        }
        let (n, m) = (n_samples, n_channels);
        match shape[..] {
            [] => Ok(Limit::Scalar(values[0])),
            [length] if length == n => Ok(Limit::PerSample(values)),
            [rows, cols] if (rows, cols) == (n, m) => Ok(Limit::Full(values)),
            [1, cols] if cols == m => Ok(Limit::PerChannel(values)),
            _ => Err(misfit(&name, &shape, &format!("(), ({n},), ({n}, {m}) or (1, {m})"))),
        }
    };
    Ok(Limits { lower: side(0, f64::NEG_INFINITY)?, upper: side(1, f64::INFINITY)? })
}

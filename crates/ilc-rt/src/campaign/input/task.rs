//! The task that an input was learned for, and the first difference between two tasks.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::error::InputError;
use crate::config::{Cell, Limits, Mode, PositionLoop};
use crate::design::Plan;
use crate::library::Row;
use crate::record::{Meta, printable};

/// Longest value in a refusal.
const VALUE_MAX: usize = 48;

/// One axis, as far as its input depends on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TaskAxis {
    name: String,
    input_unit: String,
    interface: Mode,
    limits: Limits,
    position_loop: Option<PositionLoop>,
}

/// A task: what must agree wherever an input is used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    cell: String,
    measure: String,
    cycle_s: f64,
    n_samples: usize,
    axis: Vec<TaskAxis>,
    program: Value,
}

impl Task {
    /// Returns the task of a planned cell.
    pub fn new(cell: &Cell, plan: &Plan) -> Self {
        let units = &plan.meta.input_units;
        let axis = |(axis, unit): (&crate::config::Axis, &String)| TaskAxis {
            name: axis.name.clone(),
            input_unit: unit.clone(),
            interface: axis.interface,
            limits: axis.limits,
            position_loop: axis.position_loop,
        };
        Self {
            cell: plan.meta.cell.clone(),
            measure: plan.meta.measure.clone(),
            cycle_s: plan.meta.cycle_s,
            n_samples: plan.n_samples(),
            axis: cell.axes.iter().zip(units).map(axis).collect(),
            program: program(&plan.meta),
        }
    }

    /// Returns the number of samples of a run.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Ensures that this task, of `place`, is that of a cell.
    ///
    /// # Errors
    /// [`InputError::Different`] with the first difference.
    pub fn require(&self, here: &Self, place: &str) -> Result<(), InputError> {
        differ(&json!(self), &json!(here), place)
    }

    /// Ensures that a stored run was made for this task, as far as its row tells.
    pub(super) fn require_row(&self, row: &Row, place: &str) -> Result<(), InputError> {
        let (mut here, mut there) = self.machines(row);
        (here["n_samples"], here["program"]) = (json!(self.n_samples), self.program.clone());
        (there["n_samples"], there["program"]) = (json!(row.n_samples), program(&row.meta));
        differ(&there, &here, place)
    }

    /// Ensures that a stored run was made on this machine with this measurement, whatever its program.
    pub(super) fn require_machine(&self, row: &Row, place: &str) -> Result<(), InputError> {
        let (here, there) = self.machines(row);
        differ(&there, &here, place)
    }

    /// Returns machine and measurement of this task, and those of a stored run.
    fn machines(&self, row: &Row) -> (Value, Value) {
        let here: Vec<_> = self.axis.iter().map(|a| [&a.name, &a.input_unit]).collect();
        let there: Vec<_> = row.meta.axis_names.iter().zip(&row.meta.input_units).collect();
        let of = |cell: &str, measure: &str, cycle_s: f64, axis: Value| json!({ "cell": cell, "measure": measure, "cycle_s": cycle_s, "axis": axis });
        let meta = &row.meta;
        (
            of(&self.cell, &self.measure, self.cycle_s, json!(here)),
            of(&meta.cell, &meta.measure, meta.cycle_s, json!(there)),
        )
    }

    /// Ensures that an input has one finite number within its bound for each sample and axis.
    ///
    /// # Shapes
    /// - `input`: `n_samples * n_axes`; `bounds`: `n_axes`
    pub(in crate::campaign) fn require_bounds(
        &self,
        input: &[f64],
        bounds: &[f64],
        place: &str,
    ) -> Result<(), InputError> {
        let n_axes = self.axis.len().max(1);
        if input.len() != self.n_samples * n_axes {
            let (place, found) = (place.to_owned(), input.len() / n_axes);
            return Err(InputError::Size { place, found, allowed: self.n_samples, n_axes });
        }
        for (sample, row) in input.chunks_exact(n_axes).enumerate() {
            for ((&value, &limit), axis) in row.iter().zip(bounds).zip(&self.axis) {
                // False for a number that is not finite.
                if value.is_finite() && value.abs() <= limit {
                    continue;
                }
                let (place, axis, unit) =
                    (place.to_owned(), axis.name.clone(), axis.input_unit.clone());
                return Err(InputError::Bound { place, axis, value, unit, sample, limit });
            }
        }
        Ok(())
    }
}

fn program(meta: &Meta) -> Value {
    serde_json::from_str(&meta.program).unwrap_or_else(|_| Value::from(meta.program.clone()))
}

fn differ(there: &Value, here: &Value, place: &str) -> Result<(), InputError> {
    match first_difference(there, here) {
        None => Ok(()),
        Some((key, there, here)) => {
            let text = |value: &Value| printable(&value.to_string(), VALUE_MAX);
            let (there, here) = (text(there), text(here));
            Err(InputError::Different { place: place.to_owned(), key, there, here })
        }
    }
}

/// Returns the path of the first key that differs, with both values.
fn first_difference<'a>(a: &'a Value, b: &'a Value) -> Option<(String, &'a Value, &'a Value)> {
    let inside = |name: String, a: &'a Value, b: &'a Value| {
        first_difference(a, b).map(|(key, a, b)| {
            let dot = if key.is_empty() || key.starts_with('[') { "" } else { "." };
            (format!("{name}{dot}{key}"), a, b)
        })
    };
    match (a, b) {
        (Value::Object(left), Value::Object(right)) => {
            left.keys().chain(right.keys()).find_map(|key| {
                let of =
                    |map: &'a serde_json::Map<String, Value>| map.get(key).unwrap_or(&Value::Null);
                inside(key.clone(), of(left), of(right))
            })
        }
        (Value::Array(left), Value::Array(right)) if left.len() == right.len() => left
            .iter()
            .zip(right)
            .enumerate()
            .find_map(|(i, (a, b))| inside(format!("[{i}]"), a, b)),
        _ => (a != b).then(|| (String::new(), a, b)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_has_a_path() {
        let a = json!({"axis": [{"name": "x", "limits": {"v": 1.0}}], "cell": "a"});
        let b = json!({"axis": [{"name": "x", "limits": {"v": 2.0}}], "cell": "a"});
        let (key, there, here) = first_difference(&a, &b).unwrap();
        assert_eq!((key.as_str(), there, here), ("axis[0].limits.v", &json!(1.0), &json!(2.0)));
        assert!(first_difference(&a, &a.clone()).is_none());
        let (one, none) = (json!({"p": 1}), json!({}));
        let (key, _, here) = first_difference(&one, &none).unwrap();
        assert_eq!((key.as_str(), here), ("p", &Value::Null));
        let more = json!([1, 2]);
        let one = json!([1]);
        assert_eq!(first_difference(&one, &more).unwrap().2, &more);
    }
}

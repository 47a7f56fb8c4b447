//! Checks values against the ranges of their schema.

use std::fmt::Write as _;

use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value as Json;
use toml::Value;

use super::{ORDER, inlined};

/// A value out of its schema's range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Table and key, e.g. `[axis.limits] jerk_max_m_s3`.
    pub key: String,
    /// The value found.
    pub value: String,
    /// Allowed values.
    pub allowed: String,
}

/// Checks every number of a value against the range in its schema; `table` is the place of the
/// value, e.g. `learning.pd`, and empty for a whole file.
///
/// # Errors
/// [`Violation`] for the first number, in the order of the fields, that is not finite or out of
/// range.
pub fn check<T: Serialize + JsonSchema>(value: &T, table: &str) -> Result<(), Violation> {
    let found = Value::try_from(value).map_err(|error| Violation {
        key: format!("[{table}]"),
        value: "a value".to_owned(),
        allowed: error.to_string(),
    })?;
    walk(&found, inlined::<T>().as_value(), &Place::Table(table.to_owned()))
}

/// Place of a value in a file.
enum Place {
    Table(String),
    /// An element of an array of tables, by its name or its number from 1.
    Element {
        table: String,
        name: Result<String, usize>,
        below: String,
    },
}

impl Place {
    fn key(&self, name: &str) -> String {
        match self {
            Self::Table(table) if table.is_empty() => name.to_owned(),
            Self::Table(table) => format!("[{table}] {name}"),
            Self::Element { table, name: Ok(element), below } => {
                format!("[[{table}]] {element}: {below}{name}")
            }
            Self::Element { table, name: Err(number), below } => {
                format!("[[{table}]] {number} {below}{name}")
            }
        }
    }

    fn table(&self, key: &str) -> Self {
        match self {
            Self::Table(table) if table.is_empty() => Self::Table(key.to_owned()),
            Self::Table(table) => Self::Table(format!("{table}.{key}")),
            Self::Element { table, name, below } => Self::Element {
                table: table.clone(),
                name: name.clone(),
                below: format!("{below}{key}."),
            },
        }
    }

    fn element(&self, key: &str, number: usize, item: &Value) -> Self {
        let table = match self {
            Self::Table(table) if table.is_empty() => key.to_owned(),
            Self::Table(table) | Self::Element { table, .. } => format!("{table}.{key}"),
        };
        let name = item.get("name").and_then(Value::as_str).map(str::to_owned);
        Self::Element { table, name: name.ok_or(number), below: String::new() }
    }
}

fn walk(found: &Value, schema: &Json, place: &Place) -> Result<(), Violation> {
    let (Some(found), Some(properties)) = (found.as_table(), schema["properties"].as_object())
    else {
        return Ok(());
    };
    let order = schema[ORDER].as_array().into_iter().flatten().filter_map(Json::as_str);
    for key in order {
        if let (Some(value), Some(schema)) = (found.get(key), properties.get(key)) {
            visit(value, schema, place, key)?;
        }
    }
    Ok(())
}

fn visit(value: &Value, schema: &Json, place: &Place, key: &str) -> Result<(), Violation> {
    match value {
        Value::Table(_) => walk(value, schema, &place.table(key)),
        Value::Array(items) => items.iter().enumerate().try_for_each(|(i, item)| match item {
            Value::Table(_) => walk(item, &schema["items"], &place.element(key, i + 1, item)),
            _ => visit(item, &schema["items"], place, key),
        }),
        Value::Float(number) => number_in(*number, schema, place, key),
        #[expect(clippy::cast_precision_loss, reason = "no range begins or ends beyond 2^53")]
        Value::Integer(number) => number_in(*number as f64, schema, place, key),
        _ => Ok(()),
    }
}

fn number_in(number: f64, schema: &Json, place: &Place, key: &str) -> Result<(), Violation> {
    let range = Range::new(schema);
    if range.holds(number) {
        return Ok(());
    }
    let (key, value) = (place.key(key), number.to_string());
    Err(Violation { key, value, allowed: format!("allowed {range}") })
}

/// The range of a number.
pub(crate) struct Range {
    min: Option<f64>,
    max: Option<f64>,
    above: Option<f64>,
    below: Option<f64>,
}

impl Range {
    pub(crate) fn new(schema: &Json) -> Self {
        let bound = |key: &str| schema[key].as_f64();
        Self {
            min: bound("minimum"),
            max: bound("maximum"),
            above: bound("exclusiveMinimum"),
            below: bound("exclusiveMaximum"),
        }
    }

    fn holds(&self, number: f64) -> bool {
        number.is_finite()
            && self.min.is_none_or(|min| number >= min)
            && self.max.is_none_or(|max| number <= max)
            && self.above.is_none_or(|above| number > above)
            && self.below.is_none_or(|below| number < below)
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let (Some(min), Some(max)) = (self.min, self.max) {
            return write!(f, "{min} to {max}");
        }
        let mut parts = String::new();
        for (word, bound) in [
            ("at least", self.min),
            ("above", self.above),
            ("at most", self.max),
            ("below", self.below),
        ] {
            if let Some(bound) = bound {
                let and = if parts.is_empty() { "" } else { " and " };
                let _ = write!(parts, "{and}{word} {bound}");
            }
        }
        f.write_str(if parts.is_empty() { "any finite number" } else { &parts })
    }
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;
    use crate::schema::field_order;

    #[derive(Default, Serialize, Deserialize, JsonSchema)]
    #[serde(default)]
    #[schemars(extend("x-order" = field_order::<Self>()))]
    struct Whole {
        #[schemars(range(min = 1, max = 8))]
        order: u32,
        part: Part,
        list: Vec<Part>,
        #[schemars(inner(range(min = -1.0)))]
        numbers: Vec<f64>,
    }

    #[derive(Default, Serialize, Deserialize, JsonSchema)]
    #[serde(default)]
    #[schemars(extend("x-order" = field_order::<Self>()))]
    struct Part {
        name: Option<String>,
        #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 2.0))]
        gain: Option<f64>,
        free: f64,
    }

    fn refused(text: &str) -> String {
        let value: Whole = toml::from_str(&format!("order = 1\n{text}")).unwrap();
        check(&value, "a.b")
            .map_or_else(|v| format!("{} = {}: {}", v.key, v.value, v.allowed), |()| String::new())
    }

    #[test]
    fn a_violation_names_place_value_and_range() {
        let line = check(&Whole { order: 9, ..Whole::default() }, "").unwrap_err();
        assert_eq!((&*line.key, &*line.value, &*line.allowed), ("order", "9", "allowed 1 to 8"));
        for (text, line) in [
            ("part.gain = 2", "[a.b.part] gain = 2: allowed above 0 and below 2"),
            ("part.gain = nan", "[a.b.part] gain = NaN: allowed above 0 and below 2"),
            ("part.free = inf", "[a.b.part] free = inf: allowed any finite number"),
            ("numbers = [0.0, -2.0]", "[a.b] numbers = -2: allowed at least -1"),
            ("list = [{}, { gain = 0 }]", "[[a.b.list]] 2 gain = 0: allowed above 0 and below 2"),
            (
                "list = [{ name = \"x\", gain = 3 }]",
                "[[a.b.list]] x: gain = 3: allowed above 0 and below 2",
            ),
            ("part.gain = 1.9", ""),
        ] {
            assert_eq!(refused(text), line);
        }
    }
}

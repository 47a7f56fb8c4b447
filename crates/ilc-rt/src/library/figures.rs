//! Columns and values of a run's figures, derived from the struct.

use rusqlite::types::{Type, Value, ValueRef};
use serde::Deserialize as _;
use serde_json::{Map, Value as Json};

use crate::record::{Field, FieldKind, Figures, figure_fields};

/// Returns the column type of a figure in a new file.
pub(super) fn column_type(field: &Field) -> &'static str {
    match (field.kind, field.is_required) {
        (FieldKind::Real, true) => "REAL NOT NULL",
        (FieldKind::Real, false) => "REAL",
        (FieldKind::Count | FieldKind::Flag, _) => "INTEGER",
        (FieldKind::Text | FieldKind::List, _) => "TEXT",
    }
}

/// Returns names and values of all figures; lists are JSON, and a non-finite number is NULL.
pub(super) fn values(figures: &Figures) -> Vec<(&'static str, Value)> {
    let described = serde_json::to_value(figures).unwrap_or_default();
    let value = |field: &'static Field| {
        let value = match &described[&field.name] {
            Json::Null => Value::Null,
            Json::Bool(flag) => Value::Integer(i64::from(*flag)),
            Json::Number(number) => match number.as_i64() {
                Some(count) if field.kind == FieldKind::Count => Value::Integer(count),
                _ => number.as_f64().map_or(Value::Null, Value::Real),
            },
            Json::String(text) => Value::Text(text.clone()),
            list => Value::Text(list.to_string()),
        };
        (field.name.as_str(), value)
    };
    figure_fields().iter().map(value).collect()
}

/// Reads the figures of a row, which begin at a column; those missing in an older file keep their
/// default.
pub(super) fn read(row: &rusqlite::Row<'_>, first: usize) -> rusqlite::Result<Figures> {
    let mut described = Map::new();
    for (column, field) in (first..).zip(figure_fields()) {
        let value = match row.get_ref(column)? {
            ValueRef::Null | ValueRef::Blob(_) => continue,
            ValueRef::Integer(flag) if field.kind == FieldKind::Flag => Json::Bool(flag != 0),
            ValueRef::Integer(count) => count.into(),
            ValueRef::Real(number) => number.into(),
            text @ ValueRef::Text(_) if field.kind == FieldKind::List => {
                serde_json::from_str(text.as_str()?).unwrap_or_else(|_| Json::Array(Vec::new()))
            }
            text @ ValueRef::Text(_) => text.as_str()?.into(),
        };
        described.insert(field.name.clone(), value);
    }
    let described = Json::Object(described);
    Figures::deserialize(&described).map_err(|error| {
        let place = figure_fields().iter().position(|field| is_wrong(&described, &field.name));
        let column = first + place.unwrap_or_default();
        rusqlite::Error::FromSqlConversionFailure(column, Type::Text, Box::new(error))
    })
}

/// Returns true if a value is the reason that figures cannot be read.
fn is_wrong(described: &Json, name: &str) -> bool {
    let mut figures = serde_json::to_value(Figures::default()).unwrap_or_default();
    described.get(name).is_some_and(|value| {
        figures[name] = value.clone();
        Figures::deserialize(&figures).is_err()
    })
}

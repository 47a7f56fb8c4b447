//! The columns of a run's figures, as the struct describes them, and their values.

use rusqlite::types::{Value, ValueRef};
use serde_json::{Map, Value as Json};

use crate::record::{Field, FieldKind, Figures, figure_fields};

/// The type of a figure's column in a new file.
pub(super) fn column_type(field: &Field) -> &'static str {
    match (field.kind, field.is_required) {
        (FieldKind::Real, true) => "REAL NOT NULL",
        (FieldKind::Real, false) => "REAL",
        (FieldKind::Count | FieldKind::Flag, _) => "INTEGER",
        (FieldKind::Text | FieldKind::List, _) => "TEXT",
    }
}

/// Names and values of all figures; lists are JSON, and a number that is not finite is NULL.
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

/// Reads the figures of a row; those that an older file does not have keep their default.
pub(super) fn read(row: &rusqlite::Row<'_>) -> rusqlite::Result<Figures> {
    let mut described = Map::new();
    for field in figure_fields() {
        let value = match row.get_ref(field.name.as_str())? {
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
    serde_json::from_value(Json::Object(described)).map_err(|error| {
        rusqlite::Error::FromSqlConversionFailure(0, rusqlite::types::Type::Text, Box::new(error))
    })
}

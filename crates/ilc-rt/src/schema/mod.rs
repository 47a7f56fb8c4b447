//! JSON schema of parameter structs, with range and unit at each field. Values are checked against
//! it, and tables, templates and editors read it.
//!
//! Any cold module may import it: the structs of parameters, which derive `JsonSchema`, and `config`,
//! which composes them to a cell description.

mod check;
mod document;
mod node;
mod order;
mod template;

pub use check::{Violation, check};
pub use document::fill;
pub use order::field_order;
pub use template::template;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};
use serde_json::Value;

/// Key under which a struct's schema lists its fields in the order of declaration, which a JSON
/// object does not preserve.
pub const ORDER: &str = "x-order";

/// Returns the schema of a type with every nested one inlined.
pub fn inlined<T: JsonSchema>() -> Schema {
    let settings =
        SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>()
}

/// Returns the schema of a type for editors: draft 7, which they support best, with nested types by
/// reference.
pub fn for_editors<T: JsonSchema>() -> Value {
    let mut schema =
        SchemaSettings::draft07().into_generator().into_root_schema_for::<T>().to_value();
    forget_order(&mut schema);
    schema
}

/// Removes the keys that only this program reads.
fn forget_order(schema: &mut Value) {
    match schema {
        Value::Object(map) => {
            map.remove(ORDER);
            map.values_mut().for_each(forget_order);
        }
        Value::Array(items) => items.iter_mut().for_each(forget_order),
        _ => {}
    }
}

//! What a struct of parameters says of itself: its JSON schema, with the range and the unit of each field
//! at the field. Values are checked against it, and tables, templates and editors read it.
//!
//! Any cold module may import it: the structs of parameters, which derive `JsonSchema`, and `config`,
//! which composes them to a cell description.

mod check;
mod order;

pub use check::{Violation, check};
pub use order::field_order;

use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema};

/// Key under which a struct's schema lists its fields in the order of their declaration, which a JSON
/// object does not keep.
pub const ORDER: &str = "x-order";

/// Returns the schema of a type with every nested one in its place.
pub fn inlined<T: JsonSchema>() -> Schema {
    let settings =
        SchemaSettings::draft2020_12().with(|settings| settings.inline_subschemas = true);
    settings.into_generator().into_root_schema_for::<T>()
}

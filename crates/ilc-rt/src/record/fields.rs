//! The fields of a described struct with their types, for columns, classes and tables derived from
//! it.

use std::sync::OnceLock;

use super::figures::Figures;
use crate::schema::{ORDER, inlined};

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldKind {
    /// A number with decimals.
    Real,
    /// A count.
    Count,
    /// True or false.
    Flag,
    /// A text.
    Text,
    /// A list of numbers.
    List,
}

/// A field of a described struct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Name.
    pub name: String,
    /// Type.
    pub kind: FieldKind,
    /// True if it may be absent.
    pub is_optional: bool,
    /// True if a source without it is refused.
    pub is_required: bool,
    /// Its doc comment.
    pub doc: String,
}

/// Returns the figures of a run, in the order of their declaration.
pub fn figure_fields() -> &'static [Field] {
    static FIELDS: OnceLock<Vec<Field>> = OnceLock::new();
    FIELDS.get_or_init(|| {
        let schema = inlined::<Figures>();
        let schema = schema.as_value();
        let texts = |list: &serde_json::Value| -> Vec<String> {
            serde_json::from_value(list.clone()).unwrap_or_default()
        };
        let required = texts(&schema["required"]);
        let field = |name: String| {
            let described = &schema["properties"][&name];
            let mut types = texts(&described["type"]);
            types.extend(described["type"].as_str().map(str::to_owned));
            let is = |wanted: &str| types.iter().any(|found| found == wanted);
            Field {
                kind: match () {
                    () if is("number") => FieldKind::Real,
                    () if is("integer") => FieldKind::Count,
                    () if is("boolean") => FieldKind::Flag,
                    () if is("array") => FieldKind::List,
                    () => FieldKind::Text,
                },
                is_optional: is("null"),
                is_required: required.contains(&name),
                doc: described["description"].as_str().unwrap_or_default().replace('\n', " "),
                name,
            }
        };
        texts(&schema[ORDER]).into_iter().map(field).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_is_described() {
        let fields = figure_fields();
        let whole = serde_json::to_value(Figures::default()).unwrap();
        let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names.len(), whole.as_object().unwrap().len());
        assert!(names.iter().all(|name| whole.get(name).is_some()));
        assert!(fields.iter().all(|field| field.doc.ends_with('.')));
        let of = |name: &str| fields.iter().find(|field| field.name == name).unwrap();
        assert_eq!((of("remark").kind, of("remark").is_optional), (FieldKind::Text, true));
        assert_eq!((of("overruns").kind, of("overruns").is_required), (FieldKind::Count, false));
        assert_eq!(
            (of("tracking_inf_m").kind, of("tracking_inf_m").is_required),
            (FieldKind::Real, true)
        );
        assert_eq!(of("axes_tracking_rms_m").kind, FieldKind::List);
        assert_eq!(of("rolled_back").kind, FieldKind::Flag);
    }
}

//! Reading of a schema: the table at a path, its keys in order, and their descriptions.

use serde_json::Value;

use super::ORDER;
use super::check::Range;

/// A table or a key of an inlined schema.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<'a> {
    pub(super) name: &'a str,
    schema: &'a Value,
    pub(super) is_required: bool,
}

/// Kind of value that a key holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A number, a text, or a list of them.
    Value,
    /// A table.
    Table,
    /// An array of tables.
    Tables,
}

impl<'a> Node<'a> {
    pub(super) fn root(schema: &'a Value) -> Self {
        Self { name: "", schema, is_required: true }
    }

    /// Returns the table at a path, e.g. `learning.pd`.
    pub(super) fn at(self, path: &str) -> Option<Self> {
        let mut names = path.split('.');
        names.try_fold(self, |node, name| node.keys().into_iter().find(|key| key.name == name))
    }

    /// Returns the keys in the order of declaration; for an array of tables, those of its elements.
    pub(super) fn keys(self) -> Vec<Self> {
        let table = self.table();
        let names = table[ORDER].as_array().into_iter().flatten().filter_map(Value::as_str);
        let required = |name: &str| {
            table["required"].as_array().is_some_and(|all| all.iter().any(|found| found == name))
        };
        names
            .filter_map(|name| {
                let schema = table["properties"].get(name)?;
                Some(Self { name, schema, is_required: required(name) })
            })
            .collect()
    }

    fn table(self) -> &'a Value {
        if self.schema.get("items").is_some() { &self.schema["items"] } else { self.schema }
    }

    pub(super) fn kind(self) -> Kind {
        match (self.schema.get("properties"), self.schema["items"].get("properties")) {
            (Some(_), _) => Kind::Table,
            (None, Some(_)) => Kind::Tables,
            (None, None) => Kind::Value,
        }
    }

    /// Returns its doc comment in one line.
    pub(super) fn meaning(self) -> String {
        self.schema["description"]
            .as_str()
            .unwrap_or("")
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    }

    /// Returns the default in TOML syntax; `None` if there is none.
    pub(super) fn default(self) -> Option<String> {
        let value = self.schema.get("default").filter(|value| !value.is_null())?;
        toml::Value::try_from(value).ok().map(|value| value.to_string())
    }

    /// Returns names and meanings of the values of an enumeration.
    pub(super) fn choices(self) -> Vec<(&'a str, &'a str)> {
        let plain = self.schema["enum"].as_array().into_iter().flatten();
        let plain = plain.filter_map(Value::as_str).map(|name| (name, ""));
        let described = self.schema["oneOf"].as_array().into_iter().flatten().flat_map(|choice| {
            let meaning = choice["description"].as_str().unwrap_or("");
            let several = choice["enum"].as_array().into_iter().flatten().filter_map(Value::as_str);
            choice["const"].as_str().into_iter().chain(several).map(move |name| (name, meaning))
        });
        plain.chain(described).collect()
    }

    fn is(self, kind: &str) -> bool {
        let found = &self.schema["type"];
        found == kind || found.as_array().is_some_and(|all| all.iter().any(|one| one == kind))
    }

    /// Returns the allowed values in words; empty if the type allows any.
    pub(super) fn allowed(self) -> String {
        let choices = self.choices();
        if !choices.is_empty() {
            let names: Vec<_> = choices.iter().map(|(name, _)| format!("`{name}`")).collect();
            return names.join(", ");
        }
        if self.is("boolean") {
            return "`true`, `false`".to_owned();
        }
        if let Some(items) = self.schema.get("items") {
            let of = Self { name: self.name, schema: items, is_required: false }.allowed();
            return if of.is_empty() { "list".to_owned() } else { format!("list of {of}") };
        }
        let (is_integer, is_number) = (self.is("integer"), self.is("number"));
        if !is_integer && !is_number {
            return if self.is("string") { "text".to_owned() } else { String::new() };
        }
        let range = Range::new(self.schema).to_string();
        if is_integer && range != "any finite number" { format!("{range}, whole") } else { range }
    }
}

//! Files that derive from the Rust source: the Python class of the figures, the schemas of the cell
//! description and of the events, and tables of the documents. `make derived` writes them.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may panic")]

use std::fmt::Write as _;

use ilc_rt::config::{Cell, LawName};
use ilc_rt::fieldbus::transport::SCHEMES;
use ilc_rt::record::{Event, Field, FieldKind, figure_fields};
use ilc_rt::schema::{fill, for_editors, inlined};
use ilc_rt::trajectory::kind::{Key, PathKind};
use ilc_tests::{hold_derived, hold_derived_file, root};
use serde_json::Value;

/// Place in the cell reference before which sections of further laws are put.
const FURTHER_LAWS: &str = "<!-- further laws -->";
/// Columns of a line of the Python source.
const WIDTH: usize = 88;

fn python_type(field: &Field) -> String {
    let kind = match field.kind {
        FieldKind::Real => "float",
        FieldKind::Count => "int",
        FieldKind::Flag => "bool",
        FieldKind::Text => "str",
        FieldKind::List => "tuple[float, ...]",
    };
    if field.is_optional { format!("{kind} | None") } else { kind.to_owned() }
}

fn python_default(field: &Field) -> &'static str {
    match field.kind {
        _ if field.is_required => "",
        _ if field.is_optional => " = None",
        FieldKind::Real => " = 0.0",
        FieldKind::Count => " = 0",
        FieldKind::Flag => " = False",
        FieldKind::Text => " = \"\"",
        FieldKind::List => " = ()",
    }
}

fn wrapped(text: &str, indent: &str) -> String {
    let mut lines = String::new();
    let mut line = indent.to_owned();
    for word in text.split_whitespace() {
        if line.len() + 1 + word.chars().count() > WIDTH && line != indent {
            let _ = writeln!(lines, "{line}");
            indent.clone_into(&mut line);
        }
        if line != indent {
            line.push(' ');
        }
        line.push_str(word);
    }
    lines + &line
}

#[test]
fn the_python_class_of_the_figures() {
    let mut text =
        "\"\"\"The figures of a run. Derived from the source of the controller: do not edit.\"\"\"

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    \"\"\"Figures of one run; lengths in metres, angles in radians.

    A figure over several axes is over the linear ones, or in radians over all of a
    cell whose axes are all rotary.

    Attributes
    ----------
"
        .to_owned();
    let fields = figure_fields();
    for field in fields {
        let _ = writeln!(text, "    {} : {}", field.name, python_type(field));
        let _ = writeln!(text, "{}", wrapped(&field.doc.replace('`', ""), "        "));
    }
    text += "    \"\"\"\n\n";
    for field in fields {
        let _ =
            writeln!(text, "    {}: {}{}", field.name, python_type(field), python_default(field));
    }
    hold_derived_file("python/ilc_rt/figures.py", &text);
}

#[test]
fn the_schema_of_the_events() {
    let text = serde_json::to_string_pretty(&inlined::<Event>()).unwrap();
    hold_derived_file("docs/events.schema.json", &format!("{text}\n"));
}

#[test]
fn the_table_of_the_events() {
    let schema = inlined::<Event>();
    let mut table = "| event | fields |\n|---|---|\n".to_owned();
    for event in schema.as_value()["oneOf"].as_array().unwrap() {
        let name = event["properties"]["event"]["const"].as_str().unwrap();
        let fields = event["properties"].as_object().unwrap().keys();
        let fields: Vec<_> =
            fields.filter(|field| *field != "event").map(|field| format!("`{field}`")).collect();
        let doc = event["description"].as_str().unwrap_or_default().replace('\n', " ");
        let _ = writeln!(table, "| `{name}` | {doc} {} |", fields.join(", "));
    }
    hold_derived("docs/telemetry.md", "events", &table);
}

#[test]
fn the_table_of_the_buses() {
    let mut table = "| address | carrier |\n|---|---|\n".to_owned();
    for scheme in SCHEMES {
        let _ = writeln!(table, "| `{}` | {} |", scheme.syntax, scheme.summary);
    }
    hold_derived("README.md", "buses", &table);
}

/// Returns the table of the kinds of path.
fn kinds_of_path() -> String {
    let schema = inlined::<Cell>().to_value();
    let program = &schema["properties"]["program"]["properties"];
    let mut table = "| `kind` | reads | path |\n|---|---|---|\n".to_owned();
    for kind in PathKind::ALL {
        let entry = kind.entry();
        let reads: Vec<_> =
            entry.reads.iter().filter_map(|key| key_in_words(*key, program)).collect();
        let _ = writeln!(table, "| `{}` | {} | {} |", kind.name(), reads.join(", "), entry.summary);
    }
    table
}

/// Returns a key as the table of the kinds has it, with the numbers of its table; `None` for a part of
/// another key.
fn key_in_words(key: Key, program: &Value) -> Option<String> {
    let name = key.name();
    if name.contains(' ') && !name.starts_with("[program]") {
        return None;
    }
    let plain = name.trim_start_matches("[program] ");
    let table = name.strip_prefix("[program.").and_then(|rest| rest.strip_suffix(']'));
    let Some(table) = table else { return Some(format!("`{plain}`")) };
    let default =
        |key: &Value| key.get("default").map_or(String::new(), |value| format!(" ({value})"));
    let numbers = program[table]["properties"].as_object().unwrap();
    let numbers: Vec<_> =
        numbers.iter().map(|(name, key)| format!("`{name}`{}", default(key))).collect();
    Some(format!("`{name}` {}", numbers.join(", ")))
}

/// Returns the cell reference, with a section for every law that has none yet.
fn reference() -> String {
    let text = std::fs::read_to_string(root().join("docs/cell.md")).unwrap();
    let mark = |law: &LawName| format!("<!-- keys of learning.{} -->\n", law.as_str());
    let missing = LawName::ALL.iter().filter(|law| !text.contains(&mark(law)));
    let sections = missing
        .map(|law| format!("### `[learning.{}]`\n\n{}<!-- end -->\n\n", law.as_str(), mark(law)));
    text.replacen(FURTHER_LAWS, &format!("{}{FURTHER_LAWS}", sections.collect::<String>()), 1)
}

#[test]
fn the_schema_for_editors() {
    hold_derived_file("docs/cell.schema.json", &format!("{:#}\n", for_editors::<Cell>()));
}

#[test]
fn the_tables_of_the_cell_reference() {
    // In one test, as both write the document.
    hold_derived("docs/cell.md", "kinds of path", &kinds_of_path());
    let text = fill(&reference(), inlined::<Cell>().as_value()).unwrap();
    hold_derived_file("docs/cell.md", &text);
}

#[test]
fn every_table_of_a_cell_is_in_its_reference() {
    let (text, schema) = (reference(), inlined::<Cell>().to_value());
    let mut open = vec![(String::new(), &schema)];
    while let Some((path, table)) = open.pop() {
        let table = table.get("items").unwrap_or(table);
        for (name, key) in table["properties"].as_object().into_iter().flatten() {
            let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
            let of = key.get("items").unwrap_or(key);
            if of.get("properties").is_some() {
                let is_program = path.starts_with("program.") && path != "program.segment";
                let mark = format!("<!-- keys of {path} -->");
                assert!(is_program || text.contains(&mark), "docs/cell.md lacks {mark}");
                open.push((path, key));
            }
        }
    }
}

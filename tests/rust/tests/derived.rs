//! What is written from the schema of the cell description is not stale: `make derived` writes it anew.

#![allow(clippy::unwrap_used, reason = "a test fails where a file is not there")]

use std::path::Path;

use ilc_rt::config::Cell;
use ilc_rt::schema::{fill, for_editors, inlined};

fn read(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs").join(name);
    std::fs::read_to_string(path).unwrap()
}

/// The first line that differs, so that a failure is short.
fn differs(found: &str, expected: &str) -> Option<String> {
    let mut lines = found.lines().zip(expected.lines());
    let changed = lines.find(|(found, expected)| found != expected);
    changed
        .map(|(found, expected)| format!("{found}\nshould be\n{expected}"))
        .or_else(|| (found != expected).then(|| "the number of lines".to_owned()))
}

#[test]
fn the_schema_for_editors_is_current() {
    let current = format!("{:#}\n", for_editors::<Cell>());
    assert_eq!(differs(&read("cell.schema.json"), &current), None, "`make derived` writes it anew");
}

#[test]
fn the_tables_of_the_cell_reference_are_current() {
    let text = read("cell.md");
    let current = fill(&text, inlined::<Cell>().as_value()).unwrap();
    assert_eq!(differs(&text, &current), None, "`make derived` writes it anew");
}

#[test]
fn every_table_of_a_cell_is_in_its_reference() {
    let (text, schema) = (read("cell.md"), inlined::<Cell>().to_value());
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

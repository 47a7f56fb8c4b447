//! Files that derive from the schema of the cell description. `make derived` writes them.

#![allow(clippy::unwrap_used, reason = "a test fails where a file is not there")]

use ilc_rt::config::Cell;
use ilc_rt::schema::{fill, for_editors, inlined};
use ilc_tests::{hold_derived_file, root};

fn reference() -> String {
    std::fs::read_to_string(root().join("docs/cell.md")).unwrap()
}

#[test]
fn the_schema_for_editors() {
    hold_derived_file("docs/cell.schema.json", &format!("{:#}\n", for_editors::<Cell>()));
}

#[test]
fn the_tables_of_the_cell_reference() {
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

//! Tables of a document, written from the schema between two marks:
//! `<!-- keys of learning.pd -->` or `<!-- values of learning.law -->`, and `<!-- end -->`.

use std::fmt::Write as _;

use serde_json::Value;

use super::node::{Kind, Node};

/// Mark at which a table ends.
const END: &str = "<!-- end -->";

/// Returns the document with each of its tables rewritten.
///
/// # Errors
/// One line for a mark that names no table of the schema, or has no end.
pub fn fill(document: &str, schema: &Value) -> Result<String, String> {
    let mut text = String::new();
    let mut lines = document.lines();
    while let Some(line) = lines.next() {
        text.push_str(line);
        text.push('\n');
        let mark = line.strip_prefix("<!-- ").and_then(|rest| rest.strip_suffix(" -->"));
        let table = match mark.and_then(|mark| mark.split_once(" of ")) {
            Some(("keys", path)) => Node::root(schema).at(path).map(|node| keys(node)),
            Some(("values", path)) => Node::root(schema).at(path).map(|node| values(node)),
            _ => continue,
        };
        let table = table.ok_or_else(|| format!("{line}: the schema has no such table"))?;
        let _ = writeln!(text, "{table}{END}");
        if !lines.any(|line| line == END) {
            return Err(format!("{line}: no {END} follows"));
        }
    }
    Ok(text)
}

fn keys(table: Node) -> String {
    let mut text = "| key | default | allowed | meaning |\n|---|---|---|---|\n".to_owned();
    for key in table.keys().into_iter().filter(|key| key.kind() == Kind::Value) {
        let default = match key.default() {
            Some(default) => format!("`{default}`"),
            None if key.is_required => "needed".to_owned(),
            None => "none".to_owned(),
        };
        let cells = [default, key.allowed(), key.meaning()].map(|cell| cell.replace('|', "\\|"));
        let _ = writeln!(text, "| `{}` | {} |", key.name, cells.join(" | "));
    }
    text
}

fn values(key: Node) -> String {
    let mut text = "| value | meaning |\n|---|---|\n".to_owned();
    for (name, meaning) in key.choices() {
        let meaning = meaning.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|");
        let _ = writeln!(text, "| `{name}` | {meaning} |");
    }
    text
}

#[cfg(test)]
mod tests {
    use schemars::JsonSchema;
    use serde::{Deserialize, Serialize};

    use super::*;
    use crate::schema::{field_order, inlined};

    /// Colour of a lamp.
    #[derive(Serialize, Deserialize, JsonSchema)]
    #[serde(rename_all = "snake_case")]
    enum Colour {
        /// Like blood.
        DarkRed,
        /// Like grass.
        Green,
    }

    #[derive(Serialize, Deserialize, JsonSchema)]
    #[schemars(extend("x-order" = field_order::<Self>()))]
    struct Lamp {
        /// Its colour |
        /// at first.
        colour: Colour,
        /// Power.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 5e6))]
        power_w: f64,
        /// Number of times.
        #[schemars(range(min = 1))]
        flashes: Option<u32>,
    }

    #[derive(Serialize, Deserialize, JsonSchema)]
    #[schemars(extend("x-order" = field_order::<Self>()))]
    struct Room {
        lamp: Vec<Lamp>,
    }

    #[test]
    fn tables_are_written_between_their_marks() {
        let schema = inlined::<Room>().to_value();
        let empty = "# A\n<!-- keys of lamp -->\nold\n<!-- end -->\nB\n<!-- values of lamp.colour -->\n<!-- end -->\n";
        let full = fill(empty, &schema).unwrap();
        let expected = "# A\n<!-- keys of lamp -->\n\
            | key | default | allowed | meaning |\n|---|---|---|---|\n\
            | `colour` | needed | `dark_red`, `green` | Its colour \\| at first. |\n\
            | `power_w` | `0.0` | 0 to 5000000 | Power. |\n\
            | `flashes` | none | at least 1, whole | Number of times. |\n<!-- end -->\nB\n\
            <!-- values of lamp.colour -->\n| value | meaning |\n|---|---|\n\
            | `dark_red` | Like blood. |\n| `green` | Like grass. |\n<!-- end -->\n";
        assert_eq!(full, expected);
        assert_eq!(fill(&full, &schema).unwrap(), full);
        for wrong in ["<!-- keys of lap -->\n<!-- end -->", "<!-- keys of lamp -->\n"] {
            assert!(fill(wrong, &schema).unwrap_err().contains(wrong.lines().next().unwrap()));
        }
    }
}

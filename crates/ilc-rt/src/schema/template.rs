//! A commented file from a schema: every key with its meaning and range; the keys of an example with
//! their values, all others commented out with their defaults.

use std::fmt::Write as _;

use serde_json::Value as Json;
use toml::{Table, Value};

use super::node::{Kind, Node};

/// Longest line of a comment.
const WIDTH: usize = 100;

/// Returns a file with all keys of a schema; those of `example` have values.
pub fn template(schema: &Json, example: &Table) -> String {
    let mut text = String::new();
    write_table(&mut text, Node::root(schema), "", Some(example), true);
    text
}

/// Writes the keys of a table, then its tables; `is_told` unless the same table was explained
/// before.
fn write_table(text: &mut String, table: Node, path: &str, example: Option<&Table>, is_told: bool) {
    let keys = table.keys();
    for key in keys.iter().filter(|key| key.kind() == Kind::Value) {
        let found = example.and_then(|example| example.get(key.name));
        if !is_told && found.is_none() {
            continue;
        }
        if is_told {
            let allowed = key.allowed();
            let allowed = if allowed.is_empty() { String::new() } else { format!(" ({allowed})") };
            comment(text, &format!("{}{allowed}", key.meaning()));
        }
        let _ = match (found, key.default()) {
            (Some(value), _) => writeln!(text, "{} = {value}", key.name),
            (None, Some(default)) => writeln!(text, "# {} = {default}", key.name),
            (None, None) => writeln!(text, "# {} =", key.name),
        };
    }
    for key in keys.iter().filter(|key| key.kind() != Kind::Value) {
        let path =
            if path.is_empty() { key.name.to_owned() } else { format!("{path}.{}", key.name) };
        let found = example.and_then(|example| example.get(key.name));
        let (open, close) = if key.kind() == Kind::Tables { ("[[", "]]") } else { ("[", "]") };
        let mut write_one = |found: Option<&Table>, is_told: bool| {
            if !is_told && found.is_none() {
                return;
            }
            text.push('\n');
            if is_told {
                comment(text, &key.meaning());
            }
            let hash = if found.is_some() { "" } else { "# " };
            let _ = writeln!(text, "{hash}{open}{path}{close}");
            write_table(text, *key, &path, found, is_told);
        };
        match found {
            Some(Value::Array(items)) => {
                for (i, item) in items.iter().enumerate() {
                    write_one(item.as_table(), is_told && i == 0);
                }
            }
            Some(Value::Table(table)) => write_one(Some(table), is_told),
            _ => write_one(None, is_told),
        }
    }
}

/// Writes a comment in lines of at most [`WIDTH`] characters.
fn comment(text: &mut String, words: &str) {
    let mut line = String::from("#");
    for word in words.split_whitespace() {
        if line.len() + 1 + word.len() > WIDTH {
            let _ = writeln!(text, "{line}");
            line = String::from("#");
        }
        line.push(' ');
        line.push_str(word);
    }
    if line.len() > 1 {
        let _ = writeln!(text, "{line}");
    }
}

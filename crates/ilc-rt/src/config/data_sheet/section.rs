//! The section `[axis.drive]` as text: alone, or in the text of a cell description.

use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, Value, value};

use super::error::DataSheetError;
use super::import::Imported;
use crate::config::{Drive, ObjectName};

/// Returns the section alone, with comments on what the drive lacks.
pub fn section(imported: &Imported) -> String {
    let mut document = DocumentMut::new();
    let mut axis = Table::new();
    axis.set_implicit(true);
    axis.insert("drive", Item::Table(table(&imported.drive)));
    document.insert("axis", Item::Table(axis));
    let lacks = imported.lacks.iter().map(ToString::to_string);
    let mut comments = String::new();
    for line in lacks.chain(imported.remarks.iter().cloned()) {
        comments.extend(["# ", &line, "\n"]);
    }
    format!("{comments}{document}")
}

/// Returns the text of a cell description with the section of the named axis replaced; everything
/// else stays as it is, comments included.
///
/// # Errors
/// [`DataSheetError::Cell`] for a text without that axis.
pub fn with_section(
    text: &str,
    file: &str,
    axis: &str,
    imported: &Imported,
) -> Result<String, DataSheetError> {
    let refused = |reason: String| DataSheetError::Cell { file: file.to_owned(), reason };
    let mut document: DocumentMut =
        text.parse().map_err(|error: toml_edit::TomlError| refused(error.message().to_owned()))?;
    let axes = document
        .get_mut("axis")
        .and_then(Item::as_array_of_tables_mut)
        .ok_or_else(|| refused("it has no [[axis]] table".to_owned()))?;
    let is_it = |table: &&mut Table| table.get("name").and_then(Item::as_str) == Some(axis);
    let Some(found) = axes.iter_mut().find(is_it) else {
        return Err(refused(format!("it has no [[axis]] with name = {axis:?}")));
    };
    found.insert("drive", Item::Table(table(&imported.drive)));
    Ok(document.to_string())
}

/// Returns the keys of a drive that differ from their defaults.
fn table(drive: &Drive) -> Table {
    let mut table = Table::new();
    for (key, number) in [
        ("vendor", drive.vendor),
        ("product", drive.product),
        ("revision", drive.revision),
        ("serial", drive.serial),
        ("position_unit", drive.position_unit),
        ("velocity_unit", drive.velocity_unit),
    ] {
        if let Some(number) = number {
            table.insert(key, hexadecimal(number));
        }
    }
    if !drive.keep.is_empty() {
        table.insert("keep", names(&drive.keep));
    }
    let options = [
        ("quick_stop_option", drive.quick_stop_option),
        ("fault_reaction_option", drive.fault_reaction_option),
        ("connection_loss_option", drive.connection_loss_option),
    ];
    let options = options.map(|(key, option)| (key, option.map(i64::from)));
    let home = ("home_offset", drive.home_offset.map(i64::from));
    let polarity = ("polarity", Some(i64::from(drive.polarity)).filter(|bits| *bits != 0));
    for (key, number) in options.into_iter().chain([home, polarity]) {
        if let Some(number) = number {
            table.insert(key, value(number));
        }
    }
    for (key, ratio) in [
        ("encoder_resolution", drive.encoder_resolution),
        ("gear_ratio", drive.gear_ratio),
        ("feed_constant", drive.feed_constant),
    ] {
        if let Some(ratio) = ratio {
            table.insert(key, value(Array::from_iter(ratio.map(i64::from))));
        }
    }
    let mut pdo = Table::new();
    for (key, list) in [
        ("command", &drive.pdo.command),
        ("status", &drive.pdo.status),
        ("motion", &drive.pdo.motion),
    ] {
        if let Some(list) = list {
            pdo.insert(key, names(list));
        }
    }
    if !pdo.is_empty() {
        table.insert("pdo", Item::Table(pdo));
    }
    let mut start_up = ArrayOfTables::new();
    for object in &drive.start_up {
        let mut entry = Table::new();
        entry.insert("object", value(object.object.to_string()));
        entry.insert("type", value(format!("{:?}", object.kind).to_lowercase()));
        entry.insert("value", value(object.value));
        if !object.read_back {
            entry.insert("read_back", value(false));
        }
        start_up.push(entry);
    }
    if !start_up.is_empty() {
        table.insert("start_up", Item::ArrayOfTables(start_up));
    }
    table
}

fn names(list: &[ObjectName]) -> Item {
    value(list.iter().map(ToString::to_string).collect::<Array>())
}

/// Returns a number in hexadecimal, as data sheets give it.
fn hexadecimal(number: u32) -> Item {
    let text = format!("0x{number:08X}");
    text.parse::<Value>().map_or_else(|_| value(i64::from(number)), Item::Value)
}

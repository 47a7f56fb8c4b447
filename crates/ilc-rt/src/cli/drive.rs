//! `ilc-rt drive`: the description of a drive, from the data sheet of its maker.

use std::path::{Path, PathBuf};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};

use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::config::data_sheet::{
    DataSheet, DataSheetError, Imported, import, section, with_section,
};
use crate::config::{CELL_BYTES_MAX, Cell, Mode, read_file};

#[derive(Args)]
pub(super) struct DriveArguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Write the section [axis.drive] of a cell description from a data sheet (EDS or DCF).
    Import(Import),
}

#[derive(Args)]
#[command(
    after_help = "Exit status: 0 done, 1 the cell description could not be written, 2 bad input, or a \
drive that cannot run.

Examples:
  ilc-rt drive import servo.eds
  ilc-rt drive import servo.dcf --mode csv --node 3
  ilc-rt drive import servo.eds --write gantry.toml --axis x"
)]
struct Import {
    /// Data sheet: EDS, or DCF with the values of a configured drive.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Node number, for values that depend on it; that of the file by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=127))]
    node: Option<u8>,
    /// Mode that the drive must have; that of the axis, or csp.
    #[arg(long, value_name = "MODE", value_parser = modes())]
    mode: Option<Mode>,
    /// Cell description to write the section into.
    #[arg(long, value_name = "CELL", requires = "axis")]
    write: Option<PathBuf>,
    /// Axis of the cell description.
    #[arg(long, value_name = "NAME", requires = "write")]
    axis: Option<String>,
}

fn modes() -> impl TypedValueParser<Value = Mode> {
    PossibleValuesParser::new(Mode::ALL.map(Mode::name))
        .map(|name| Mode::ALL.into_iter().find(|mode| mode.name() == name).unwrap_or(Mode::Csp))
}

/// Returns the exit status.
pub(super) fn drive(arguments: &DriveArguments) -> u8 {
    let Action::Import(arguments) = &arguments.action;
    match (&arguments.write, &arguments.axis) {
        (Some(cell), Some(axis)) => import_into(arguments, cell, axis),
        _ => match imported(arguments, arguments.node, arguments.mode.unwrap_or(Mode::Csp)) {
            Ok(found) => {
                if show::print(&section(&found)) {
                    0
                } else {
                    EXIT_FAILURE
                }
            }
            Err(error) => refuse(&error),
        },
    }
}

fn refuse(error: &dyn std::fmt::Display) -> u8 {
    show::complain(error);
    EXIT_BAD_INPUT
}

fn imported(arguments: &Import, node: Option<u8>, mode: Mode) -> Result<Imported, DataSheetError> {
    import(&DataSheet::load(&arguments.file, node)?, mode)
}

/// Writes the section of an axis into a cell description, if the result is one.
fn import_into(arguments: &Import, path: &Path, axis: &str) -> u8 {
    let file = path.display().to_string();
    let cell = match Cell::load(path) {
        Ok(cell) => cell,
        Err(error) => return refuse(&error),
    };
    let Some(described) = cell.axes.iter().find(|described| described.name == axis) else {
        let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
        return refuse(&format_args!("{file}: it has no axis {axis}: it has {}", names.join(", ")));
    };
    let mode = described.interface;
    if let Some(other) = arguments.mode.filter(|other| *other != mode) {
        let (wanted, found) = (other.name(), mode.name());
        return refuse(&format_args!(
            "{file}: --mode {wanted}: axis {axis} has interface \"{found}\""
        ));
    }
    let found = match imported(arguments, arguments.node.or(Some(described.node)), mode) {
        Ok(found) => found,
        Err(error) => return refuse(&error),
    };
    let text = match read_file(path, CELL_BYTES_MAX).map(String::from_utf8) {
        Ok(Ok(text)) => text,
        Ok(Err(_)) => return refuse(&format_args!("{file}: cannot be read: it is not UTF-8")),
        Err(reason) => return refuse(&format_args!("{file}: cannot be read: {reason}")),
    };
    let written = match with_section(&text, &file, axis, &found) {
        Ok(written) => written,
        Err(error) => return refuse(&error),
    };
    if let Err(error) = Cell::parse(&written, &file) {
        return refuse(&error);
    }
    if let Err(error) = replace(path, &written) {
        show::complain(&format_args!("{file}: cannot be written: {error}"));
        return EXIT_FAILURE;
    }
    show::say(&format_args!(
        "{file}: [axis.drive] of axis {axis} is that of {}",
        arguments.file.display()
    ));
    for lack in &found.lacks {
        show::say(&format_args!("  {lack}"));
    }
    for remark in &found.remarks {
        show::say(&format_args!("  {remark}"));
    }
    0
}

/// Replaces a file as a whole, so that a full disk leaves the old one.
fn replace(path: &Path, text: &str) -> std::io::Result<()> {
    let path = path.canonicalize()?;
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".new");
    let beside = path.with_file_name(name);
    let written = std::fs::write(&beside, text)
        .and_then(|()| std::fs::set_permissions(&beside, std::fs::metadata(&path)?.permissions()))
        .and_then(|()| std::fs::rename(&beside, &path));
    if written.is_err() {
        let _ = std::fs::remove_file(&beside);
    }
    written
}

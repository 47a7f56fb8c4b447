//! Ranges and contradictions of a cell description, and one-line syntax errors.

mod axis;
mod checker;
mod drive;
mod homing;
mod input;
mod learning;
mod program;
mod simulation;
mod torque;

use super::cell::Cell;
use super::error::ConfigError;
use crate::record::{NAME_MAX, TEXT_MAX, printable};
use crate::trajectory::MAX_AXES;

use checker::Checker;

/// Keys of earlier versions, and their current names.
const RENAMED: [(&str, &str); 1] =
    [("curvature_acceleration_m_s2", "curvature_acceleration_max_m_s2")];

/// Turns a TOML error into one line that names the place.
pub(super) fn syntax(text: &str, file: &str, error: &toml::de::Error) -> ConfigError {
    let at = error.span().map_or(0, |span| span.start).min(text.len());
    let before = &text[..at];
    let line = before.matches('\n').count() + 1;
    let table = before
        .lines()
        .rev()
        .chain(std::iter::once(""))
        .map(|row| row.split('#').next().unwrap_or("").trim())
        .find(|row| row.starts_with('['))
        .unwrap_or("top level");
    let row = text.lines().nth(line - 1).unwrap_or("").trim();
    let key = match row.split_once('=') {
        Some((name, value)) if !row.starts_with('[') => {
            format!("{table} {} = {}", name.trim(), value.split('#').next().unwrap_or("").trim())
        }
        // A key that is missing is reported at the head of its table.
        _ if row.starts_with('[') => row.split('#').next().unwrap_or("").trim().to_owned(),
        _ => table.to_owned(),
    };
    let message = error.message().replace('\n', " ");
    // The error of an unknown key has the key alone as its place.
    let place = error.span().and_then(|span| text.get(span));
    let renamed = RENAMED.iter().find(|(old, _)| place == Some(*old));
    let reason = match renamed {
        Some((_, new)) => format!("it is now called {new}"),
        None => printable(&message, TEXT_MAX),
    };
    let (file, key) = (printable(file, TEXT_MAX), printable(&key, TEXT_MAX));
    ConfigError::Syntax { file, line, key, reason }
}

/// Checks every range and every pair of values that must agree; for cells changed after loading.
///
/// # Errors
/// [`ConfigError::Value`] for the first invalid value.
pub fn check(cell: &Cell) -> Result<(), ConfigError> {
    let v = Checker { file: cell.file.display().to_string() };
    let name = &cell.cell.name;
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    v.that(
        !name.is_empty() && name.len() <= NAME_MAX && name.chars().all(plain),
        "[cell] name",
        name,
        &format!("1 to {NAME_MAX} letters, digits, '-' and '_'"),
    )?;
    v.that(
        (1..=MAX_AXES).contains(&cell.axes.len()),
        "[[axis]] count",
        &cell.axes.len(),
        &format!("1 to {MAX_AXES} axes"),
    )?;
    axis::names(cell, &v)?;
    axis::nodes(cell, &v)?;
    v.ranges(cell)?;
    axis::buses(cell, &v)?;
    for axis in &cell.axes {
        axis::check(axis, cell, &v)?;
    }
    input::check(cell, &v)?;
    if let Some(tcp) = &cell.tcp_encoder {
        v.that(
            cell.axes.len() <= 2,
            "[tcp_encoder] node",
            &tcp.node,
            "at most 2 axes: one frame holds two coordinates",
        )?;
    }
    program::check(cell, &v)?;
    learning::check(cell, &v)?;
    let simulation = &cell.simulation;
    v.that(
        cell.cell.cycle_us.is_multiple_of(simulation.step_us),
        "[simulation] step_us",
        &simulation.step_us,
        "a divisor of [cell] cycle_us",
    )?;
    if let Some(delta) = &simulation.delta {
        simulation::delta(cell, delta, &v)?;
    }
    for change in &simulation.changes {
        let Some(name) = &change.axis else { continue };
        let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
        v.that(
            names.contains(&name.as_str()),
            "[[simulation.change]] axis",
            name,
            &format!("the name of an axis: {}", names.join(", ")),
        )?;
    }
    Ok(())
}

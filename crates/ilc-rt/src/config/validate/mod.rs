//! Ranges and contradictions of a cell description, and one-line syntax errors.

mod axis;
mod checker;
mod learning;
mod program;

use super::cell::Cell;
use super::error::ConfigError;
use crate::record::{NAME_MAX, TEXT_MAX, printable};
use crate::trajectory::MAX_AXES;

use checker::Checker;

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
    let reason = printable(&error.message().replace('\n', " "), TEXT_MAX);
    let (file, key) = (printable(file, TEXT_MAX), printable(&key, TEXT_MAX));
    ConfigError::Syntax { file, line, key, reason }
}

/// Checks every range and every pair of values that must agree; for cells changed after loading.
///
/// # Errors
/// [`ConfigError::Value`] for the first value that is not allowed.
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
    v.range("[cell] cycle_us", f64::from(cell.cell.cycle_us), 100.0, 1e5)?;
    v.range("[bus] load_max", cell.bus.load_max, 0.05, 1.0)?;
    v.range("[bus] bitrate_bit_s", f64::from(cell.bus.bitrate_bit_s), 1e4, 1e6)?;
    v.that(
        (1..=MAX_AXES).contains(&cell.axes.len()),
        "[[axis]] count",
        &cell.axes.len(),
        &format!("1 to {MAX_AXES} axes"),
    )?;
    axis::names(cell, &v)?;
    axis::nodes(cell, &v)?;
    for axis in &cell.axes {
        axis::check(axis, &v)?;
    }
    if let Some(tcp) = &cell.tcp_encoder {
        v.range("[tcp_encoder] counts_per_m", tcp.counts_per_m, 1.0, 1e10)?;
        v.that(
            cell.axes.len() <= 2,
            "[tcp_encoder] node",
            &tcp.node,
            "at most 2 axes: one frame holds two coordinates",
        )?;
    }
    program::check(cell, &v)?;
    learning::check(cell, &v)?;
    v.range("[safety] silent_cycles_max", f64::from(cell.safety.silent_cycles_max), 1.0, 1e3)?;
    v.range("[safety] overrun_cycles_max", f64::from(cell.safety.overrun_cycles_max), 1.0, 1e4)?;
    v.range("[safety] answer_timeout_s", cell.safety.answer_timeout_s, 0.01, 60.0)?;
    let simulation = &cell.simulation;
    v.range("[simulation] orthogonality_rad", simulation.orthogonality_rad, -0.1, 0.1)?;
    v.range("[simulation] encoder_noise_m", simulation.encoder_noise_m, 0.0, 1e-3)?;
    v.that(
        cell.cell.cycle_us.is_multiple_of(simulation.step_us),
        "[simulation] step_us",
        &simulation.step_us,
        "a divisor of [cell] cycle_us",
    )
}

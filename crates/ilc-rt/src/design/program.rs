//! From `[program]` to the interpolator, by the kind of path, and to the path data of the records.

use std::fmt::Write as _;

use serde_json::json;

use super::error::DesignError;
use crate::config::{Cell, Corner, PathKind, read_beside};
use crate::record::fingerprint;
use crate::trajectory::kind::{Job, ProgramError};
use crate::trajectory::{AxisLimits, Interpolator, TrajectoryError};

/// Rounding tolerance of set points at the ends of an axis' range.
const ROUNDING_M: f64 = 1e-12;

/// Plans the program of a cell; the set points of every kind of path are verified as they will be
/// sent.
///
/// # Errors
/// [`DesignError::Program`] for a path beyond the limits, [`DesignError::PartProgram`] for a
/// refused G-code file, [`DesignError::Table`] for a refused table of set points.
pub(super) fn interpolator(
    cell: &Cell,
    limits: &[AxisLimits],
) -> Result<Interpolator, DesignError> {
    planned(cell, limits)?.verified(limits).map_err(|source| refused(cell, source))
}

/// Returns the content of the file of a cell's program; empty for kinds without a file.
///
/// # Errors
/// [`DesignError::ProgramFile`] for a file that cannot be read.
pub(crate) fn text(cell: &Cell) -> Result<Vec<u8>, DesignError> {
    let Some(wanted) = cell.program.kind.entry().file else { return Ok(Vec::new()) };
    if let Some(text) = &cell.program_text {
        return Ok(text.clone());
    }
    let name = cell.program.file_name();
    read_beside(&cell.file, name, wanted.bytes_max).map_err(|reason| DesignError::ProgramFile {
        file: cell.file.with_file_name(name).display().to_string(),
        reason,
        what: wanted.content,
    })
}

fn planned(cell: &Cell, limits: &[AxisLimits]) -> Result<Interpolator, DesignError> {
    let program = &cell.program;
    let kind = program.kind.entry();
    let file = cell.file.with_file_name(program.file_name()).display().to_string();
    let text = text(cell)?;
    let axis_names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
    let job = Job {
        program,
        limits,
        units: &cell.units(),
        axis_names: &axis_names,
        cycle_s: cell.cycle_s(),
        text: &text,
    };
    (kind.plan)(&job).map_err(|error| match error {
        ProgramError::Plan(source) => refused(cell, source),
        ProgramError::Gcode(source) => DesignError::PartProgram { file, source },
        ProgramError::Table(source) => DesignError::Table { file, source },
    })
}

/// Refuses set points outside the range of an axis, which a curve may reach between its points.
pub(super) fn check_range(cell: &Cell, reference_m: &[f64]) -> Result<(), DesignError> {
    for (i, axis) in cell.axes.iter().enumerate() {
        let (low_m, high_m) = (axis.limits.position_min_m, axis.limits.position_max_m);
        let beyond = |p: f64| (low_m - p).max(p - high_m);
        let farthest = reference_m.iter().skip(i).step_by(cell.n_axes()).copied();
        let farthest =
            farthest.fold(low_m, |most, p| if beyond(p) > beyond(most) { p } else { most });
        if beyond(farthest) > ROUNDING_M {
            return Err(DesignError::Range {
                file: cell.file.display().to_string(),
                axis: axis.name.clone(),
                unit: axis.unit.symbol(),
                reached_m: farthest,
                low_m,
                high_m,
            });
        }
    }
    Ok(())
}

/// Returns the program as stored in records: every number of points; for other paths the kind and
/// the fingerprint of the set points.
pub(super) fn program_json(cell: &Cell, reference_m: &[f64]) -> String {
    let program = &cell.program;
    let segments: Vec<_> = program
        .segments
        .iter()
        .map(|s| json!({ "to_m": s.to_m, "feed_m_s": s.feed_m_s.unwrap_or(program.feed_m_s) }))
        .collect();
    let corner = match program.corner {
        Corner::ExactStop => json!("exact_stop"),
        Corner::Blend => json!({ "blend_s": program.blend_s }),
    };
    let mut description = json!({
        "start_m": program.start_m,
        "segments": segments,
        "corner": corner,
        "dwell_before_s": program.dwell_before_s,
        "dwell_after_s": program.dwell_after_s,
        "settle_s": program.settle_s,
    });
    let plain = program.segments.iter().all(|s| s.center_m.is_none() && s.dwell_s <= 0.0);
    if program.kind != PathKind::Points || !plain {
        let mut bits = String::with_capacity(17 * reference_m.len());
        for position_m in reference_m {
            // Writing to a string cannot fail.
            let _ = write!(bits, "{:x} ", position_m.to_bits());
        }
        description["kind"] = json!(program.kind.name());
        description["set_points"] = json!(fingerprint(&bits));
    }
    description.to_string()
}

fn refused(cell: &Cell, source: TrajectoryError) -> DesignError {
    let key = match source.axis().and_then(|i| Some((i, cell.axes.get(i)?))) {
        Some((i, axis)) => format!("[program] (axis {} is {})", i + 1, axis.name),
        None => "[program]".to_owned(),
    };
    DesignError::Program {
        file: cell.file.display().to_string(),
        key,
        source: Box::new(source),
        units: cell.units(),
    }
}

//! Checks of `[program]` that its schema does not express.

use super::checker::Checker;
use crate::config::{Cell, ConfigError};
use crate::trajectory::kind::Key;

/// Checks the ranges of the program, and the requirements of its kind of path.
pub(super) fn check(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let program = &cell.program;
    v.range("[program] blend_s", program.blend_s, cell.cycle_s(), 1.0)?;
    check_kind(cell, v)?;
    check_point(cell, v, "[program] start_m", &program.start_m)?;
    for (number, segment) in program.segments.iter().enumerate() {
        check_point(cell, v, &format!("[[program.segment]] {} to_m", number + 1), &segment.to_m)?;
    }
    Ok(())
}

/// Rejects keys that the kind of path does not read, and missing ones that it requires.
fn check_kind(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let program = &cell.program;
    let kind = program.kind.entry();
    for (key, is_given) in program.given() {
        let name = key.name();
        let (is_read, is_needed) = (kind.reads.contains(&key), kind.needs.contains(&key));
        v.that(is_read || !is_given, name, &"given", "not used by this kind of path; remove it")?;
        let needed = match key {
            Key::Segments => "at least one is needed by this kind of path",
            _ => "needed by this kind of path",
        };
        v.that(is_given || !is_needed, name, &"missing", needed)?;
    }
    v.that(
        !kind.is_plane || cell.n_axes() == 2,
        "[program] kind",
        &"a plane shape",
        "needs a cell of 2 axes",
    )?;
    let Some(file) = &program.file else { return Ok(()) };
    let name = file.to_string_lossy();
    v.that(
        !name.contains(char::is_control) && (1..=255).contains(&name.len()),
        "[program] file",
        &format!("{:?}", name.chars().take(60).collect::<String>()),
        "a name of 1 to 255 bytes without control characters",
    )
}

fn check_point(cell: &Cell, v: &Checker, key: &str, point_m: &[f64]) -> Result<(), ConfigError> {
    v.that(
        point_m.len() == cell.n_axes(),
        key,
        &format!("{point_m:?}"),
        &format!("{} coordinates, one an axis", cell.n_axes()),
    )?;
    for (axis, &position) in cell.axes.iter().zip(point_m) {
        let l = &axis.limits;
        if !(l.position_min_m..=l.position_max_m).contains(&position) {
            return Err(v.refuse(
                key,
                &position,
                &format!("axis {} reaches {} to {}", axis.name, l.position_min_m, l.position_max_m),
            ));
        }
    }
    Ok(())
}

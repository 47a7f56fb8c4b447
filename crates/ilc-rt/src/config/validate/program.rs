//! What is allowed in `[program]`.

use super::checker::Checker;
use crate::config::{Cell, ConfigError, PathKind};

/// Ranges of the program, and what its kind of path needs.
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

/// What each kind of path needs, and what it would not read.
fn check_kind(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let program = &cell.program;
    let kind = program.kind;
    let by_segments = matches!(kind, PathKind::Points | PathKind::Spline | PathKind::Modulated);
    v.that(
        by_segments != program.segments.is_empty(),
        "[program] kind, [[program.segment]] count",
        &program.segments.len(),
        if by_segments { "at least one segment" } else { "0, as this kind has none" },
    )?;
    let sections = [
        (
            "[program] file",
            program.file.is_some(),
            matches!(kind, PathKind::Gcode | PathKind::Table),
            true,
        ),
        ("[program] rapid_m_s", program.rapid_m_s.is_some(), kind == PathKind::Gcode, false),
        ("[program] block_delete", program.block_delete, kind == PathKind::Gcode, false),
        ("[program.butterfly]", program.butterfly.is_some(), kind == PathKind::Butterfly, false),
        ("[program.spiral]", program.spiral.is_some(), kind == PathKind::Spiral, true),
        ("[program.raster]", program.raster.is_some(), kind == PathKind::Raster, true),
        ("[program.modulated]", program.modulated.is_some(), kind == PathKind::Modulated, true),
        (
            "[program] curvature_acceleration_m_s2",
            program.curvature_acceleration_m_s2.is_some(),
            matches!(kind, PathKind::Spline | PathKind::Butterfly | PathKind::Spiral),
            false,
        ),
    ];
    for (key, given, used, needed) in sections {
        v.that(used || !given, key, &"given", "not used by this kind of path; remove it")?;
        v.that(given || !(used && needed), key, &"missing", "needed by this kind of path")?;
    }
    let plane = matches!(kind, PathKind::Butterfly | PathKind::Spiral | PathKind::Raster);
    v.that(
        !plane || cell.n_axes() == 2,
        "[program] kind",
        &"a plane shape",
        "needs a cell of 2 axes",
    )?;
    if let Some(file) = &program.file {
        let name = file.to_string_lossy();
        v.that(
            !name.contains(char::is_control) && (1..=255).contains(&name.len()),
            "[program] file",
            &format!("{:?}", name.chars().take(60).collect::<String>()),
            "a name of 1 to 255 bytes without control characters",
        )?;
    }
    for (number, segment) in program.segments.iter().enumerate() {
        let key = |name: &str| format!("[[program.segment]] {} {name}", number + 1);
        let extra = segment.center_m.is_some() || segment.clockwise || segment.dwell_s > 0.0;
        v.that(
            kind == PathKind::Points || !extra,
            &key("center_m, clockwise, dwell_s"),
            &"given",
            "only with kind = \"points\"",
        )?;
    }
    Ok(())
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

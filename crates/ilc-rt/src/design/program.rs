//! From `[program]` to the interpolator: which planner each kind of path goes to.

use serde_json::json;
use std::fmt::Write as _;

use super::error::DesignError;
use crate::config::{
    AxisUnit, Cell, Corner, GCODE_BYTES_MAX, PathKind, TABLE_BYTES_MAX, read_beside,
};
use crate::record::fingerprint;
use crate::trajectory::curve::{Butterfly, Curve, Run, RunLimits, Spiral, Spline};
use crate::trajectory::program::{
    GcodeProgram, GcodeSetting, SetPointTable, TableError, read_gcode, read_table,
};
use crate::trajectory::{
    ArcSpec, AxisLimits, CornerRule, ExponentialSigmoid, Interpolator, ModulatedSegment,
    PathSegment, PathSpec, SampledMotion, TrajectoryError, raster, set_points,
};

/// How far the first row of a table may be from the start.
const START_M: f64 = 1e-9;
/// How far set points may round beyond the range of an axis.
const ROUNDING_M: f64 = 1e-12;

/// Plans the program of a cell; its set points, whatever kind of path they belong to, are verified as
/// they will be sent.
///
/// # Errors
/// [`DesignError::Program`] for a path beyond the limits, [`DesignError::PartProgram`] for
/// a G-code file that is refused, [`DesignError::Table`] for a table of set points.
pub(super) fn interpolator(
    cell: &Cell,
    limits: &[AxisLimits],
) -> Result<Interpolator, DesignError> {
    planned(cell, limits)?.verified(limits).map_err(|source| refused(cell, source))
}

fn planned(cell: &Cell, limits: &[AxisLimits]) -> Result<Interpolator, DesignError> {
    let program = &cell.program;
    let refused = |source| refused(cell, source);
    let dwells = (program.dwell_before_s, program.dwell_after_s);
    let play = |motion: &SampledMotion| Interpolator::play(motion, dwells.0, dwells.1);
    let start = || [program.start_m[0], program.start_m.get(1).copied().unwrap_or(0.0)];
    match program.kind {
        PathKind::Points => straight(cell, limits, points(cell), &[], 0.0),
        PathKind::Gcode => {
            let read = gcode(cell)?;
            straight(cell, limits, read.segments, &read.rapid, read.dwell_before_s)
        }
        PathKind::Table => {
            let table = table(cell)?;
            let motion = set_points(&table.position_m, limits, cell.cycle_s()).map_err(refused)?;
            play(&motion).map_err(refused)
        }
        PathKind::Raster => {
            let Some(shape) = program.raster else { return Err(refused(TrajectoryError::Empty)) };
            let segments = raster(
                start(),
                shape.width_m,
                shape.pitch_m,
                shape.rows,
                program.feed_m_s,
                shape.there_and_back,
            )
            .map_err(refused)?;
            straight(cell, limits, segments, &[], 0.0)
        }
        PathKind::Spline => {
            let points_m: Vec<Vec<f64>> = std::iter::once(program.start_m.clone())
                .chain(program.segments.iter().map(|segment| segment.to_m.clone()))
                .collect();
            let spline = Spline::through(&points_m).map_err(refused)?;
            along(cell, limits, &spline).and_then(|motion| play(&motion).map_err(refused))
        }
        PathKind::Butterfly => {
            let shape = program.butterfly.unwrap_or_default();
            // The centre that puts its first point at the start.
            let first =
                Butterfly::new(shape.scale_m, shape.turns, [0.0; 2]).map_err(refused)?.at(0.0)[0];
            let center = [start()[0] - first[0], start()[1] - first[1]];
            let curve = Butterfly::new(shape.scale_m, shape.turns, center).map_err(refused)?;
            along(cell, limits, &curve).and_then(|motion| play(&motion).map_err(refused))
        }
        PathKind::Spiral => {
            let Some(shape) = program.spiral else { return Err(refused(TrajectoryError::Empty)) };
            let curve = Spiral::new(shape.pitch_m, shape.turns, start()).map_err(refused)?;
            along(cell, limits, &curve).and_then(|motion| play(&motion).map_err(refused))
        }
        PathKind::Modulated => {
            let Some(shape) = program.modulated else {
                return Err(refused(TrajectoryError::Empty));
            };
            let segments: Vec<ModulatedSegment> = program
                .segments
                .iter()
                .map(|segment| ModulatedSegment {
                    to_m: segment.to_m.clone(),
                    feed_m_s: segment.feed_m_s.unwrap_or(program.feed_m_s),
                    amplitude_m: shape.amplitude_m,
                    frequency_hz: shape.frequency_hz,
                })
                .collect();
            ExponentialSigmoid::plan(&program.start_m, &segments, limits)
                .and_then(|plan| {
                    SampledMotion::sample(plan.duration_s(), cell.cycle_s(), plan.n_axes(), |t_s| {
                        (plan.at(t_s), plan.programmed_m(t_s))
                    })
                })
                .and_then(|motion| play(&motion))
                .map_err(refused)
        }
    }
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

/// The program as the records keep it: every number of points, and of other paths the kind and the
/// fingerprint of the set points.
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
        description["kind"] = json!(format!("{:?}", program.kind).to_lowercase());
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

fn points(cell: &Cell) -> Vec<PathSegment> {
    let program = &cell.program;
    program
        .segments
        .iter()
        .map(|segment| PathSegment {
            to_m: segment.to_m.clone(),
            feed_m_s: segment.feed_m_s.unwrap_or(program.feed_m_s),
            arc: segment.center_m.map(|center_m| ArcSpec {
                plane: [0, 1],
                center_m,
                clockwise: segment.clockwise,
            }),
            dwell_s: segment.dwell_s,
        })
        .collect()
}

/// What the part program says.
fn gcode(cell: &Cell) -> Result<GcodeProgram, DesignError> {
    let program = &cell.program;
    let (file, text) = read_file(cell, "G-code", GCODE_BYTES_MAX)?;
    let rotary: Vec<bool> = cell.axes.iter().map(|axis| axis.unit == AxisUnit::Rad).collect();
    let setting = GcodeSetting {
        start_m: &program.start_m,
        feed_m_s: program.feed_m_s,
        rapid_m_s: program.rapid_m_s.unwrap_or(program.feed_m_s),
        rotary: &rotary,
        exact_corners: program.corner == Corner::ExactStop,
        block_delete: program.block_delete,
    };
    read_gcode(&text, &setting).map_err(|source| DesignError::PartProgram { file, source })
}

/// The set points of the table; refused unless they begin where the axes rest before a run.
fn table(cell: &Cell) -> Result<SetPointTable, DesignError> {
    let (file, text) = read_file(cell, "set points", TABLE_BYTES_MAX)?;
    let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
    let refused = |source| DesignError::Table { file: file.clone(), source };
    let table = read_table(&text, &names).map_err(refused)?;
    for ((name, &found_m), &start_m) in
        names.iter().zip(&table.position_m).zip(&cell.program.start_m)
    {
        if (found_m - start_m).abs() > START_M {
            return Err(refused(TableError {
                line: table.lines.first().copied().unwrap_or(1),
                found: format!("axis {name} begins at {found_m}"),
                allowed: format!("the first row must be [program] start_m, {start_m}"),
            }));
        }
    }
    Ok(table)
}

/// The name and the text of `[program] file`, which is a text file of `what`.
fn read_file(
    cell: &Cell,
    what: &'static str,
    bytes_max: u64,
) -> Result<(String, Vec<u8>), DesignError> {
    let name = cell.program.file.clone().unwrap_or_default();
    let file = cell.file.with_file_name(&name).display().to_string();
    match read_beside(&cell.file, &name, bytes_max) {
        Ok(text) => Ok((file, text)),
        Err(reason) => Err(DesignError::ProgramFile { file, reason, what }),
    }
}

/// Plans lines and arcs; `rapid` tells which of them go as fast as the axes allow, up to their feed.
fn straight(
    cell: &Cell,
    limits: &[AxisLimits],
    segments: Vec<PathSegment>,
    rapid: &[bool],
    dwell_s: f64,
) -> Result<Interpolator, DesignError> {
    let program = &cell.program;
    let spec = PathSpec {
        start_m: program.start_m.clone(),
        segments,
        corner: match program.corner {
            Corner::ExactStop => CornerRule::ExactStop,
            Corner::Blend => CornerRule::Blend { window_s: program.blend_s },
        },
        dwell_before_s: program.dwell_before_s + dwell_s,
        dwell_after_s: program.dwell_after_s,
    };
    if spec.corner == CornerRule::ExactStop {
        spec.check_feeds(limits, rapid).map_err(|source| refused(cell, source))?;
    }
    Interpolator::plan(&spec, limits, cell.cycle_s()).map_err(|source| refused(cell, source))
}

fn along(
    cell: &Cell,
    limits: &[AxisLimits],
    curve: &impl Curve,
) -> Result<SampledMotion, DesignError> {
    let program = &cell.program;
    let limits = RunLimits {
        feed_m_s: program.feed_m_s,
        curvature_acceleration_m_s2: program.curvature_acceleration_m_s2.unwrap_or(f64::INFINITY),
        axes: limits.to_vec(),
    };
    Run::plan(curve, &limits, cell.cycle_s())
        .map(|run| run.motion().clone())
        .map_err(|source| refused(cell, source))
}

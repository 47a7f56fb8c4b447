//! Ranges and contradictions of a cell description, and one-line syntax errors.

use super::cell::{Axis, Cell, Interface};
use super::error::ConfigError;
use super::path::PathKind;
use super::program::{LawName, Measure};
use crate::trajectory::MAX_AXES;

/// Highest CANopen node number.
const NODE_MAX: u8 = 127;

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
    let reason = error.message().replace('\n', " ");
    ConfigError::Syntax { file: file.to_owned(), line, key, reason }
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
        !name.is_empty() && name.chars().all(plain),
        "[cell] name",
        name,
        "letters, digits, '-' and '_' only",
    )?;
    v.range("[cell] cycle_us", f64::from(cell.cell.cycle_us), 100.0, 1e5)?;
    v.range("[bus] load_max", cell.bus.load_max, 0.05, 1.0)?;
    v.range("[bus] bitrate_bit_s", f64::from(cell.bus.bitrate_bit_s), 1e4, 8e6)?;
    v.that(
        (1..=MAX_AXES).contains(&cell.axes.len()),
        "[[axis]] count",
        &cell.axes.len(),
        &format!("1 to {MAX_AXES} axes"),
    )?;
    nodes(cell, &v)?;
    for axis in &cell.axes {
        check_axis(axis, &v)?;
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
    check_program(cell, &v)?;
    check_learning(cell, &v)?;
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

fn nodes(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let mut taken: Vec<(u8, String)> = Vec::new();
    let axes = cell.axes.iter().map(|axis| (axis.node, format!("[[axis]] {} node", axis.name)));
    let tcp = cell.tcp_encoder.iter().map(|tcp| (tcp.node, "[tcp_encoder] node".to_owned()));
    for (node, key) in axes.chain(tcp) {
        v.that((1..=NODE_MAX).contains(&node), &key, &node, "1 to 127")?;
        if let Some((_, other)) = taken.iter().find(|(seen, _)| *seen == node) {
            return Err(v.refuse(
                &key,
                &node,
                &format!("a number of its own; {other} has it already"),
            ));
        }
        taken.push((node, key));
    }
    Ok(())
}

fn check_axis(axis: &Axis, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
    v.that(!axis.name.is_empty(), "[[axis]] name", &axis.name, "a name, as \"x\"")?;
    v.range(&at("counts_per_m"), axis.counts_per_m, 1.0, 1e10)?;
    let l = &axis.limits;
    v.range(&at("limits.position_min_m"), l.position_min_m, -1e3, 1e3)?;
    v.range(&at("limits.position_max_m"), l.position_max_m, -1e3, 1e3)?;
    v.that(
        l.position_min_m < l.position_max_m,
        &at("limits.position_max_m"),
        &l.position_max_m,
        "above limits.position_min_m",
    )?;
    let counts = axis.counts_per_m * l.position_min_m.abs().max(l.position_max_m.abs());
    v.that(
        counts <= f64::from(i32::MAX),
        &at("counts_per_m"),
        &axis.counts_per_m,
        "counts_per_m times the farthest position must fit 32 bits",
    )?;
    v.range(&at("limits.velocity_max_m_s"), l.velocity_max_m_s, 1e-6, 1e2)?;
    v.that(
        axis.counts_per_m * l.velocity_max_m_s <= f64::from(i32::MAX),
        &at("limits.velocity_max_m_s"),
        &l.velocity_max_m_s,
        "counts_per_m times velocity_max_m_s must fit 32 bits",
    )?;
    v.range(&at("limits.acceleration_max_m_s2"), l.acceleration_max_m_s2, 1e-4, 1e4)?;
    v.range(&at("limits.jerk_max_m_s3"), l.jerk_max_m_s3, 1e-3, 1e7)?;
    v.range(&at("limits.following_error_max_m"), l.following_error_max_m, 1e-7, 1.0)?;
    v.range(&at("model.delay_samples"), f64::from(axis.model.delay_samples), 0.0, 20.0)?;
    let (wanted, unwanted) = match axis.interface {
        Interface::Csp => (
            vec![
                ("natural_frequency_hz", axis.model.natural_frequency_hz, 0.1, 1e3),
                ("damping", axis.model.damping, 0.05, 5.0),
            ],
            vec![("velocity_bandwidth_hz", axis.model.velocity_bandwidth_hz)],
        ),
        Interface::Csv => (
            vec![("velocity_bandwidth_hz", axis.model.velocity_bandwidth_hz, 0.1, 1e4)],
            vec![
                ("natural_frequency_hz", axis.model.natural_frequency_hz),
                ("damping", axis.model.damping),
            ],
        ),
    };
    for (key, value, low, high) in wanted {
        let key = at(&format!("model.{key}"));
        match value {
            Some(value) => v.range(&key, value, low, high)?,
            None => {
                return Err(v.refuse(
                    &key,
                    &"missing",
                    &format!("{low} to {high} for this interface"),
                ));
            }
        }
    }
    for (key, value) in unwanted {
        if let Some(value) = value {
            return Err(v.refuse(
                &at(&format!("model.{key}")),
                &value,
                "not used by this interface; remove it",
            ));
        }
    }
    match (axis.interface, &axis.position_loop) {
        (Interface::Csv, None) => Err(v.refuse(
            &at("position_loop"),
            &"missing",
            "interface \"csv\" needs [axis.position_loop] gain_per_s",
        )),
        (Interface::Csp, Some(_)) => Err(v.refuse(
            &at("position_loop"),
            &"given",
            "interface \"csp\" has its position loop in the drive; remove it",
        )),
        (Interface::Csv, Some(position_loop)) => {
            v.range(&at("position_loop.gain_per_s"), position_loop.gain_per_s, 0.01, 1e3)?;
            v.range(
                &at("position_loop.velocity_feedforward"),
                position_loop.velocity_feedforward,
                0.0,
                1.0,
            )
        }
        (Interface::Csp, None) => Ok(()),
    }?;
    check_simulation(axis, v)
}

fn check_simulation(axis: &Axis, v: &Checker) -> Result<(), ConfigError> {
    let at = |key: &str| format!("[[axis]] {}: {key}", axis.name);
    let (s, l) = (&axis.simulation, &axis.limits);
    v.range(&at("simulation.mass_kg"), s.mass_kg, 1e-3, 1e5)?;
    v.range(&at("simulation.natural_frequency_hz"), s.natural_frequency_hz, 0.1, 1e3)?;
    v.range(&at("simulation.damping"), s.damping, 0.05, 5.0)?;
    v.range(&at("simulation.integral_time_s"), s.integral_time_s, 1e-3, 1e3)?;
    v.range(&at("simulation.force_max_n"), s.force_max_n, 1e-3, 1e7)?;
    v.range(&at("simulation.coulomb_n"), s.coulomb_n, 0.0, s.force_max_n)?;
    v.range(&at("simulation.static_n"), s.static_n, s.coulomb_n, s.force_max_n)?;
    v.range(&at("simulation.stribeck_m_s"), s.stribeck_m_s, 1e-6, 1.0)?;
    v.range(&at("simulation.mode_mass_kg"), s.mode_mass_kg, 0.0, 0.9 * s.mass_kg)?;
    v.range(&at("simulation.mode_frequency_hz"), s.mode_frequency_hz, 0.1, 1e3)?;
    v.range(&at("simulation.mode_damping"), s.mode_damping, 0.0, 2.0)?;
    v.range(
        &at("simulation.position_start_m"),
        s.position_start_m,
        l.position_min_m,
        l.position_max_m,
    )
}

fn check_program(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let program = &cell.program;
    v.range("[program] feed_m_s", program.feed_m_s, 1e-6, 1e2)?;
    v.range("[program] blend_s", program.blend_s, cell.cycle_s(), 1.0)?;
    v.range("[program] dwell_before_s", program.dwell_before_s, 0.0, 10.0)?;
    v.range("[program] dwell_after_s", program.dwell_after_s, 0.0, 10.0)?;
    v.range("[program] settle_s", program.settle_s, 0.0, 60.0)?;
    check_kind(cell, v)?;
    check_point(cell, v, "[program] start_m", &program.start_m)?;
    for (number, segment) in program.segments.iter().enumerate() {
        check_point(cell, v, &format!("[[program.segment]] {} to_m", number + 1), &segment.to_m)?;
        if let Some(feed) = segment.feed_m_s {
            v.range(&format!("[[program.segment]] {} feed_m_s", number + 1), feed, 1e-6, 1e2)?;
        }
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
    if let Some(rapid_m_s) = program.rapid_m_s {
        v.range("[program] rapid_m_s", rapid_m_s, 1e-6, 1e2)?;
    }
    if let Some(limit) = program.curvature_acceleration_m_s2 {
        v.range("[program] curvature_acceleration_m_s2", limit, 1e-6, 1e4)?;
    }
    for (number, segment) in program.segments.iter().enumerate() {
        let key = |name: &str| format!("[[program.segment]] {} {name}", number + 1);
        v.range(&key("dwell_s"), segment.dwell_s, 0.0, 3600.0)?;
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

fn check_learning(cell: &Cell, v: &Checker) -> Result<(), ConfigError> {
    let l = &cell.learning;
    v.range("[learning] input_max_m", l.input_max_m, 0.0, 1.0)?;
    v.range("[learning] input_max_m_s", l.input_max_m_s, 0.0, 10.0)?;
    v.range("[learning] rollback_ratio", l.rollback_ratio, 1.0, 1e3)?;
    v.range("[learning.norm_optimal] q", l.norm_optimal.q, 0.0, 1e12)?;
    v.range("[learning.norm_optimal] s", l.norm_optimal.s, 0.0, 1e12)?;
    v.range("[learning.norm_optimal] r", l.norm_optimal.r, 0.0, 1e12)?;
    v.range("[learning.norm_optimal] rate", l.norm_optimal.rate, 0.0, 1e6)?;
    v.range("[learning.pd] kp", l.pd.kp, -1e3, 1e3)?;
    v.range("[learning.pd] kd", l.pd.kd, -1e3, 1e3)?;
    v.range("[learning.pd] lead_samples", l.pd.lead_samples as f64, 0.0, 100.0)?;
    v.range("[learning.pd] order", l.pd.order as f64, 1.0, 8.0)?;
    let nyquist_hz = 0.5 / cell.cycle_s();
    v.range("[learning.pd] cutoff_hz", l.pd.cutoff_hz, 1e-3 * nyquist_hz, 0.95 * nyquist_hz)?;
    v.that(
        l.law == LawName::None || l.measure == Measure::Encoder || cell.tcp_encoder.is_some(),
        "[learning] measure",
        &"tcp",
        "\"encoder\", as there is no [tcp_encoder]",
    )
}

struct Checker {
    file: String,
}

impl Checker {
    fn refuse(&self, key: &str, value: &dyn std::fmt::Display, allowed: &str) -> ConfigError {
        ConfigError::Value {
            file: self.file.clone(),
            key: key.to_owned(),
            value: value.to_string(),
            allowed: allowed.to_owned(),
        }
    }

    fn that(
        &self,
        holds: bool,
        key: &str,
        value: &dyn std::fmt::Display,
        allowed: &str,
    ) -> Result<(), ConfigError> {
        if holds { Ok(()) } else { Err(self.refuse(key, value, allowed)) }
    }

    /// Refuses what is not a finite number from `low` to `high`.
    fn range(&self, key: &str, value: f64, low: f64, high: f64) -> Result<(), ConfigError> {
        self.that(
            value.is_finite() && (low..=high).contains(&value),
            key,
            &value,
            &format!("allowed {low} to {high}"),
        )
    }
}

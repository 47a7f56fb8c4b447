//! `ilc-rt check`: dry run of a cell description, without opening a bus.

use std::path::PathBuf;

use clap::Args;

use super::{EXIT_BAD_INPUT, show};
use crate::config::{AxisUnit, Cell, LawName};
use crate::design::{BusTraffic, DesignError, Plan, Prepared};
use crate::fieldbus::transport::scheme_of;
use crate::learning::gate::GateMeasure;
use crate::record::AxisKinds;

#[derive(Args)]
#[command(after_help = "Example:
  ilc-rt check gantry.toml")]
pub(super) struct CheckArguments {
    /// Cell description.
    cell: PathBuf,
}

/// Checks a cell description; returns the exit status.
pub(super) fn check(arguments: &CheckArguments) -> u8 {
    match describe(arguments) {
        Ok(()) => 0,
        Err(error) => {
            show::complain(&error);
            EXIT_BAD_INPUT
        }
    }
}

fn describe(arguments: &CheckArguments) -> Result<(), DesignError> {
    let cell = Cell::load(&arguments.cell)?;
    let plan = Plan::new(&cell, None, false)?;
    let Prepared { law, verdict, warnings } = plan.law(&cell)?;
    show::say(&format!(
        "cell {}: {} on {}, {} us cycle",
        cell.cell.name,
        if cell.n_axes() == 1 { "1 axis".to_owned() } else { format!("{} axes", cell.n_axes()) },
        cell.addresses().collect::<Vec<_>>().join(", "),
        cell.cell.cycle_us,
    ));
    for bus in &plan.traffic {
        show::say(&format!("  {}", traffic(bus)));
    }
    for (i, axis) in cell.axes.iter().enumerate() {
        let column = || plan.reference_m.iter().skip(i).step_by(cell.n_axes());
        let low = column().copied().fold(f64::INFINITY, f64::min);
        let high = column().copied().fold(f64::NEG_INFINITY, f64::max);
        show::say(&format!(
            "  axis {} (node {}): {:.3} to {:.3} {unit} of {:.3} to {:.3} {unit}",
            axis.name,
            axis.node,
            low,
            high,
            axis.limits.position_min_m,
            axis.limits.position_max_m,
            unit = axis.unit.symbol()
        ));
    }
    show::say(&format!("  path: {}", path(&cell, &plan)));
    show::say(&format!(
        "  a run: {} samples, {:.3} s; then {:.3} s rest in which {}",
        plan.n_samples(),
        plan.n_samples() as f64 * cell.cycle_s(),
        cell.program.settle_s,
        law.map_or_else(
            || "nothing is learned".to_owned(),
            |law| format!("is learned: {}", law.describe())
        )
    ));
    for line in learning(&cell) {
        show::say(&format!("  {line}"));
    }
    if !verdict.is_empty() {
        show::say(&format!("  forecast from the model: {verdict}"));
    }
    for warning in warnings {
        show::say(&format!("  warning: {warning}"));
    }
    Ok(())
}

/// Describes the traffic of a bus.
fn traffic(bus: &BusTraffic) -> String {
    let is_real = scheme_of(&bus.address).is_some_and(|scheme| scheme.has_bits);
    let kind = if bus.rates.data_bit_s.is_some() { "CAN FD" } else { "classical CAN" };
    let data = bus.rates.data_bit_s.map(|rate| format!(" (data phase {rate} bit/s)"));
    format!(
        "bus {}: {:.0} us per cycle at worst{} {} bit/s{}, {:.0} % of the period{}",
        bus.address,
        bus.load.us_per_cycle,
        if is_real { " at".to_owned() } else { format!("; that is on a {kind} bus of") },
        bus.rates.nominal_bit_s,
        data.unwrap_or_default(),
        bus.load.ratio() * 100.0,
        if bus.small { "; the smallest process data, as there is no time for more" } else { "" }
    )
}

/// Describes rollback, gate and ladder, which decide on the next input besides the law.
fn learning(cell: &Cell) -> Vec<String> {
    let learning = &cell.learning;
    if learning.law == LawName::None {
        return Vec::new();
    }
    let mut lines = Vec::new();
    if let Some(ladder) = &learning.ladder {
        lines.push(format!(
            "ladder: each step from the mean of {} runs, gain 1 at first and {} to {} later",
            ladder.repeats, ladder.lowest, ladder.highest
        ));
    }
    lines.push(match &learning.gate {
        Some(gate) => format!(
            "gate: the input is kept while the {} error is within {} (learning resumes at {}); after \
             {} {} in a row above {} times the best error the best input is restored",
            match gate.measure {
                GateMeasure::Rms => "RMS",
                GateMeasure::Max => "largest",
            },
            tolerance(cell, gate.tolerance_m),
            tolerance(cell, gate.tolerance_m * gate.resume),
            gate.patience,
            if learning.ladder.is_some() { "steps" } else { "runs" },
            gate.growth
        ),
        None => format!(
            "an RMS error above {} times the best one restores the best input; after the second time \
             nothing is learned any more",
            learning.rollback()
        ),
    });
    lines
}

/// Describes the path: kind, length, and largest speed.
fn path(cell: &Cell, plan: &Plan) -> String {
    let kind = (cell.program.kind.entry().describe)(&cell.program);
    let units: Vec<String> = plan.meta.input_units.clone();
    let kinds = AxisKinds::new(&units, cell.n_axes());
    let parts = [("m", kinds.of_kind(false)), ("rad", kinds.of_kind(true))];
    let told = parts.iter().filter(|(_, axes)| !axes.is_empty()).map(|(unit, axes)| {
        let (length, fastest) = course(&plan.reference_m, cell.n_axes(), axes);
        format!("{length:.4} {unit} long, {:.4} {unit}/s at most", fastest / cell.cycle_s())
    });
    format!("{kind}, {}", told.collect::<Vec<_>>().join(" and "))
}

/// Returns the length of the path of some axes, and its longest step from one set point to the
/// next.
fn course(reference_m: &[f64], n_axes: usize, axes: &[usize]) -> (f64, f64) {
    let rows = || reference_m.chunks_exact(n_axes);
    let steps = rows()
        .zip(rows().skip(1))
        .map(|(from, to)| axes.iter().fold(0.0_f64, |sum, &axis| sum.hypot(to[axis] - from[axis])));
    steps.fold((0.0, 0.0_f64), |(sum, most), step| (sum + step, most.max(step)))
}

/// Formats a tolerance of the gate in the unit of the axes; in both units if lengths and angles
/// share the figure.
fn tolerance(cell: &Cell, value: f64) -> String {
    let has = |unit| cell.axes.iter().any(|axis| axis.unit == unit);
    let number = format!("{:.3}", value * 1e6);
    match (has(AxisUnit::M), has(AxisUnit::Rad)) {
        (false, true) => format!("{number} urad"),
        (true, true) => format!("{number} um or urad"),
        _ => format!("{number} um"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GANTRY: &str =
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_gantry.toml"));

    fn told(tail: &str) -> String {
        let cell = Cell::parse(&format!("{GANTRY}\n{tail}"), "cell.toml").unwrap();
        learning(&cell).join("\n")
    }

    #[test]
    fn what_decides_beside_the_law_is_told() {
        let plain = told("");
        assert!(plain.contains("above 1.5 times the best one restores"), "{plain}");
        let gate = "[learning.gate]\ntolerance_m = 2e-5\nresume = 2.0\ngrowth = 3.0\n";
        let gated = told(gate);
        for part in ["RMS error is within 20.000 um", "resumes at 40.000 um", "2 runs", "3 times"] {
            assert!(gated.contains(part), "{gated}");
        }
        let both = told(&format!("{gate}[learning.ladder]\nrepeats = 5\n"));
        assert!(both.contains("mean of 5 runs") && both.contains("2 steps"), "{both}");
        assert!(!both.contains("restores the best input; after the second time"), "{both}");
    }
}

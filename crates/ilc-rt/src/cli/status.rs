//! `ilc-rt status`: state, position, faults and inputs of the axes.

use clap::Args;
use serde_json::json;

use super::target::{Asking, Choice, Target, answered};
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::commissioning::{AxisStatus, axis_status, power_lost};
use crate::config::Cell;
use crate::design::axis_scale;
use crate::fieldbus::canopen::NodeId;

#[derive(Args)]
#[command(
    after_help = "Only reads objects: it changes nothing, and may run beside a running controller.
Exit status: 0 done, 1 a drive does not answer, 2 refused.

Examples:
  ilc-rt status gantry.toml
  ilc-rt status gantry.toml --axis x --json -"
)]
pub(super) struct StatusArguments {
    /// Cell description.
    cell: String,
    /// Axis of the cell; may be repeated. All axes if not given.
    #[arg(long, value_name = "NAME")]
    axis: Vec<String>,
    #[command(flatten)]
    asking: Asking,
}

/// Prints the status of the axes; returns the exit status.
pub(super) fn status(arguments: &StatusArguments) -> u8 {
    answered(arguments.asking.json.as_deref(), || {
        read(arguments).map_err(|line| (line, EXIT_BAD_INPUT))
    })
}

fn read(arguments: &StatusArguments) -> Result<(serde_json::Value, u8), String> {
    let mut target = Target::open(&arguments.cell, &arguments.asking)?;
    let choice = Choice { axis: arguments.axis.clone(), node: Vec::new() };
    let chosen = target.chosen(&choice)?;
    let Some(cell) = target.cell.clone() else {
        return Err(format!(
            "{}: allowed: a cell description; `ilc-rt scan` reads a bus",
            arguments.cell
        ));
    };
    let company = target.listen()?;
    company.lets_read().map_err(|error| target.said(&error))?;
    if let Some(command) = company.master {
        show::say(&format!("a controller is at work ({command} heard)"));
    }
    let mut all = Vec::new();
    let mut n_silent = 0;
    for (node, name) in chosen {
        let nmt = company.states.get(&node.get()).map(ToString::to_string);
        match one(&mut target, &cell, node, nmt) {
            Ok(status) => {
                show::say(&described(&status, &cell));
                all.push(status);
            }
            Err(line) => {
                n_silent += 1;
                show::complain(&format!("{}: {name}: {line}", target.address));
            }
        }
    }
    let status = if n_silent > 0 { EXIT_FAILURE } else { 0 };
    let master = company.master.map(|command| command.to_string());
    Ok((json!({ "bus": target.address, "master": master, "axes": all }), status))
}

fn one(
    target: &mut Target,
    cell: &Cell,
    node: NodeId,
    nmt: Option<String>,
) -> Result<AxisStatus, String> {
    let axis = cell.axes.iter().find(|axis| axis.node == node.get());
    let axis = axis.ok_or("it has no axis in this cell")?;
    let scale = axis_scale(cell, axis).map_err(|error| error.to_string())?;
    let client = target.client(node);
    let unit = axis.unit.symbol();
    let named: Vec<_> = cell.inputs.iter().filter(|input| input.axis == axis.name).collect();
    axis_status(target.bus.as_mut(), &client, &axis.name, unit, scale, &named, nmt)
        .map_err(|error| error.to_string())
}

fn described(status: &AxisStatus, cell: &Cell) -> String {
    let mut text = format!(
        "axis {} (node {}): {} (0x{:04X}), {}",
        status.axis,
        status.node,
        status.state,
        status.faults.statusword,
        status.nmt.as_deref().unwrap_or("NMT state unknown (no heartbeat)"),
    );
    let mut add = |part: String| {
        text.push_str("\n  ");
        text.push_str(&part);
    };
    let limits = cell.axes.iter().find(|axis| axis.name == status.axis).map(|axis| axis.limits);
    if let (Some(position_m), Some(limits)) = (status.position_m, limits) {
        let inside = (limits.position_min_m..=limits.position_max_m).contains(&position_m);
        add(format!(
            "position {position_m:.6} {unit}, {} {} to {} {unit}",
            if inside { "within" } else { "outside" },
            limits.position_min_m,
            limits.position_max_m,
            unit = status.unit
        ));
    }
    if status.faults.in_fault() {
        add(format!("fault: {}", status.faults.sentence()));
    } else if !status.faults.history.is_empty() {
        add(format!("earlier: {}", status.faults.sentence()));
    }
    if power_lost(status.faults.statusword) {
        add("power stage off: not enabled yet, or taken away by an emergency stop (STO)".to_owned());
    }
    if !status.remarks.is_empty() {
        add(status.remarks.join(", "));
    }
    if let Some(inputs) = status.inputs.as_ref().filter(|inputs| !inputs.is_empty()) {
        add(format!("active inputs: {}", inputs.join(", ")));
    }
    for input in &status.named_inputs {
        add(format!("{} {}: {}", input.purpose, input.name, input.in_words()));
    }
    text
}

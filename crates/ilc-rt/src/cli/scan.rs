//! `ilc-rt scan`: the nodes on a bus, and what they are.

use clap::Args;
use serde_json::json;

use super::target::{Asking, Target, answered};
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::commissioning::{self, FoundNode};
use crate::record::{TEXT_MAX, printable};

#[derive(Args)]
#[command(
    after_help = "Only reads objects: it changes nothing, and may run beside a running controller.
Exit status: 0 done, 1 no node answered or one of the cell is missing, 2 refused.

Examples:
  ilc-rt scan can:can0
  ilc-rt scan gantry.toml --json -"
)]
pub(super) struct ScanArguments {
    /// Cell description, or address of a bus.
    #[arg(value_name = "CELL|BUS")]
    target: String,
    #[command(flatten)]
    asking: Asking,
}

/// Scans a bus; returns the exit status.
pub(super) fn scan(arguments: &ScanArguments) -> u8 {
    answered(arguments.asking.json.as_deref(), || {
        found(arguments).map_err(|line| (line, EXIT_BAD_INPUT))
    })
}

fn found(arguments: &ScanArguments) -> Result<(serde_json::Value, u8), String> {
    let mut target = Target::open(&arguments.target, &arguments.asking)?;
    let company = target.listen()?;
    let timeout = target.timeout();
    let nodes = commissioning::scan(target.bus.as_mut(), &company, timeout)
        .map_err(|error| target.said(&error))?;
    let (n, s) = (nodes.len(), if nodes.len() == 1 { "" } else { "s" });
    let master = company.master.map_or_else(String::new, |command| {
        format!("; another master is at work ({command} heard)")
    });
    show::say(&format!("{}: {n} node{s}{master}", target.address));
    for node in &nodes {
        let axis = target.axis_of(node.node).map(|axis| axis.name.as_str());
        show::say(&described(node, axis));
    }
    let axes = target.cell.as_ref().map_or(&[][..], |cell| &cell.axes);
    let tool = target.cell.as_ref().and_then(|cell| cell.tcp_encoder);
    let expected = axes
        .iter()
        .map(|axis| (axis.node, format!("axis {}", axis.name)))
        .chain(tool.map(|tool| (tool.node, "the tool's encoder".to_owned())));
    let missing: Vec<(u8, String)> =
        expected.filter(|(number, _)| nodes.iter().all(|node| node.node != *number)).collect();
    for (node, name) in &missing {
        show::complain(&format!(
            "{}: node {node} ({name}) does not answer: is it powered, on this bus and set to this number?",
            target.address
        ));
    }
    if nodes.is_empty() && missing.is_empty() {
        show::complain(&format!(
            "{}: no node answers: are they powered, on this bus, terminated and at its bit rate?",
            target.address
        ));
    }
    let status = if nodes.is_empty() || !missing.is_empty() { EXIT_FAILURE } else { 0 };
    let listed: Vec<_> = nodes
        .iter()
        .map(|node| {
            let mut entry = json!(node);
            entry["axis"] = json!(target.axis_of(node.node).map(|axis| &axis.name));
            entry
        })
        .collect();
    let missing: Vec<u8> = missing.iter().map(|(node, _)| *node).collect();
    let master = company.master.map(|command| command.to_string());
    let text =
        json!({ "bus": target.address, "master": master, "nodes": listed, "missing": missing });
    Ok((text, status))
}

fn described(node: &FoundNode, axis: Option<&str>) -> String {
    let mut lines = vec![format!(
        "node {}{}: {}{}",
        node.node,
        axis.map_or_else(String::new, |axis| format!(" (axis {axis})")),
        node.nmt.as_deref().unwrap_or("NMT state unknown (no heartbeat)"),
        node.name
            .as_ref()
            .map_or_else(String::new, |name| format!(", \"{}\"", printable(name, TEXT_MAX))),
    )];
    let names = ["vendor", "product", "revision", "serial number"];
    let parts: Vec<String> = names
        .iter()
        .zip(node.identity)
        .filter_map(|(name, value)| value.map(|value| format!("{name} 0x{value:08X}")))
        .collect();
    if let Some(kind) = node.device_type {
        let profile = kind & 0xFFFF;
        lines.push(format!("  device type 0x{kind:08X} (profile {profile}) {}", parts.join(", ")));
    }
    if let Some(drive) = &node.drive {
        lines.push(format!(
            "  drive: {} (0x{:04X}), mode {}, supports {}",
            drive.state,
            drive.statusword,
            drive.mode.as_deref().unwrap_or("unknown"),
            drive.supported.join(", ")
        ));
    }
    lines.extend(node.trouble.as_ref().map(|trouble| format!("  trouble: {trouble}")));
    lines.join("\n")
}

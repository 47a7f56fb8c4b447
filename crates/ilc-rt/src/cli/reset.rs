//! `ilc-rt reset` and `ilc-rt disable`: faults named and reset, drives switched off.

use clap::Args;
use serde_json::json;

use super::target::{Asking, Choice, Target, answered};
use super::{EXIT_BAD_INPUT, EXIT_FAULT, show};
use crate::commissioning::{self, CommissioningError};
use crate::fieldbus::bring_up::SdoClient;

#[derive(Args)]
#[command(
    after_help = "Names every fault first, then resets it; the drive stays switched off. Refused while another master
is at work.
Exit status: 0 no fault is left, 2 refused, 3 a fault stays or a drive does not answer.

Examples:
  ilc-rt reset gantry.toml
  ilc-rt reset gantry.toml --axis x --json -
  ilc-rt reset can:can0 --node 1"
)]
pub(super) struct ResetArguments {
    /// Cell description, or address of a bus.
    #[arg(value_name = "CELL|BUS")]
    target: String,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    asking: Asking,
}

#[derive(Args)]
#[command(
    after_help = "A drive that may be moving stops by its own quick-stop ramp first. Refused while another master is at
work: stop that one, and it switches its drives off itself.
Exit status: 0 all are off, 2 refused, 3 a drive stays on or does not answer.

Examples:
  ilc-rt disable gantry.toml
  ilc-rt disable can:can0 --node 1"
)]
pub(super) struct DisableArguments {
    /// Cell description, or address of a bus.
    #[arg(value_name = "CELL|BUS")]
    target: String,
    #[command(flatten)]
    choice: Choice,
    #[command(flatten)]
    asking: Asking,
}

/// Resets faults; returns the exit status.
pub(super) fn reset(arguments: &ResetArguments) -> u8 {
    let ResetArguments { target, choice, asking } = arguments;
    for_each(target, choice, asking, |target, client, name| {
        let bus = target.bus.as_mut();
        let found = commissioning::faults(bus, client)?;
        if !found.in_fault() {
            show::say(&format!("{name}: no fault"));
            return Ok(json!({ "faults": found, "reset": false }));
        }
        show::say(&format!("{name}: in fault: {}", found.sentence()));
        commissioning::reset(bus, client)?;
        show::say(&format!("{name}: reset, switched off"));
        Ok(json!({ "faults": found, "reset": true }))
    })
}

/// Switches drives off; returns the exit status.
pub(super) fn disable(arguments: &DisableArguments) -> u8 {
    let DisableArguments { target, choice, asking } = arguments;
    for_each(target, choice, asking, |target, client, name| {
        let was_on = commissioning::disable(target.bus.as_mut(), client)?;
        show::say(&format!("{name}: {}", if was_on { "switched off" } else { "was off" }));
        Ok(json!({ "was_on": was_on }))
    })
}

/// Acts on every chosen node, also after a failure of another one.
fn for_each(
    target: &str,
    choice: &Choice,
    asking: &Asking,
    mut act: impl FnMut(&mut Target, &SdoClient, &str) -> Result<serde_json::Value, CommissioningError>,
) -> u8 {
    answered(asking.json.as_deref(), || {
        let bad = |line: String| (line, EXIT_BAD_INPUT);
        let mut target = Target::open(target, asking).map_err(bad)?;
        let chosen = target.chosen(choice).map_err(bad)?;
        let company = target.listen().map_err(bad)?;
        company.lets_change().map_err(|error| bad(target.said(&error)))?;
        let mut results = Vec::new();
        let mut status = 0;
        for (node, name) in chosen {
            let client = target.client(node);
            let mut result = match act(&mut target, &client, &name) {
                Ok(result) => result,
                Err(error) => {
                    status = EXIT_FAULT;
                    show::complain(&format!("{}: {name}: {error}", target.address));
                    json!({ "error": error.to_string() })
                }
            };
            result["node"] = json!(node.get());
            result["axis"] = json!(target.axis_of(node.get()).map(|axis| &axis.name));
            results.push(result);
        }
        Ok((json!({ "bus": target.address, "nodes": results }), status))
    })
}

//! Simulated hands: an input of the cell is switched on or off while its drives run in another process.

use std::time::Duration;

use ilc_rt::campaign::open_buses;
use ilc_rt::config::{Cell, Level};
use ilc_rt::fieldbus::bring_up::SdoClient;
use ilc_rt::fieldbus::canopen::NodeId;
use ilc_rt::fieldbus::network::SIMULATED_INPUTS;
use ilc_rt::fieldbus::transport::GroupSide;

/// Time for the drive to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// Object type of the simulated inputs, in bytes.
const N_BYTES: usize = 4;

/// Switches an input of a cell on or off.
///
/// # Errors
/// One line with the reason.
pub(crate) fn switch(cell: &Cell, name: &str, on: bool) -> Result<(), String> {
    let input = cell.inputs.iter().find(|input| input.name == name).ok_or_else(|| {
        let names: Vec<&str> = cell.inputs.iter().map(|input| input.name.as_str()).collect();
        let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        format!("input {name}: the cell has {known}")
    })?;
    let axis = cell.axes.iter().find(|axis| axis.name == input.axis);
    let node = axis.and_then(|axis| NodeId::new(axis.node)).ok_or("no such axis")?;
    let mut bus = open_buses(cell, GroupSide::Controller).map_err(|(_, e)| e.to_string())?;
    let client = SdoClient::new(node, PATIENCE);
    let refused = |error: &dyn std::fmt::Display| format!("input {name}, node {node}: {error}");
    let before =
        client.upload_u32(bus.as_mut(), SIMULATED_INPUTS, 0).map_err(|error| refused(&error))?;
    let mask = 1_u32 << input.bit;
    let after = if on == (input.active == Level::High) { before | mask } else { before & !mask };
    client
        .download(bus.as_mut(), SIMULATED_INPUTS, 0, &after.to_le_bytes()[..N_BYTES])
        .map_err(|error| refused(&error))
}

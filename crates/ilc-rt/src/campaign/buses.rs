//! Opening of the buses of a cell: one, or a group in one SYNC.

use crate::config::Cell;
use crate::fieldbus::Bus;
use crate::fieldbus::transport::{Group, GroupSide, OpenError, open};

/// Opens every bus of a cell, as one bus that carries each frame to the bus of its node; `side` is the one
/// that the caller is on.
///
/// # Errors
/// File and key of the address that does not open, and the reason.
pub fn open_buses(cell: &Cell, side: GroupSide) -> Result<Box<dyn Bus>, (String, OpenError)> {
    let file = cell.file.display();
    if cell.extra_buses.is_empty() {
        return open(&cell.bus.address)
            .map_err(|source| (format!("{file}: [bus] address"), source));
    }
    let mut buses = Vec::new();
    for (number, address) in cell.addresses().enumerate() {
        let key = if number == 0 { "[bus]".to_owned() } else { format!("[[extra_bus]] {number}") };
        buses.push(open(address).map_err(|source| (format!("{file}: {key} address"), source))?);
    }
    let drives = cell.axes.iter().map(|axis| (axis.node, axis.bus));
    let tool = cell.tcp_encoder.iter().map(|tool| (tool.node, 0));
    Ok(Box::new(Group::new(buses, drives.chain(tool), side)))
}

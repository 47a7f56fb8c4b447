//! Brings every node of the cell up, with errors that name the key of the cell description.

use std::time::Duration;

use super::error::SupervisorError;
use super::options::{Options, SIMULATED_PATIENCE_S};
use super::plan;
use crate::config::Cell;
use crate::fieldbus::canopen::NmtCommand;
use crate::fieldbus::cia402::{BringUpError, DriveSetup, bring_up, bring_up_encoder};
use crate::fieldbus::{Bus, BusError};

/// Heartbeat of the nodes in real time.
const HEARTBEAT_MS: u16 = 100;

/// Resets, checks and configures all nodes, then starts them together. No axis moves.
pub(super) fn start(
    cell: &Cell,
    bus: &mut dyn Bus,
    options: &Options,
) -> Result<(), SupervisorError> {
    let lockstep = options.lockstep;
    let file = cell.file.display().to_string();
    let stall_s = if options.forgives_stalls() { SIMULATED_PATIENCE_S } else { 0.0 };
    let answer_timeout = Duration::from_secs_f64(cell.safety.answer_timeout_s + stall_s);
    let refused = |key: String| {
        let file = file.clone();
        move |source: BringUpError| SupervisorError::BringUp {
            file,
            key,
            address: cell.bus.address.clone(),
            source: Box::new(source),
        }
    };
    // A drive brakes by itself when commands stop coming for as long as the loop waits for answers.
    let deadline_ms = f64::from(cell.safety.silent_cycles_max) * cell.cycle_s() * 1e3;
    for axis in &cell.axes {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let setup = DriveSetup {
            node: plan::node(cell, axis.node)?,
            mode: plan::mode(axis),
            cycle_us: cell.cell.cycle_us,
            following_error_max_counts: (axis.limits.following_error_max_m * axis.counts_per_m)
                .round() as u32,
            heartbeat_ms: if lockstep { 0 } else { HEARTBEAT_MS },
            rpdo_deadline_ms: if lockstep { 0 } else { deadline_ms.ceil() as u16 },
            answer_timeout,
        };
        bring_up(bus, &setup)
            .map_err(refused(format!("[[axis]] {} node = {}", axis.name, axis.node)))?;
    }
    if let Some(tool) = &cell.tcp_encoder {
        bring_up_encoder(bus, plan::node(cell, tool.node)?, answer_timeout)
            .map_err(refused(format!("[tcp_encoder] node = {}", tool.node)))?;
    }
    command_all(bus, NmtCommand::Start).map_err(|source| SupervisorError::Start {
        file,
        address: cell.bus.address.clone(),
        source,
    })
}

/// Takes all nodes out of operation again.
pub(super) fn release(bus: &mut dyn Bus) -> Result<(), BusError> {
    command_all(bus, NmtCommand::PreOperational)
}

fn command_all(bus: &mut dyn Bus, command: NmtCommand) -> Result<(), BusError> {
    bus.send(&command.frame(None))
}

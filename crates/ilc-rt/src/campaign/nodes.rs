//! Brings every node of the cell up, with errors that name the key of the cell description.

use std::time::Duration;

use super::error::CampaignError;
use super::inputs::{self, Words};
use super::options::{SIMULATED_PATIENCE_S, Session};
use crate::commissioning::{self, CommissioningError};
use crate::config::{Axis, AxisUnit, Cell, ConfigError};
use crate::design;
use crate::fieldbus::Bus;
use crate::fieldbus::bring_up::{
    BringUpError, DriveSetup, SdoClient, bring_up, bring_up_encoder, listen,
};
use crate::fieldbus::canopen::{NmtCommand, emcy};
use crate::fieldbus::cia402::units::{UNIT_METRE, UNIT_RADIAN};
use crate::fieldbus::cia402::{PdoMap, objects};

/// Heartbeat of the nodes in real time.
const HEARTBEAT_MS: u16 = 100;

/// Resets, checks and configures all nodes, then starts them together; returns the process data of each
/// axis as mapped. No axis moves.
pub(super) fn start(
    cell: &Cell,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<Vec<PdoMap>, CampaignError> {
    let (maps, _) = prepare(cell, bus, session)?;
    go(cell, bus)?;
    Ok(maps)
}

/// Resets, checks and configures all nodes; they wait for [`go`]. Returns the process data of each axis as mapped, and
/// its digital inputs.
pub(super) fn prepare(
    cell: &Cell,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<(Vec<PdoMap>, Words), CampaignError> {
    let lockstep = session.lockstep;
    let file = cell.file.display().to_string();
    let stall_s = if session.forgives_stalls() { SIMULATED_PATIENCE_S } else { 0.0 };
    let answer_timeout = Duration::from_secs_f64(cell.safety.answer_timeout_s + stall_s);
    refuse_company(cell, bus)?;
    let addresses: Vec<String> = cell.addresses().map(str::to_owned).collect();
    let refused = |key: String, bus: u8| {
        let file = file.clone();
        let address = addresses.get(usize::from(bus)).cloned().unwrap_or_default();
        move |source: BringUpError| refusal(file, key, address, source)
    };
    let resets = session.reset_faults || cell.safety.reset_faults;
    let mut maps = Vec::with_capacity(cell.n_axes());
    for axis in &cell.axes {
        let found =
            bring_up(bus, &drive_setup(cell, axis, lockstep)?).map_err(|source| match source {
                BringUpError::NotHomed { node, why } => CampaignError::NotHomed {
                    file: file.clone(),
                    axis: axis.name.clone(),
                    node: node.get(),
                    why,
                },
                source => refused(key_of(axis), axis.bus)(source),
            })?;
        if let Some(code) = found.fault.filter(|_| resets) {
            let (name, node, meaning) = (&axis.name, axis.node, emcy::meaning(code));
            tracing::warn!(
                "drive of axis {name} (node {node}) was in fault, which is reset: 0x{code:04X} {meaning}"
            );
        }
        maps.push(found.map);
    }
    if let Some(tool) = &cell.tcp_encoder {
        bring_up_encoder(bus, design::node(cell, tool.node)?, answer_timeout)
            .map_err(refused(format!("[tcp_encoder] node = {}", tool.node), 0))?;
    }
    let words = read_inputs(cell, bus, session)?;
    inputs::permit(cell, &words)?;
    if resets {
        return Ok((maps, words));
    }
    for axis in &cell.axes {
        let found = ask(cell, axis, session, |client| commissioning::faults(bus, client))?;
        if found.in_fault() {
            return Err(CampaignError::Faulted {
                file,
                axis: axis.name.clone(),
                node: axis.node,
                fault: found.sentence(),
            });
        }
    }
    Ok((maps, words))
}

/// Returns the key of an axis' node.
fn key_of(axis: &Axis) -> String {
    format!("[[axis]] {} node = {}", axis.name, axis.node)
}

fn refusal(file: String, key: String, address: String, source: BringUpError) -> CampaignError {
    CampaignError::BringUp { file, key, address, source: Box::new(source) }
}

/// Starts all nodes together.
pub(super) fn go(cell: &Cell, bus: &mut dyn Bus) -> Result<(), CampaignError> {
    bus.send(&NmtCommand::Start.frame(None)).map_err(|source| CampaignError::Start {
        file: cell.file.display().to_string(),
        address: cell.bus.address.clone(),
        source,
    })
}

/// Reads the position of every axis.
pub(super) fn positions(
    cell: &Cell,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<Vec<f64>, CampaignError> {
    let mut all_m = Vec::with_capacity(cell.n_axes());
    for axis in &cell.axes {
        let scale = design::axis_scale(cell, axis)?;
        let counts = ask(cell, axis, session, |client| {
            Ok(client.upload_u32(bus, objects::POSITION_ACTUAL, 0)?)
        })?;
        all_m.push(scale.position_m(counts.cast_signed()));
    }
    Ok(all_m)
}

/// Reads the digital inputs of every drive that has named ones.
fn read_inputs(cell: &Cell, bus: &mut dyn Bus, session: &Session) -> Result<Words, CampaignError> {
    let mut words = vec![None; cell.n_axes()];
    for (word, axis) in words.iter_mut().zip(&cell.axes) {
        if cell.inputs.iter().any(|input| input.axis == axis.name) {
            *word = Some(ask(cell, axis, session, |client| {
                Ok(client.upload_u32(bus, objects::DIGITAL_INPUTS, 0)?)
            })?);
        }
    }
    Ok(words)
}

/// Asks the drive of an axis.
pub(super) fn ask<T>(
    cell: &Cell,
    axis: &Axis,
    session: &Session,
    question: impl FnOnce(&SdoClient) -> Result<T, CommissioningError>,
) -> Result<T, CampaignError> {
    let stall_s = if session.forgives_stalls() { SIMULATED_PATIENCE_S } else { 0.0 };
    let timeout = Duration::from_secs_f64(cell.safety.answer_timeout_s + stall_s);
    let client = SdoClient::new(design::node(cell, axis.node)?, timeout);
    question(&client).map_err(|source| CampaignError::Commissioning {
        file: cell.file.display().to_string(),
        axis: axis.name.clone(),
        source: Box::new(source),
    })
}

/// Listens before anything is sent: a bus with another master is refused.
fn refuse_company(cell: &Cell, bus: &mut dyn Bus) -> Result<(), CampaignError> {
    let numbers = cell.axes.iter().map(|axis| axis.node);
    let numbers = numbers.chain(cell.tcp_encoder.iter().map(|tool| tool.node));
    let nodes = numbers.map(|number| design::node(cell, number)).collect::<Result<Vec<_>, _>>()?;
    let file = || cell.file.display().to_string();
    let address = || cell.bus.address.clone();
    match listen::other_master(bus, &nodes, listen::LISTEN) {
        Ok(None) => Ok(()),
        Ok(Some(heard)) => Err(CampaignError::Occupied { file: file(), address: address(), heard }),
        Err(source) => Err(CampaignError::Start { file: file(), address: address(), source }),
    }
}

/// Returns the configuration of the drive of an axis.
///
/// # Errors
/// [`ConfigError`] for a node number or a scale that validation would have refused.
pub fn drive_setup(cell: &Cell, axis: &Axis, lockstep: bool) -> Result<DriveSetup, ConfigError> {
    let scale = design::axis_scale(cell, axis)?;
    let unit = match axis.unit {
        AxisUnit::M => UNIT_METRE,
        AxisUnit::Rad => UNIT_RADIAN,
    };
    let units = scale.si_units(unit);
    let limits = &axis.limits;
    // Positions and velocities of a valid cell fit; what an acceleration cannot hold is its highest.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let unsigned = |value_si: f64| (value_si * axis.counts_per_m).round() as u32;
    let place = |position_m: f64| scale.position_to_counts(position_m).unwrap_or(0);
    let ends = [place(limits.position_min_m), place(limits.position_max_m)];
    // A drive brakes on its own when commands stop arriving for as long as the loop waits for
    // answers.
    let deadline_ms = f64::from(cell.safety.silent_cycles_max) * cell.cycle_s() * 1e3;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let deadline_ms = deadline_ms.ceil() as u16;
    Ok(DriveSetup {
        node: design::node(cell, axis.node)?,
        mode: axis.interface,
        map: design::pdo_map(cell, axis),
        cycle_us: cell.cell.cycle_us,
        following_error_max_counts: axis
            .drive
            .following_error_window
            .unwrap_or_else(|| unsigned(limits.following_error_max_m)),
        position_min_counts: ends[0].min(ends[1]),
        position_max_counts: ends[0].max(ends[1]),
        velocity_max_counts_s: unsigned(limits.velocity_max_m_s),
        acceleration_max_counts_s2: unsigned(limits.acceleration_max_m_s2),
        position_unit: axis.drive.position_unit.or(units.map(|(position, _)| position)),
        velocity_unit: axis.drive.velocity_unit.or(units.map(|(_, velocity)| velocity)),
        heartbeat_ms: if lockstep { 0 } else { HEARTBEAT_MS },
        rpdo_deadline_ms: if lockstep { 0 } else { deadline_ms },
        answer_timeout: Duration::from_secs_f64(cell.safety.answer_timeout_s),
        own: super::own::of(axis),
        is_to_be_homed: false,
    })
}

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
    BringUpError, DriveIdentity, DriveSetup, SdoClient, bring_up, bring_up_encoder,
    enter_homing_mode, listen,
};
use crate::fieldbus::canopen::{NmtCommand, emcy};
use crate::fieldbus::cia402::units::{UNIT_METRE, UNIT_RADIAN, per_mille};
use crate::fieldbus::cia402::{PdoMap, objects};

/// Heartbeat of the nodes in real time.
const HEARTBEAT_MS: u16 = 100;
/// Time without a command after which a drive gives a homing up; the watching thread is not a real-time one.
const HOMING_DEADLINE_MS: u16 = 200;

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
    refuse_company(cell, bus)?;
    let mut maps = Vec::with_capacity(cell.n_axes());
    for axis in &cell.axes {
        let setup = drive_setup(cell, axis, session.lockstep)?;
        maps.push(bring_up_axis(cell, axis, bus, session, &setup)?.map);
    }
    if let Some(tool) = &cell.tcp_encoder {
        bring_up_encoder(bus, design::node(cell, tool.node)?, timeout(cell, session)).map_err(
            |source| refusal(cell, format!("[tcp_encoder] node = {}", tool.node), 0, source),
        )?;
    }
    let words = read_inputs(cell, bus, session)?;
    inputs::permit(cell, &words)?;
    if resets(cell, session) {
        return Ok((maps, words));
    }
    for axis in &cell.axes {
        refuse_fault(cell, axis, bus, session)?;
    }
    Ok((maps, words))
}

/// Resets, checks and configures the drives of some axes for homing. Returns which of them are homed already, unless
/// they are to be homed again; all others wait without power in homing mode.
pub(super) fn prepare_homing(
    cell: &Cell,
    bus: &mut dyn Bus,
    session: &Session,
    axes: &[&Axis],
    again: bool,
) -> Result<Vec<bool>, CampaignError> {
    refuse_company(cell, bus)?;
    let mut are_homed = Vec::with_capacity(axes.len());
    for axis in axes {
        let setup = drive_setup(cell, axis, session.lockstep)?;
        let deadline_ms = if session.lockstep { 0 } else { HOMING_DEADLINE_MS };
        let setup = DriveSetup {
            map: PdoMap::of_homing(),
            rpdo_deadline_ms: setup.rpdo_deadline_ms.max(deadline_ms),
            is_to_be_homed: true,
            ..setup
        };
        let is_homed = bring_up_axis(cell, axis, bus, session, &setup)?.is_homed && !again;
        if resets(cell, session) {
            ask(cell, axis, session, |client| {
                if commissioning::faults(bus, client)?.in_fault() {
                    commissioning::reset(bus, client)?;
                }
                Ok(())
            })?;
        }
        refuse_fault(cell, axis, bus, session)?;
        if !is_homed {
            enter_homing_mode(bus, &client(cell, axis, session)?, timeout(cell, session))
                .map_err(|source| refusal(cell, key_of(axis), axis.bus, source))?;
        }
        are_homed.push(is_homed);
    }
    inputs::permit(cell, &read_inputs(cell, bus, session)?)?;
    Ok(are_homed)
}

/// Brings the drive of an axis up as for a run, which it has to be homed for; returns its position.
///
/// # Errors
/// One line.
pub(super) fn confirm_homed(
    cell: &Cell,
    axis: &Axis,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<f64, String> {
    let said = |error: CampaignError| match error {
        CampaignError::NotHomed { why, .. } => format!(
            "the drive found its home, but does not tell so when it is asked for a run: {why}"
        ),
        error => error.to_string(),
    };
    let setup = drive_setup(cell, axis, session.lockstep).map_err(|error| error.to_string())?;
    bring_up_axis(cell, axis, bus, session, &setup).map_err(said)?;
    position(cell, axis, bus, session).map_err(said)
}

fn bring_up_axis(
    cell: &Cell,
    axis: &Axis,
    bus: &mut dyn Bus,
    session: &Session,
    setup: &DriveSetup,
) -> Result<DriveIdentity, CampaignError> {
    let found = bring_up(bus, setup).map_err(|source| match source {
        BringUpError::NotHomed { node, why } => CampaignError::NotHomed {
            file: cell.file.display().to_string(),
            axis: axis.name.clone(),
            node: node.get(),
            why,
        },
        source => refusal(cell, key_of(axis), axis.bus, source),
    })?;
    if let Some(code) = found.fault.filter(|_| resets(cell, session)) {
        let (name, node, meaning) = (&axis.name, axis.node, emcy::meaning(code));
        tracing::warn!(
            "drive of axis {name} (node {node}) was in fault, which is reset: 0x{code:04X} {meaning}"
        );
    }
    Ok(found)
}

fn refuse_fault(
    cell: &Cell,
    axis: &Axis,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<(), CampaignError> {
    let found = ask(cell, axis, session, |client| commissioning::faults(bus, client))?;
    if !found.in_fault() {
        return Ok(());
    }
    Err(CampaignError::Faulted {
        file: cell.file.display().to_string(),
        axis: axis.name.clone(),
        node: axis.node,
        fault: found.sentence(),
    })
}

fn resets(cell: &Cell, session: &Session) -> bool {
    session.reset_faults || cell.safety.reset_faults
}

/// Returns the key of an axis' node.
fn key_of(axis: &Axis) -> String {
    format!("[[axis]] {} node = {}", axis.name, axis.node)
}

fn refusal(cell: &Cell, key: String, bus: u8, source: BringUpError) -> CampaignError {
    CampaignError::BringUp {
        file: cell.file.display().to_string(),
        key,
        address: cell.addresses().nth(usize::from(bus)).unwrap_or_default().to_owned(),
        source: Box::new(source),
    }
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
    cell.axes.iter().map(|axis| position(cell, axis, bus, session)).collect()
}

/// Reads the position of an axis.
pub(super) fn position(
    cell: &Cell,
    axis: &Axis,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<f64, CampaignError> {
    let scale = design::axis_scale(cell, axis)?;
    let counts = ask(cell, axis, session, |client| {
        Ok(client.upload_u32(bus, objects::POSITION_ACTUAL, 0)?)
    })?;
    Ok(scale.position_m(counts.cast_signed()))
}

/// Returns the time-out of each answer.
pub(super) fn timeout(cell: &Cell, session: &Session) -> Duration {
    let stall_s = if session.forgives_stalls() { SIMULATED_PATIENCE_S } else { 0.0 };
    Duration::from_secs_f64(cell.safety.answer_timeout_s + stall_s)
}

/// Returns a client of the drive of an axis.
fn client(cell: &Cell, axis: &Axis, session: &Session) -> Result<SdoClient, ConfigError> {
    Ok(SdoClient::new(design::node(cell, axis.node)?, timeout(cell, session)))
}

/// Reads the digital inputs of every drive that has named ones.
pub(super) fn read_inputs(
    cell: &Cell,
    bus: &mut dyn Bus,
    session: &Session,
) -> Result<Words, CampaignError> {
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
    let client = client(cell, axis, session)?;
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
        torque_max: axis
            .force
            .map_or(0, |force| per_mille(force.max_n(), force.rated_n).unsigned_abs()),
        needs_torque_offset: axis.has_torque_offset(),
        heartbeat_ms: if lockstep { 0 } else { HEARTBEAT_MS },
        rpdo_deadline_ms: if lockstep { 0 } else { deadline_ms },
        controller: design::node(cell, cell.controller_node())?,
        answer_timeout: Duration::from_secs_f64(cell.safety.answer_timeout_s),
        own: super::own::of(axis),
        is_to_be_homed: false,
    })
}

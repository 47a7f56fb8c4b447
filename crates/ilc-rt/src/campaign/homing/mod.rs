//! Homing: the drives of some axes search their home by themselves, turn after turn, and are switched off; the
//! controller starts, watches and stops them. For `cli`.

mod round;
mod seeker;

use std::time::Duration;

use serde::Serialize;

use self::round::Round;
use self::seeker::{Failure, Patience, Seeker};
use super::error::CampaignError;
use super::nodes;
use super::options::{SIMULATED_PATIENCE_S, Session};
use super::reason::asked;
use crate::commissioning;
use crate::config::{Axis, Cell, DriveHoming, Homing};
use crate::design;
use crate::fieldbus::Bus;
use crate::fieldbus::bring_up::{BringUpError, SdoClient, enter_homing_mode, is_homed};
use crate::fieldbus::canopen::NmtCommand;
use crate::fieldbus::cia402::objects;
use crate::record::EndStatus;

/// Time from power off to operation enabled.
const ENABLING_S: f64 = 5.0;
/// Time from the start to a sign that the drive is at it.
const STARTING_S: f64 = 1.0;
/// Time at the same position that is rest.
const REST_S: f64 = 0.1;
/// Time from a quick stop to power off.
const STOPPING_S: f64 = 10.0;

/// Result of a homing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Homed {
    /// Completed, interrupted or failed.
    pub status: EndStatus,
    /// Reason, one sentence.
    pub reason: String,
    /// Signal that asked to stop, or 0.
    pub signal: i32,
    /// Axes, in the order of their turns.
    pub axes: Vec<HomedAxis>,
}

/// Result of an axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HomedAxis {
    /// Name.
    pub axis: String,
    /// Node of its drive.
    pub node: u8,
    /// Homing method.
    pub method: i8,
    /// The drive tells that it is homed.
    pub homed: bool,
    /// Position afterwards, if it is homed.
    pub position_m: Option<f64>,
    /// Reason that it is not homed.
    pub error: Option<String>,
}

/// An axis to be homed.
struct Task<'a> {
    axis: &'a Axis,
    homing: DriveHoming,
    result: HomedAxis,
}

/// Homes axes of a cell on a bus (`cell.bus.address`, open), those with a lower order first. `report` is called with a
/// line for every change and at intervals, and without one in every cycle; as soon as it returns a reason, the axes come to rest.
///
/// # Errors
/// [`CampaignError`] before anything has moved. Any later failure brings the axes to rest, and is in [`Homed`].
pub fn home(
    cell: &Cell,
    axes: &[usize],
    session: &Session,
    mut bus: Box<dyn Bus>,
    report: &mut dyn FnMut(Option<&str>) -> Option<String>,
) -> Result<Homed, CampaignError> {
    let mut tasks = tasks(cell, axes);
    let chosen: Vec<&Axis> = tasks.iter().map(|task| task.axis).collect();
    nodes::prepare_homing(cell, bus.as_mut(), session, &chosen)?;
    let mut end = (EndStatus::Completed, "homed; the drives are off".to_owned(), 0);
    let mut rest = &mut tasks[..];
    while let Some(first) = rest.first() {
        let order = first.homing.order;
        let n_turn = rest.iter().take_while(|task| task.homing.order == order).count();
        let (turn, later) = rest.split_at_mut(n_turn);
        rest = later;
        end = take_turn(cell, turn, session, bus.as_mut(), report)?;
        if end.0 != EndStatus::Completed {
            break;
        }
    }
    let (status, reason, signal) = end;
    let axes = tasks.into_iter().map(|task| task.result).collect();
    Ok(Homed { status, reason, signal, axes })
}

/// Returns the axes that the drives home, in the order of their turns.
fn tasks<'a>(cell: &'a Cell, axes: &[usize]) -> Vec<Task<'a>> {
    let chosen = axes.iter().filter_map(|index| cell.axes.get(*index));
    let mut tasks: Vec<Task<'a>> = chosen
        .filter_map(|axis| {
            let homing = axis.homing.by_drive(axis.limits.acceleration_max_m_s2)?;
            let result = HomedAxis {
                axis: axis.name.clone(),
                node: axis.node,
                method: homing.method,
                homed: false,
                position_m: None,
                error: Some("its turn did not come".to_owned()),
            };
            Some(Task { axis, homing, result })
        })
        .collect();
    tasks.sort_by_key(|task| task.homing.order);
    tasks
}

type End = (EndStatus, String, i32);

/// Homes the axes of one turn together.
fn take_turn(
    cell: &Cell,
    turn: &mut [Task<'_>],
    session: &Session,
    bus: &mut dyn Bus,
    report: &mut dyn FnMut(Option<&str>) -> Option<String>,
) -> Result<End, CampaignError> {
    let mut seekers = Vec::with_capacity(turn.len());
    for task in turn.iter() {
        let node = design::node(cell, task.axis.node)?;
        let scale = design::axis_scale(cell, task.axis)?;
        let patience = patience(cell, session, task.homing.timeout_s);
        seekers.push((node, scale, Seeker::new(Homing::moves(task.homing.method), patience)));
    }
    let began = format!(
        "searching home: {}",
        turn.iter()
            .map(|task| format!("{} by method {}", task.axis.name, task.homing.method))
            .collect::<Vec<_>>()
            .join(", ")
    );
    let failed_to = |source| CampaignError::Start {
        file: cell.file.display().to_string(),
        address: cell.bus.address.clone(),
        source,
    };
    for (node, _, _) in &seekers {
        bus.send(&NmtCommand::Start.frame(Some(*node))).map_err(failed_to)?;
    }
    let names: Vec<&Axis> = turn.iter().map(|task| task.axis).collect();
    let ended = Round::new(cell, session, &names, &mut seekers).pursue(bus, &began, report);
    for (node, _, _) in &seekers {
        let _ = bus.send(&NmtCommand::PreOperational.frame(Some(*node)));
    }
    let mut failure = None;
    for (task, (_, _, seeker)) in turn.iter_mut().zip(&seekers) {
        let error = match seeker.failure() {
            Some(failure) => Some(described(cell, session, bus, task, failure)),
            None => confirm(cell, session, bus, task).err(),
        };
        task.result.homed = error.is_none();
        // What was broken off is the consequence of another reason.
        if seeker.failure() != Some(Failure::BrokenOff) && failure.is_none() {
            failure = error.as_ref().map(|error| format!("axis {}: {error}", task.axis.name));
        }
        task.result.error = error;
    }
    let signal = session.stop.load(std::sync::atomic::Ordering::Relaxed);
    Ok(match (ended, failure) {
        (Err(error), _) => (EndStatus::Fault, error.to_string(), 0),
        (Ok(_), Some(failure)) => (EndStatus::Fault, failure, 0),
        (Ok(Some(why)), None) => (EndStatus::Interrupted, why, 0),
        (Ok(None), None) if signal != 0 => (EndStatus::Interrupted, asked(signal), signal),
        (Ok(None), None) => (EndStatus::Completed, "homed; the drives are off".to_owned(), 0),
    })
}

fn patience(cell: &Cell, session: &Session, timeout_s: f64) -> Patience {
    let forgiven_s = if session.forgives_stalls() { SIMULATED_PATIENCE_S } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let cycles = |span_s: f64| (span_s / cell.cycle_s()).ceil() as u32;
    Patience {
        silent: cell.safety.silent_cycles_max + cycles(forgiven_s),
        enabling: cycles(ENABLING_S),
        starting: cycles(STARTING_S),
        search: cycles(timeout_s),
        rest: cycles(REST_S),
        stopping: cycles(STOPPING_S),
    }
}

/// Returns the reason that an axis is not homed.
fn described(
    cell: &Cell,
    session: &Session,
    bus: &mut dyn Bus,
    task: &Task<'_>,
    failure: Failure,
) -> String {
    let homing = &task.homing;
    match failure {
        Failure::Error(word) => format!(
            "homing error: the drive found no home by method {} (statusword 0x{:04X})",
            homing.method, word.0
        ),
        Failure::TimedOut => format!(
            "no home within homing.timeout_s = {} s by method {}",
            homing.timeout_s, homing.method
        ),
        Failure::NotStarted => {
            format!("the drive does not begin method {} within {STARTING_S} s", homing.method)
        }
        Failure::Fault => {
            let found =
                nodes::ask(cell, task.axis, session, |client| commissioning::faults(bus, client));
            found.map_or_else(
                |error| format!("drive in fault ({error})"),
                |found| format!("drive in fault: {}", found.sentence()),
            )
        }
        Failure::NoPower(word) => {
            format!("the drive is not under power (statusword 0x{:04X})", word.0)
        }
        Failure::Silent => "the drive does not answer any more".to_owned(),
        Failure::StaysOn(word) => {
            format!("the drive does not switch off (statusword 0x{:04X})", word.0)
        }
        Failure::BrokenOff => "broken off".to_owned(),
    }
}

/// Checks that the drive keeps that it is homed, and reads the position.
fn confirm(
    cell: &Cell,
    session: &Session,
    bus: &mut dyn Bus,
    task: &mut Task<'_>,
) -> Result<(), String> {
    let timeout = Duration::from_secs_f64(cell.safety.answer_timeout_s);
    let scale = design::axis_scale(cell, task.axis).map_err(|error| error.to_string())?;
    let said = |error: BringUpError| error.to_string();
    let mode = task.axis.interface.code();
    let mut asked = |client: &SdoClient| -> Result<(bool, i32), BringUpError> {
        let failed = |source| BringUpError::Sdo { step: "homing", source };
        client.download(bus, objects::MODE_OF_OPERATION, 0, &mode.to_le_bytes()).map_err(failed)?;
        enter_homing_mode(bus, client, timeout)?;
        let counts = client.upload_u32(bus, objects::POSITION_ACTUAL, 0).map_err(failed)?;
        Ok((is_homed(bus, client)?, counts.cast_signed()))
    };
    let client = nodes::client(cell, task.axis, session).map_err(|error| error.to_string())?;
    let (is_kept, counts) = asked(&client).map_err(said)?;
    if !is_kept {
        return Err("the drive found its home, but does not tell so after a change of mode (bit 12 of 0x6041 is 0); \
                    no run can rely on it"
            .to_owned());
    }
    task.result.position_m = Some(scale.position_m(counts));
    Ok(())
}

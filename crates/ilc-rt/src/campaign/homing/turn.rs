//! One turn of a homing: the drives with the same order search their homes together. For `homing` only.

use std::sync::atomic::Ordering;

use super::round::{Round, Station};
use super::seeker::{Failure, Patience, Seeker};
use super::{End, Report, Task};
use crate::campaign::nodes;
use crate::campaign::options::{SIMULATED_PATIENCE_S, Session};
use crate::campaign::reason::asked;
use crate::commissioning;
use crate::config::{Axis, Cell, ConfigError, Homing};
use crate::design;
use crate::fieldbus::Bus;
use crate::fieldbus::canopen::NmtCommand;
use crate::record::EndStatus;

/// Time from power off to operation enabled.
const ENABLING_S: f64 = 5.0;
/// Time from the start to a sign that the drive is at it.
const STARTING_S: f64 = 1.0;
/// Time at about the same position that is rest.
const REST_S: f64 = 0.1;
/// Velocity that is rest, as a share of the limit.
const REST_SHARE: f64 = 1e-4;
/// Time from a quick stop to power off.
const STOPPING_S: f64 = 10.0;
/// Cycles without an answer in lock-step, where each of them is waited for.
const SILENT_IN_LOCKSTEP: u32 = 2;

/// Homes the axes of one turn together.
pub(super) fn take(
    cell: &Cell,
    turn: &mut [&mut Task<'_>],
    session: &Session,
    bus: &mut dyn Bus,
    report: &mut Report<'_>,
) -> Result<End, ConfigError> {
    let mut stations: Vec<Station> = Vec::with_capacity(turn.len());
    for task in turn.iter() {
        let node = design::node(cell, task.axis.node)?;
        let scale = design::axis_scale(cell, task.axis)?;
        let patience = patience(cell, session, task);
        stations.push((node, scale, Seeker::new(Homing::moves(task.homing.method), patience)));
    }
    let searching: Vec<String> = turn
        .iter()
        .map(|task| format!("{} by method {}", task.axis.name, task.homing.method))
        .collect();
    let began = format!("searching home: {}", searching.join(", "));
    let axes: Vec<&Axis> = turn.iter().map(|task| task.axis).collect();
    let ended = Round::new(cell, session, &axes, &mut stations).pursue(bus, &began, report);
    for (node, _, _) in &stations {
        // A node that is gone needs it no more.
        let _ = bus.send(&NmtCommand::PreOperational.frame(Some(*node)));
    }
    let failures: Vec<Option<Failure>> =
        stations.iter().map(|(_, _, seeker)| seeker.failure()).collect();
    let failure = conclude(cell, turn, &failures, session, bus);
    let signal = session.stop.load(Ordering::Relaxed);
    Ok(match (ended, failure) {
        (Err(error), _) => End::fault(error.to_string()),
        (Ok(_), Some(failure)) => End::fault(failure),
        (Ok(Some(reason)), None) => End { status: EndStatus::Interrupted, reason, signal: 0 },
        (Ok(None), None) if signal != 0 => {
            End { status: EndStatus::Interrupted, reason: asked(signal), signal }
        }
        (Ok(None), None) => End::completed(),
    })
}

/// Completes the results; returns the first failure that is not the consequence of another reason.
fn conclude(
    cell: &Cell,
    turn: &mut [&mut Task<'_>],
    failures: &[Option<Failure>],
    session: &Session,
    bus: &mut dyn Bus,
) -> Option<String> {
    let mut first = None;
    for (task, failure) in turn.iter_mut().zip(failures) {
        let found = match failure {
            Some(failure) => Err(described(cell, session, bus, task, *failure)),
            None => nodes::confirm_homed(cell, task.axis, bus, session),
        };
        task.result.homed = found.is_ok();
        task.result.position_m = found.as_ref().ok().copied();
        let error = found.err();
        if *failure != Some(Failure::BrokenOff) && first.is_none() {
            first = error.as_ref().map(|error| format!("axis {}: {error}", task.axis.name));
        }
        task.result.error = error;
    }
    first
}

fn patience(cell: &Cell, session: &Session, task: &Task<'_>) -> Patience {
    let forgiven_s = if session.forgives_stalls() { SIMULATED_PATIENCE_S } else { 0.0 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let cycles = |span_s: f64| (span_s / cell.cycle_s()).ceil() as u32;
    let rest_m = REST_SHARE * task.axis.limits.velocity_max_m_s * REST_S;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
    let rest_counts = (rest_m * task.axis.counts_per_m).ceil() as u32;
    let silent_max = cell.safety.silent_cycles_max;
    let (silent, lost) = if session.lockstep {
        let silent = silent_max.min(SILENT_IN_LOCKSTEP);
        (silent, 2 * silent)
    } else {
        (silent_max + cycles(forgiven_s), cycles(STOPPING_S))
    };
    Patience {
        silent,
        lost,
        enabling: cycles(ENABLING_S),
        starting: cycles(STARTING_S),
        search: cycles(task.homing.timeout_s),
        rest: cycles(REST_S),
        // An encoder at rest may flicker between two counts.
        rest_counts: rest_counts.max(1),
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
            "homing error: the drive found no home by method {} (statusword 0x{:04X}); look at its switches, its \
             index pulse and the speeds of [axis.homing]",
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

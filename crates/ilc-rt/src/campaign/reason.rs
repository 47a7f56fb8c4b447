//! Reason of a stop, as a sentence that names axis, node and numbers.

use super::control::STOPPED_BY_COMMAND;
use super::inputs;
use super::options::{SIMULATED_PATIENCE_S, Session};
use crate::commissioning::power_lost;
use crate::config::{AxisUnit, Cell, Direction, Input, InputKind, mode};
use crate::fieldbus::BusError;
use crate::fieldbus::canopen::{NmtCommand, NmtState, emcy};
use crate::fieldbus::cia402::Statusword;
use crate::servo::{StopReason, Stranger};

/// Returns the sentence for a stop.
pub(super) fn sentence(reason: StopReason, cell: &Cell, session: &Session) -> String {
    let axis = |index: usize| {
        cell.axes.get(index).map_or_else(
            || format!("axis {index}"),
            |axis| format!("axis {} (node {})", axis.name, axis.node),
        )
    };
    let ms = |cycles: u32| f64::from(cycles) * cell.cycle_s() * 1e3;
    // In lock-step the loop waits for every answer, so the count of cycles is meaningless.
    let unanswered = |cycles: u32| {
        if session.lockstep {
            format!("no answer in {} s", cell.safety.answer_timeout_s)
        } else {
            format!("no answer in {cycles} cycles ({:.0} ms)", ms(cycles))
        }
    };
    match reason {
        StopReason::Asked(STOPPED_BY_COMMAND) => "stopped by command".to_owned(),
        StopReason::Asked(signal) => asked(signal),
        StopReason::DriveFault { axis: index, code, following_error_m } => format!(
            "drive of {} faulted: {}; its following error was {}",
            axis(index),
            cause(code),
            distance(cell, index, following_error_m)
        ),
        StopReason::NotEnabled { axis: index, statusword } => {
            format!("drive of {} is not enabled: {}", axis(index), off(statusword))
        }
        StopReason::SilentAxis { axis: index, cycles } => {
            format!("drive of {} is silent: {}", axis(index), unanswered(cycles))
        }
        StopReason::SilentPdo { axis: index, pdo, cycles } => format!(
            "TPDO{pdo} of the drive of {} is silent: {}, while TPDO{} comes",
            axis(index),
            unanswered(cycles),
            3 - pdo
        ),
        StopReason::WrongLength { node, pdo, n_bytes, needed } => format!(
            "no {} of node {node}: its TPDO{pdo} has {n_bytes} bytes, {needed} are needed",
            carried(cell, node, pdo)
        ),
        StopReason::SilentTool { cycles } => format!(
            "tool measurement (node {}) is silent: {}",
            cell.tcp_encoder.map_or(0, |tool| tool.node),
            unanswered(cycles)
        ),
        StopReason::NodeLeft { node } => format!("node {node} restarted"),
        StopReason::NodeStopped { node, state: NmtState::Stopped } => {
            format!("node {node} was stopped by NMT")
        }
        StopReason::NodeStopped { node, state } => {
            format!("node {node} was taken out of operation by NMT: it is {state}")
        }
        StopReason::OtherMaster(stranger) => format!(
            "another master is on the bus: {} seen that this controller did not send",
            strange(stranger)
        ),
        StopReason::FollowingError { axis: index, error_m } => {
            format!("{}: {}", axis(index), lag(cell, index, error_m))
        }
        StopReason::OutsideLimits { axis, position_m } => outside(cell, axis, position_m),
        StopReason::Jump { axis: index, step_m } => format!(
            "{}: its position jumped by {} from one answer to the next, farther than it can move",
            axis(index),
            distance(cell, index, step_m)
        ),
        StopReason::NoMotion { axis: index, force_n } => format!(
            "{}: its position stands still although the force grew by {force_n:.1} {}, which must move \
             it: it is blocked, or its encoder has failed",
            axis(index),
            cell.axes.get(index).map_or("N", |axis| mode::unit_of(InputKind::Torque, axis.unit))
        ),
        StopReason::NotFinite { axis: index } => {
            format!("{}: the command was not a finite number", axis(index))
        }
        StopReason::Overrun { cycles } => format!(
            "this computer stalled for {:.0} ms: the loop woke {cycles} cycles late; {}",
            ms(cycles),
            forgiven(cell, session)
        ),
        StopReason::Stalled { axis: index, cycles } => format!(
            "this computer stalled for {:.0} ms: the loop woke {cycles} cycles late, and the drive of \
             {} stopped by itself, as no command came in time (0x{:04X})",
            ms(cycles),
            axis(index),
            emcy::CODE_RPDO_TIMEOUT
        ),
        StopReason::Congested { cycles } => format!(
            "the bus did not take every frame for {cycles} cycles ({:.0} ms): {}",
            ms(cycles),
            BusError::Full
        ),
        StopReason::Bus(error) => format!("{error}"),
        StopReason::GuardOpen { input } => of_input(cell, input, inputs::open),
        StopReason::StopButton { input } => of_input(cell, input, |cell, input| {
            format!("stopped by the button {}", inputs::place(cell, input))
        }),
        StopReason::LimitSwitch { input, .. } => of_input(cell, input, at_limit),
    }
}

/// Describes a following error that is too large.
fn lag(cell: &Cell, index: usize, error_m: f64) -> String {
    let allowed_m = cell.axes.get(index).map_or(0.0, |axis| axis.limits.following_error_max_m);
    format!(
        "following error {}, limits.following_error_max_m allows {}",
        distance(cell, index, error_m.abs()),
        distance(cell, index, allowed_m)
    )
}

/// Describes the cause of a drive's fault.
fn cause(code: u16) -> String {
    match code {
        emcy::CODE_RESET => "no emergency message says why".to_owned(),
        _ => format!("0x{code:04X} {}", emcy::meaning(code)),
    }
}

/// Describes a stop by an input.
fn of_input(cell: &Cell, input: usize, describe: impl FnOnce(&Cell, &Input) -> String) -> String {
    let named = cell.inputs.get(input).map(|named| describe(cell, named));
    named.unwrap_or_else(|| format!("stopped by input {input}"))
}

/// Describes a limit switch that an axis moved towards.
fn at_limit(cell: &Cell, input: &Input) -> String {
    let axis = cell.axes.iter().find(|axis| axis.name == input.axis);
    let towards = axis.and_then(|axis| input.direction_of(axis));
    format!(
        "axis {}: limit switch {} is reached in {} direction: move away from it by hand (`ilc-rt jog`)",
        input.axis,
        inputs::place(cell, input),
        towards.map_or("its", Direction::name)
    )
}

/// Names the state of a drive that is not enabled, and an emergency stop as its likely cause.
fn off(statusword: u16) -> String {
    let state = Statusword(statusword).state();
    let state = state.map_or_else(|| "no known state".to_owned(), |state| state.to_string());
    let cause = if power_lost(statusword) {
        "; its power stage is off, as after an emergency stop (STO): it stays off until a person \
         starts again"
    } else {
        ""
    };
    format!("statusword 0x{statusword:04X}, {state}{cause}")
}

/// Names the origin of a stop request.
pub(super) fn asked(signal: i32) -> String {
    match signal {
        libc::SIGINT => "stopped by Ctrl-C".to_owned(),
        libc::SIGTERM => "stopped by SIGTERM".to_owned(),
        libc::SIGPIPE => "stopped as nobody reads the events any more".to_owned(),
        libc::SIGHUP => "stopped as its terminal is gone (SIGHUP)".to_owned(),
        other => format!("stopped by signal {other}"),
    }
}

/// Names the content of a node's TPDO.
fn carried(cell: &Cell, node: u8, pdo: u8) -> &'static str {
    let is_tool = cell.tcp_encoder.is_some_and(|tool| tool.node == node);
    match pdo {
        _ if is_tool => "position",
        1 => "status",
        _ => "following error",
    }
}

/// Longest stall of this computer.
fn forgiven(cell: &Cell, session: &Session) -> String {
    if session.simulated {
        format!("with simulated drives {SIMULATED_PATIENCE_S} s are forgiven")
    } else {
        format!("safety.overrun_cycles_max allows {}", cell.safety.overrun_cycles_max)
    }
}

/// Describes the position of an axis that may not be enabled there.
fn outside(cell: &Cell, axis: usize, position_m: f64) -> String {
    let Some(axis) = cell.axes.get(axis) else {
        return format!("axis {axis} is at {position_m}, outside its limits");
    };
    let unit = axis.unit.symbol();
    let (low, high) = (axis.limits.position_min_m, axis.limits.position_max_m);
    // With the digits of a count, without those that are only rounding.
    let resolution = 10_f64.powf(axis.counts_per_m.log10().ceil());
    let position = (position_m * resolution).round() / resolution;
    format!(
        "axis {} is at {position} {unit}, outside {low} to {high} {unit}: bring it back by other \
         means; nothing has moved",
        axis.name
    )
}

/// Names the message of another master.
fn strange(stranger: Stranger) -> String {
    match stranger {
        Stranger::Sync => "SYNC".to_owned(),
        Stranger::Nmt(command, node) => {
            let what = match command {
                NmtCommand::Start => "start",
                NmtCommand::Stop => "stop",
                NmtCommand::PreOperational => "pre-operational",
                NmtCommand::ResetNode => "reset",
                NmtCommand::ResetCommunication => "communication reset",
            };
            let whom = node.map_or_else(|| "all nodes".to_owned(), |node| format!("node {node}"));
            format!("NMT {what} of {whom}")
        }
        Stranger::Command(node) => format!("a command (RPDO) to node {node}"),
        Stranger::Request(node) => format!("an SDO request to node {node}"),
    }
}

/// Formats a distance of an axis in thousandths of its unit.
fn distance(cell: &Cell, axis: usize, distance: f64) -> String {
    let unit = cell.axes.get(axis).map_or(AxisUnit::M, |axis| axis.unit);
    format!("{:.3} m{}", distance * 1e3, unit.symbol())
}

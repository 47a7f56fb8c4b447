//! Why the axes were stopped, in one sentence that names axis, node and numbers.

use super::options::{Options, SIMULATED_PATIENCE_S};
use crate::config::Cell;
use crate::fieldbus::canopen::emcy;
use crate::fieldbus::cia402::Statusword;
use crate::record::EndStatus;
use crate::servo::StopReason;

/// The sentence for a reason to stop.
pub(super) fn sentence(reason: StopReason, cell: &Cell, options: &Options) -> String {
    let axis = |index: usize| {
        cell.axes.get(index).map_or_else(
            || format!("axis {index}"),
            |axis| format!("axis {} (node {})", axis.name, axis.node),
        )
    };
    // In lock-step the loop waits for every answer, so that the count of cycles says nothing.
    let unanswered = |cycles: u32| {
        if options.lockstep {
            format!("no answer in {} s", cell.safety.answer_timeout_s)
        } else {
            format!(
                "no answer in {cycles} cycles ({:.0} ms)",
                f64::from(cycles) * cell.cycle_s() * 1e3
            )
        }
    };
    let ms = |cycles: u32| f64::from(cycles) * cell.cycle_s() * 1e3;
    match reason {
        StopReason::Asked(signal) => match signal {
            libc::SIGINT => "stopped by Ctrl-C".to_owned(),
            libc::SIGTERM => "stopped by SIGTERM".to_owned(),
            libc::SIGPIPE => "stopped as nobody reads the events any more".to_owned(),
            libc::SIGHUP => "stopped as its terminal is gone (SIGHUP)".to_owned(),
            other => format!("stopped by signal {other}"),
        },
        StopReason::DriveFault { axis: index, code, following_error_m } => format!(
            "drive of {} faulted: 0x{code:04X} {}; its following error was {:.3} mm",
            axis(index),
            emcy::meaning(code),
            following_error_m * 1e3
        ),
        StopReason::NotEnabled { axis: index, statusword } => {
            let state = Statusword(statusword)
                .state()
                .map_or_else(|| "no known state".to_owned(), |state| state.to_string());
            format!(
                "drive of {} is not enabled: statusword 0x{statusword:04X}, {state}",
                axis(index)
            )
        }
        StopReason::SilentAxis { axis: index, cycles } => {
            format!("drive of {} is silent: {}", axis(index), unanswered(cycles))
        }
        StopReason::SilentTool { cycles } => format!(
            "tool measurement (node {}) is silent: {}",
            cell.tcp_encoder.map_or(0, |tool| tool.node),
            unanswered(cycles)
        ),
        StopReason::NodeLeft { node } => {
            format!("node {node} restarted or left operation by itself")
        }
        StopReason::FollowingError { axis: index, error_m } => format!(
            "{}: following error {:.3} mm, limits.following_error_max_m allows {:.3} mm",
            axis(index),
            error_m.abs() * 1e3,
            cell.axes.get(index).map_or(0.0, |a| a.limits.following_error_max_m * 1e3)
        ),
        StopReason::NotFinite { axis: index } => {
            format!("{}: the command was not a finite number", axis(index))
        }
        StopReason::Overrun { cycles } => format!(
            "this computer stalled for {:.0} ms: the loop woke {cycles} cycles late; {}",
            ms(cycles),
            if options.simulated {
                format!("with simulated drives {SIMULATED_PATIENCE_S} s are forgiven")
            } else {
                format!("safety.overrun_cycles_max allows {}", cell.safety.overrun_cycles_max)
            }
        ),
        StopReason::Stalled { axis: index, cycles } => format!(
            "this computer stalled for {:.0} ms: the loop woke {cycles} cycles late, and the drive of \
             {} stopped by itself, as no command came in time (0x{:04X})",
            ms(cycles),
            axis(index),
            emcy::CODE_RPDO_TIMEOUT
        ),
        StopReason::Bus(error) => format!("{error}"),
    }
}

/// Whether a reason is somebody's wish or a fault.
pub(super) fn status(reason: StopReason) -> EndStatus {
    match reason {
        StopReason::Asked(_) => EndStatus::Interrupted,
        StopReason::DriveFault { .. }
        | StopReason::NotEnabled { .. }
        | StopReason::SilentAxis { .. }
        | StopReason::SilentTool { .. }
        | StopReason::NodeLeft { .. }
        | StopReason::FollowingError { .. }
        | StopReason::NotFinite { .. }
        | StopReason::Stalled { .. }
        | StopReason::Overrun { .. }
        | StopReason::Bus(_) => EndStatus::Fault,
    }
}

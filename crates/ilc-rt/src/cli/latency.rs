//! `ilc-rt latency`: how punctual this machine keeps the loop, on axes in memory that stand still.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicI32;

use clap::Args;

use super::figures::FiguresFile;
use super::late::stages_table;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::config::Cell;
use crate::design::{DesignError, Plan};
use crate::fieldbus::network::StillAxes;
use crate::rt::{Clock, MonotonicClock, Nanos, RtRequest, thread};
use crate::servo::{Cycle, Orders, Timing, mailbox, run_until};

/// The loop of no cell in particular: one axis.
const ONE_AXIS: &str = r#"
[cell]
name = "latency"
cycle_us = 1000
[bus]
address = "loopback:"
[[axis]]
name = "x"
node = 1
interface = "csp"
counts_per_m = 1e6
[axis.limits]
position_min_m = -1.0
position_max_m = 1.0
velocity_max_m_s = 1.0
acceleration_max_m_s2 = 10.0
jerk_max_m_s3 = 1000.0
following_error_max_m = 0.1
[program]
start_m = [0.0]
feed_m_s = 0.1
[[program.segment]]
to_m = [0.01]
[learning]
law = "none"
"#;

/// Messages of the loop that may wait; it goes on without a reader.
const MAILBOX: usize = 64;

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt latency
  ilc-rt latency gantry.toml
  ilc-rt latency --cycle-us 500 --seconds 60 --json latency.json")]
pub(super) struct LatencyArguments {
    /// Cell whose loop is measured; one axis if not given. Its drives are not needed: in their place axes in memory
    /// answer at once.
    cell: Option<PathBuf>,
    /// Cycle to keep; that of the cell, or 1000, if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(50..=100_000))]
    cycle_us: Option<u32>,
    /// Duration of the measurement.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=86_400))]
    seconds: u32,
    /// Spin the last microseconds before each deadline.
    #[arg(long, default_value_t = 100)]
    spin_us: u32,
    /// Write the figures to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Measures; returns the exit status.
pub(super) fn latency(arguments: &LatencyArguments) -> u8 {
    let clock = Arc::new(MonotonicClock::new(Nanos::from_micros(arguments.spin_us)));
    let (mut cycle, cycle_us) = match still_loop(arguments, &clock) {
        Ok(prepared) => prepared,
        Err(refusal) => {
            show::complain(&refusal);
            return EXIT_BAD_INPUT;
        }
    };
    let figures_file = match &arguments.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, false) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    let mut report = thread::enter(RtRequest::default());
    let _awake = thread::keep_awake(&mut report);
    show::say(&format!(
        "{} {}, memory {}, kernel {}; measuring for {} s",
        report.policy,
        report.priority,
        if report.mlock { "locked" } else { "not locked" },
        report.kernel,
        arguments.seconds
    ));
    for note in &report.notes {
        show::say(&format!("  note: {note}"));
    }
    let mut timing = Timing::default();
    let end = clock.now().plus(Nanos(u64::from(arguments.seconds) * 1_000_000_000));
    run_until(&mut cycle, clock.as_ref(), &mut timing, end);
    let figures = timing.wake_late.figures();
    show::say(&format!(
        "woke late by at most {:.1} us; 99.9 % {:.1}, 99 % {:.1}, median {:.1}; {} wake-ups",
        figures.max, figures.p999, figures.p99, figures.p50, figures.count
    ));
    let stages = &timing.stages;
    let [receive, control, send] =
        [&stages.receive, &stages.control, &stages.send].map(crate::rt::Latency::figures);
    show::say(&stages_table([
        ("wake", &figures),
        ("receive", &receive),
        ("control", &control),
        ("send", &send),
    ]));
    let interruptions = stages.interruptions;
    show::say(&format!(
        "preempted {} times; page faults: {} without a disk, {} with one",
        interruptions.preemptions, interruptions.minor_faults, interruptions.major_faults
    ));
    if let Some(file) = figures_file {
        let text = serde_json::json!({
            "rt": report,
            "cycle_us": cycle_us,
            "wake_late_us": figures,
            "execution_us": timing.execution.figures(),
            "receive_us": receive,
            "control_us": control,
            "send_us": send,
            "preemptions": interruptions.preemptions,
            "minor_faults": interruptions.minor_faults,
            "major_faults": interruptions.major_faults,
        });
        if !file.write(&text) {
            return EXIT_FAILURE;
        }
    }
    0
}

/// Returns the loop of the cell, at rest at the start of its program, and its cycle.
fn still_loop(
    arguments: &LatencyArguments,
    clock: &Arc<MonotonicClock>,
) -> Result<(Cycle, u32), DesignError> {
    let mut cell = match &arguments.cell {
        Some(path) => Cell::load(path)?,
        None => Cell::parse(ONE_AXIS, "latency")?,
    };
    // Guards that no drive reports would never close.
    cell.inputs.clear();
    let mut plan = Plan::new(&cell, None, false)?;
    let cycle_us = arguments.cycle_us.unwrap_or(cell.cell.cycle_us);
    plan.servo.cycle = Nanos::from_micros(cycle_us);
    plan.servo.runs = 0..1;
    let counts: Vec<i32> = plan
        .servo
        .axes
        .iter()
        .zip(&plan.servo.start_m)
        .map(|(axis, at_m)| axis.scale.position_to_counts(*at_m).unwrap_or(0))
        .collect();
    let network = StillAxes::new(&counts, plan.servo.tool.is_some());
    let (_, loop_side) = mailbox(MAILBOX, Arc::new(AtomicI32::new(0)));
    // No run is ever released.
    let loop_side = loop_side.following(Arc::new(Orders::new(false)));
    let cycle = Cycle::new(Box::new(network), plan.servo, plan.interpolator, loop_side);
    let clock = Arc::clone(clock) as Arc<dyn Clock>;
    Ok((cycle.recorded(clock, cell.realtime.late_share), cycle_us))
}

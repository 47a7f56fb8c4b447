//! `ilc-rt latency`: how late this machine wakes a thread that is set up like the loop's.

use std::path::PathBuf;

use clap::Args;

use super::figures::FiguresFile;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::rt::{Latency, MonotonicClock, Nanos, RtRequest, thread};

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt latency
  ilc-rt latency --cycle-us 500 --seconds 60 --json latency.json")]
pub(super) struct LatencyArguments {
    /// Cycle to keep.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(50..=100_000))]
    cycle_us: u32,
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
    let figures_file = match &arguments.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, false) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    let report = thread::enter(RtRequest::default());
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
    let clock = MonotonicClock::new(Nanos::from_micros(arguments.spin_us));
    let period = Nanos::from_micros(arguments.cycle_us);
    let end = clock.now().plus(Nanos(u64::from(arguments.seconds) * 1_000_000_000));
    let mut latency = Latency::default();
    let mut due = clock.now().plus(period);
    while due < end {
        clock.sleep_until(due);
        let late = clock.now().since(due);
        latency.record(late);
        due = due.plus(Nanos(period.0 * (late.0 / period.0 + 1)));
    }
    let figures = latency.figures();
    show::say(&format!(
        "woke late by at most {:.1} us; 99.9 % {:.1}, 99 % {:.1}, median {:.1}; {} wake-ups",
        figures.max, figures.p999, figures.p99, figures.p50, figures.count
    ));
    if let Some(file) = figures_file {
        let text = serde_json::json!({ "rt": report, "cycle_us": arguments.cycle_us, "wake_late_us": figures });
        if !file.write(&text) {
            return EXIT_FAILURE;
        }
    }
    0
}

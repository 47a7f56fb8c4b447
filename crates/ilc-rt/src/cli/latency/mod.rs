//! `ilc-rt latency`: how punctual this machine keeps the loop, on axes in memory that stand still.

mod load;
mod peer;
mod still;

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use serde_json::{Value, json};

use self::load::Load;
use self::peer::{Peer, PeerFigures};
use super::figures::FiguresFile;
use super::late::stages_table;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::rt::{
    Clock, Latency, LatencyFigures, MonotonicClock, Nanos, Readiness, RtReport, RtRequest, thread,
};
use crate::servo::{Cycle, Timing, run_until};

/// Turns that the loop, `cyclictest` and the loop that hardly sleeps take.
const TURNS: u32 = 5;
/// Share of a cycle that the loop that hardly sleeps busy-waits, in percent: below the share that the kernel
/// allows to real-time threads (95 by default).
const SLEEPLESS_PERCENT: u64 = 90;
/// Largest wake-up lateness of each grade, in microseconds; the usage is that of LinuxCNC's latency test.
const GRADES: [(f64, &str); 3] = [
    (20.0, "excellent: fit for any drive"),
    (50.0, "good: fit for cycles of 250 us and more"),
    (500.0, "usable: fit for drives that interpolate, with cycles of 2 ms and more"),
];
const NO_GRADE: &str = "poor: not fit for a machine; `ilc-rt doctor` names what to change";
/// Width of the bars of a histogram.
const BAR: f64 = 50.0;

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt latency
  ilc-rt latency gantry.toml
  ilc-rt latency --load --histogram
  ilc-rt latency --cpu 1 --seconds 20
  ilc-rt latency --cycle-us 500 --seconds 60 --json latency.json")]
pub(super) struct LatencyArguments {
    /// Cell whose loop is measured; one axis if not given. Its drives are not needed: in their place axes in memory
    /// answer at once.
    cell: Option<PathBuf>,
    /// Cycle to keep; that of the cell, or 1000, if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(50..=100_000))]
    cycle_us: Option<u32>,
    /// Duration of the measurement; in turns with it cyclictest, where it is installed, and a loop that hardly sleeps,
    /// as late as the computer itself makes it, take as long.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=86_400))]
    seconds: u32,
    /// Processor for the loop, and for cyclictest; that of the cell if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(0..=1023))]
    cpu: Option<u16>,
    /// Busy-wait the last microseconds before each deadline; that of the cell, or as long as the wake-ups are measured
    /// to be late, if not given.
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=1000))]
    spin_us: Option<u32>,
    /// Measure again under a load of every processor, memory and disk.
    #[arg(long)]
    load: bool,
    /// Show the histogram of the wake-ups.
    #[arg(long)]
    histogram: bool,
    /// Write the figures to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Measures; returns the exit status.
pub(super) fn latency(arguments: &LatencyArguments) -> u8 {
    let cell = match still::cell(arguments.cell.as_deref()) {
        Ok(cell) => cell,
        Err(refusal) => {
            show::complain(&refusal);
            return EXIT_BAD_INPUT;
        }
    };
    let cpu = arguments.cpu.map(usize::from).or(cell.realtime.cpu);
    let request = RtRequest { cpu, ..RtRequest::default() };
    let cycle_us = arguments.cycle_us.unwrap_or(cell.cell.cycle_us);
    let spin_us = arguments.spin_us.or(cell.realtime.spin_us);
    let spin = Readiness::probe(request, Nanos::from_micros(cycle_us), spin_us).spin;
    let clock = Arc::new(MonotonicClock::new(spin));
    let mut cycle = match still::still_loop(&cell, cycle_us, &clock) {
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
    let mut text = json!({ "cycle_us": cycle_us });
    let mut granted = None;
    for name in if arguments.load { &["quiet", "loaded"][..] } else { &["quiet"] } {
        // Born before the priority, which threads inherit.
        let load = (*name == "loaded").then(Load::start);
        let measured = std::thread::scope(|scope| {
            let measuring = scope.spawn(|| {
                let mut report = thread::enter(request);
                report.spin_us = spin.0 as f64 * 1e-3;
                let _awake = thread::keep_awake(&mut report);
                if granted.is_none() {
                    tell_settings(&report, arguments.seconds);
                }
                let measured = measure(&mut cycle, *clock, cycle_us, arguments.seconds, request);
                (report, measured)
            });
            measuring.join()
        });
        drop(load);
        let Ok((report, measured)) = measured else { return EXIT_FAILURE };
        show::say(&format!("{name}:"));
        tell(&measured, arguments.histogram);
        let part = part(&measured);
        if *name == "loaded" {
            text["loaded"] = part;
        } else if let (Some(all), Value::Object(part)) = (text.as_object_mut(), part) {
            all.extend(part);
        }
        granted = Some(report);
    }
    text["rt"] = json!(granted);
    match figures_file {
        Some(file) if !file.write(&text) => EXIT_FAILURE,
        _ => 0,
    }
}

/// Figures of the three in turns.
struct Measured {
    timing: Timing,
    /// Wake-ups of `cyclictest`, if it is installed.
    peer: Option<PeerFigures>,
    /// Wake-ups of the loop that hardly sleeps: what the kernel, the firmware or a host takes from any program.
    sleepless: LatencyFigures,
}

/// Lets the loop, `cyclictest` and the loop that hardly sleeps take turns.
fn measure(
    cycle: &mut Cycle,
    clock: MonotonicClock,
    cycle_us: u32,
    seconds: u32,
    request: RtRequest,
) -> Measured {
    let n_turns = TURNS.min(seconds);
    let (mut timing, mut peer, mut is_there) = (Timing::default(), Peer::default(), true);
    let awake = Nanos(u64::from(cycle_us) * 1000 * SLEEPLESS_PERCENT / 100);
    let (sleepless_clock, mut sleepless) = (MonotonicClock::new(awake), Timing::default());
    for turn in 0..n_turns {
        let turn_s = seconds / n_turns + u32::from(turn < seconds % n_turns);
        let end = || clock.now().plus(Nanos(u64::from(turn_s) * 1_000_000_000));
        run_until(cycle, &clock, &mut timing, end());
        is_there = is_there && peer.measure(cycle_us, turn_s, request);
        run_until(cycle, &sleepless_clock, &mut sleepless, end());
    }
    let peer = is_there.then(|| peer.figures());
    Measured { timing, peer, sleepless: sleepless.wake_late.figures() }
}

fn tell_settings(report: &RtReport, seconds: u32) {
    show::say(&format!(
        "{} {}, memory {}, busy-waits {:.0} us, kernel {}; measuring for {seconds} s",
        report.policy,
        report.priority,
        if report.mlock { "locked" } else { "not locked" },
        report.spin_us,
        report.kernel,
    ));
    for note in &report.notes {
        show::say(&format!("  note: {note}"));
    }
}

fn tell(measured: &Measured, with_histogram: bool) {
    let Measured { timing, peer, sleepless } = measured;
    let figures = timing.wake_late.figures();
    show::say(&format!(
        "woke late by at most {:.1} us; 99.9 % {:.1}, 99 % {:.1}, median {:.1}; {} wake-ups",
        figures.max, figures.p999, figures.p99, figures.p50, figures.count
    ));
    show::say(&format!("  {}", grade(figures.max)));
    if let Some(peer) = peer {
        show::say(&format!(
            "cyclictest, in turns: at most {:.0} us; 99.9 % {:.0}, 99 % {:.0}, median {:.0}; {} wake-ups",
            peer.max, peer.p999, peer.p99, peer.p50, peer.count
        ));
    }
    show::say(&format!(
        "without sleep, in turns: at most {:.0} us; 99.9 % {:.0}, 99 % {:.0}, median {:.0}: no program is more \
         punctual on this computer",
        sleepless.max, sleepless.p999, sleepless.p99, sleepless.p50
    ));
    let stages = &timing.stages;
    let [receive, control, send] =
        [&stages.receive, &stages.control, &stages.send].map(Latency::figures);
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
    if with_histogram {
        show::say(&histogram(&figures));
    }
}

/// Returns the grade of the longest lateness of a wake-up.
fn grade(max_us: f64) -> &'static str {
    GRADES.iter().find(|(limit_us, _)| max_us <= *limit_us).map_or(NO_GRADE, |(_, name)| name)
}

/// Returns bars on a logarithmic scale: one wake-up in a million counts as well.
fn histogram(figures: &LatencyFigures) -> String {
    let largest = figures.bins.iter().map(|(_, n)| *n).max().unwrap_or(1).max(1);
    let full = (largest as f64 + 1.0).ln();
    let bars = figures.bins.iter().map(|(to_us, n)| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 50")]
        let length = (BAR * (*n as f64 + 1.0).ln() / full) as usize;
        format!("{to_us:>10.1} us {n:>9} {}\n", "#".repeat(length))
    });
    let head = format!("{:>10}    {:>9}\n", "up to", "wake-ups");
    std::iter::once(head).chain(bars).collect::<String>().trim_end().to_owned()
}

fn part(Measured { timing, peer, sleepless }: &Measured) -> Value {
    let stages = &timing.stages;
    let interruptions = stages.interruptions;
    let wake_late = timing.wake_late.figures();
    json!({
        "grade": grade(wake_late.max),
        "wake_late_us": wake_late,
        "cyclictest_us": peer,
        "sleepless_us": sleepless,
        "execution_us": timing.execution.figures(),
        "receive_us": stages.receive.figures(),
        "control_us": stages.control.figures(),
        "send_us": stages.send.figures(),
        "preemptions": interruptions.preemptions,
        "minor_faults": interruptions.minor_faults,
        "major_faults": interruptions.major_faults,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_wake_up_decides_the_grade() {
        assert!(grade(3.0).starts_with("excellent") && grade(20.0).starts_with("excellent"));
        assert!(grade(20.1).starts_with("good") && grade(499.0).starts_with("usable"));
        assert!(grade(500.1).starts_with("poor"));
    }

    #[test]
    fn a_rare_wake_up_has_a_bar_too() {
        let bins = vec![(1.0, 1_000_000), (1.5, 0), (2000.0, 1)];
        let drawn = histogram(&LatencyFigures { bins, ..LatencyFigures::default() });
        let lines: Vec<&str> = drawn.lines().collect();
        assert_eq!(lines.len(), 4);
        assert!(lines[1].ends_with(&"#".repeat(50)) && !lines[2].contains('#'));
        assert!(lines[3].ends_with(" ##"), "{}", lines[3]);
    }
}

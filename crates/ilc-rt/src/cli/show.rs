//! Printed text: the table of runs, and lines on standard error.

use std::fmt::Write as _;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

use super::late;
use super::runs::Runs;
use crate::record::{Event, StateName, printable_json, printable_lines};

/// Prints one line on standard error.
pub(super) fn complain(line: &dyn std::fmt::Display) {
    let line = printable_lines(&line.to_string());
    let level = if is_journal() { "<3>" } else { "" };
    let _ = writeln!(std::io::stderr(), "{level}ilc-rt: {line}");
}

/// Returns true if standard error is the journal, which takes the level of a line from its head.
fn is_journal() -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let Ok(told) = std::env::var("JOURNAL_STREAM") else { return false };
    // Inherited by programs whose output goes elsewhere; the journal's file tells.
    let file = std::fs::metadata("/proc/self/fd/2");
    file.is_ok_and(|file| told == format!("{}:{}", file.dev(), file.ino()))
}

/// Prints one line on standard output; returns true on success. A closed output must not end the
/// program while axes move.
pub(super) fn say(line: &dyn std::fmt::Display) -> bool {
    let line = printable_lines(&line.to_string());
    if ASIDE.load(Ordering::Relaxed) {
        return writeln!(std::io::stderr(), "{line}").is_ok();
    }
    writeln!(std::io::stdout(), "{line}").is_ok()
}

/// True if readable lines go to standard error, as figures go to standard output.
static ASIDE: AtomicBool = AtomicBool::new(false);

/// Redirects readable lines to standard error from now on.
pub(super) fn leave_standard_output() {
    ASIDE.store(true, Ordering::Relaxed);
}

/// Prints a text on standard output unchanged; returns true on success.
pub(super) fn print(text: &str) -> bool {
    let mut out = std::io::stdout();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).is_ok()
}

/// Prints JSON in one line; returns true on success.
pub(super) fn say_json(text: &str) -> bool {
    writeln!(std::io::stdout(), "{}", printable_json(text)).is_ok()
}

/// Returns an event as text for people, if it has one; `runs` has the runs before.
pub(super) fn sentence(event: &Event, runs: &mut Runs) -> Option<String> {
    match event {
        Event::Start {
            cell,
            bus,
            mode,
            law,
            measure,
            n_samples,
            n_axes,
            input_units,
            cycle_s,
            campaign,
            ctl,
            rt,
            iterations,
            ..
        } => {
            runs.begin(input_units, *n_axes, *iterations);
            let thread = rt.as_ref().map_or_else(String::new, |rt| {
                let memory = if rt.mlock { "locked" } else { "not locked" };
                let notes: String = rt.notes.iter().flat_map(|note| ["\n  note: ", note]).collect();
                format!(
                    "\nservo thread: {} {}{}, memory {memory}, busy-waits {:.0} us, kernel {}{notes}",
                    rt.policy,
                    rt.priority,
                    rt.cpu.map_or_else(String::new, |cpu| format!(", processor {cpu}")),
                    rt.spin_us,
                    rt.kernel
                )
            });
            Some(format!(
                "cell {cell} on {bus}, {mode}, {:.0} us cycle, {n_samples} samples a run; law {law} from \
                 the {measure}; campaign {campaign}{thread}{}",
                cycle_s * 1e6,
                ctl.as_ref().map_or_else(String::new, |path| format!("\ncontrol: {path}"))
            ))
        }
        Event::Iteration { index, figures, .. } => Some(runs.row(*index, figures)),
        Event::State { state: StateName::Homing, .. } => {
            Some("homing the axes that are not homed".to_owned())
        }
        Event::State { state: StateName::Stopping, iteration } => {
            Some(format!("bringing the axes to rest (run {iteration})"))
        }
        Event::Latency { .. } => timing(event),
        Event::Fault { fault, .. } => {
            fault.late.as_ref().map(|cycle| format!("before the stop: {}", late::sentence(cycle)))
        }
        Event::End { reason, .. } => Some(match runs.sentence() {
            Some(sentence) => format!("{sentence}\n{reason}"),
            None => reason.clone(),
        }),
        Event::Drift { index, ratio, allowed, origin, relearned_in } => Some(format!(
            "drift: the error of run {index} is {} that of {origin}, {allowed} is allowed{}",
            ratio.map_or_else(|| "beyond".to_owned(), |ratio| format!("{ratio:.2} times")),
            relearned_in.as_ref().map_or_else(
                || "; the input stays frozen".to_owned(),
                |campaign| format!(
                    "; learning starts again from its input, in campaign {campaign}"
                )
            )
        )),
        Event::Recording { file, reason: None, .. } => Some(format!("recording: {file}")),
        Event::Judged { index, remark, .. } => runs.judged(*index, remark.as_deref()),
        Event::State { .. }
        | Event::Inputs { .. }
        | Event::Drives { .. }
        | Event::Recording { .. }
        | Event::Progress { .. }
        | Event::Late { .. } => None,
    }
}

/// Returns the timing of a loop that is over: its stages, and who was late.
fn timing(event: &Event) -> Option<String> {
    let Event::Latency {
        wake_late_us,
        execution_us,
        receive_us,
        control_us,
        send_us,
        late: counts,
        worst,
        file,
        ..
    } = event
    else {
        return None;
    };
    let stages = [
        ("wake", wake_late_us),
        ("receive", receive_us),
        ("control", control_us),
        ("send", send_us),
    ];
    let n_ticks = wake_late_us.count;
    let mut text = format!(
        "loop: woke late by {:.1} us (median), {:.0} (99 %), {:.0} (most); a tick took {:.1} us \
         (median), {:.0} (most); {n_ticks} ticks\n{}\n{}",
        wake_late_us.p50,
        wake_late_us.p99,
        wake_late_us.max,
        execution_us.p50,
        execution_us.max,
        late::stages_table(stages),
        late::counts(counts, n_ticks)
    );
    if let Some(cycle) = worst {
        let _ = write!(text, "\nworst, tick {}: {}", cycle.tick, late::sentence(cycle));
        if let Some(file) = file {
            let _ = write!(text, "\nmore: ilc-rt why {file}");
        }
    }
    Some(text)
}

//! Text for people: the table of runs, and lines on standard error.

use std::io::Write;

use crate::record::{Event, StateName};

/// Columns of the table of runs.
const HEADINGS: [&str; 7] = [
    "run",
    "max tracking um",
    "rms tracking um",
    "max contour um",
    "change",
    "overruns",
    "update ms",
];

/// Prints one line on standard error.
pub(super) fn complain(line: &dyn std::fmt::Display) {
    let _ = writeln!(std::io::stderr(), "ilc-rt: {line}");
}

/// Prints one line on standard output, and tells whether somebody can read it. A reader who has gone
/// must not end the program while axes move.
pub(super) fn say(line: &dyn std::fmt::Display) -> bool {
    writeln!(std::io::stdout(), "{line}").is_ok()
}

/// What an event says to a person, if anything; `first_contour_m` remembers the first run's.
pub(super) fn sentence(event: &Event, first_contour_m: &mut Option<f64>) -> Option<String> {
    match event {
        Event::Start {
            cell, bus, mode, law, measure, n_samples, cycle_s, campaign, rt, ..
        } => {
            let thread = rt.as_ref().map_or_else(String::new, |rt| {
                let memory = if rt.mlock { "locked" } else { "not locked" };
                let notes: String = rt.notes.iter().flat_map(|note| ["\n  note: ", note]).collect();
                format!(
                    "servo thread: {} {}, memory {memory}, kernel {}{notes}\n",
                    rt.policy, rt.priority, rt.kernel
                )
            });
            let [run, max, rms, contour, change, overruns, update] = HEADINGS;
            Some(format!(
                "cell {cell} on {bus}, {mode}, {:.0} us cycle, {n_samples} samples a run; law {law} from \
                 the {measure}; campaign {campaign}\n{thread}{run:>4} {max:>16} {rms:>16} {contour:>15} \
                 {change:>9} {overruns:>9} {update:>10}",
                cycle_s * 1e6
            ))
        }
        Event::Iteration { index, figures, .. } => {
            let first = *first_contour_m.get_or_insert(figures.contour_inf_m);
            Some(format!(
                "{index:>4} {:>16.1} {:>16.1} {:>15.1} {:>8.1}% {:>9} {:>10.3}{}",
                figures.tracking_inf_m * 1e6,
                figures.tracking_rms_m * 1e6,
                figures.contour_inf_m * 1e6,
                (figures.contour_inf_m / first - 1.0) * 100.0,
                figures.overruns,
                figures.update_ms,
                if figures.rolled_back { "  error grew: best input restored" } else { "" }
            ))
        }
        Event::State { state: StateName::Stopping, iteration } => {
            Some(format!("bringing the axes to rest (run {iteration})"))
        }
        Event::Latency { wake_late_us, execution_us } => Some(format!(
            "loop: woke late by {:.1} us (median), {:.0} (99 %), {:.0} (most); a tick took {:.1} us \
             (median), {:.0} (most); {} ticks",
            wake_late_us.p50,
            wake_late_us.p99,
            wake_late_us.max,
            execution_us.p50,
            execution_us.max,
            wake_late_us.count
        )),
        Event::End { reason, .. } => Some(reason.clone()),
        Event::State { .. } | Event::Progress { .. } | Event::Fault { .. } => None,
    }
}

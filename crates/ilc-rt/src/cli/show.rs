//! Text for people: the table of runs, and lines on standard error.

#![expect(clippy::print_stdout, clippy::print_stderr, reason = "this is the program's output")]

use crate::record::{Event, StateName};

/// Prints one line on standard error.
pub(super) fn complain(line: &dyn std::fmt::Display) {
    eprintln!("ilc-rt: {line}");
}

/// Prints one line on standard output.
pub(super) fn say(line: &dyn std::fmt::Display) {
    println!("{line}");
}

/// Prints what an event says to a person.
pub(super) fn event(event: &Event, first_contour_m: &mut Option<f64>) {
    match event {
        Event::Start {
            cell, bus, mode, law, measure, n_samples, cycle_s, campaign, rt, ..
        } => {
            println!(
                "cell {cell} on {bus}, {mode}, {:.0} us cycle, {n_samples} samples a run; law {law} from \
                 the {measure}; campaign {campaign}",
                cycle_s * 1e6
            );
            if let Some(rt) = rt {
                println!(
                    "servo thread: {} {}, memory {}, kernel {}",
                    rt.policy,
                    rt.priority,
                    if rt.mlock { "locked" } else { "not locked" },
                    rt.kernel
                );
                for note in &rt.notes {
                    println!("  note: {note}");
                }
            }
            println!(
                "{:>4} {:>16} {:>16} {:>15} {:>9} {:>9} {:>10}",
                "run",
                "max tracking um",
                "rms tracking um",
                "max contour um",
                "change",
                "overruns",
                "update ms"
            );
        }
        Event::Iteration { index, figures, .. } => {
            let first = *first_contour_m.get_or_insert(figures.contour_inf_m);
            println!(
                "{index:>4} {:>16.1} {:>16.1} {:>15.1} {:>8.1}% {:>9} {:>10.3}{}",
                figures.tracking_inf_m * 1e6,
                figures.tracking_rms_m * 1e6,
                figures.contour_inf_m * 1e6,
                (figures.contour_inf_m / first - 1.0) * 100.0,
                figures.overruns,
                figures.update_ms,
                if figures.rolled_back { "  error grew: best input restored" } else { "" }
            );
        }
        Event::State { state: StateName::Stopping, iteration } => {
            println!("bringing the axes to rest (run {iteration})");
        }
        Event::Latency { wake_late_us, execution_us } => println!(
            "loop: woke late by {:.1} us (median), {:.0} (99 %), {:.0} (most); a tick took {:.1} us \
             (median), {:.0} (most); {} ticks",
            wake_late_us.p50,
            wake_late_us.p99,
            wake_late_us.max,
            execution_us.p50,
            execution_us.max,
            wake_late_us.count
        ),
        Event::End { reason, .. } => println!("{reason}"),
        Event::State { .. } | Event::Progress { .. } | Event::Fault { .. } => {}
    }
}

//! Sentences and tables of lost deadlines, for `run`, `why` and `latency`.

use std::fmt::Write as _;

use crate::record::{LateCause, LateCounts, LateCycle};
use crate::rt::LatencyFigures;

/// Returns who was late, in a sentence.
pub(super) fn sentence(cycle: &LateCycle) -> String {
    let LateCycle { stages, usual, .. } = cycle;
    let mut text = match cycle.cause {
        LateCause::WakeUp => format!(
            "the host woke the loop {:.0} us late (usually {:.0})",
            stages.wake_us, usual.wake_us
        ),
        LateCause::Preemption => format!(
            "the host gave the processor to another thread: the cycle took {:.0} us (usually {:.0})",
            stages.used_us(),
            usual.used_us()
        ),
        LateCause::Receive => received(cycle),
        LateCause::Computation => format!(
            "the computation took {:.0} us (usually {:.0})",
            stages.control_us, usual.control_us
        ),
        LateCause::Send if cycle.refused => {
            "the bus did not take every frame: its queue was full".to_owned()
        }
        LateCause::Send => format!(
            "the bus took the commands late: sending took {:.0} us (usually {:.0})",
            stages.send_us, usual.send_us
        ),
    };
    if cycle.major_faults > 0 {
        let _ = write!(text, ", with {} page faults from disk", cycle.major_faults);
    }
    match cycle.missed {
        0 => {}
        1 => text.push_str("; 1 cycle was skipped"),
        n => {
            let _ = write!(text, "; {n} cycles were skipped");
        }
    }
    text
}

fn received(cycle: &LateCycle) -> String {
    let LateCycle { stages, usual, .. } = cycle;
    let sender = cycle.node.map(|node| node_in_words(node, cycle.axis.as_deref()));
    let usually = |usual_us: Option<f64>| {
        usual_us.map_or_else(String::new, |usual_us| format!(" (usually {usual_us:.0})"))
    };
    if stages.used_us() > cycle.allowed_us || cycle.missed > 0 {
        let whose = sender.map_or_else(String::new, |sender| format!(", most of it for {sender}"));
        return format!(
            "receiving took {:.0} us (usually {:.0}){whose}",
            stages.receive_us, usual.receive_us
        );
    }
    match (sender, cycle.answer_us) {
        (Some(sender), Some(answer_us)) => format!(
            "{sender} answered {answer_us:.0} us after SYNC{}",
            usually(cycle.usual_answer_us)
        ),
        (Some(sender), None) => format!(
            "{sender} did not answer{}",
            cycle
                .usual_answer_us
                .map_or_else(String::new, |us| format!(" (usually {us:.0} us after SYNC)"))
        ),
        (None, _) => "the bus brought all answers after the next SYNC".to_owned(),
    }
}

/// Returns a node with its axis.
pub(super) fn node_in_words(node: u8, axis: Option<&str>) -> String {
    format!("node {node} ({})", axis.unwrap_or("tool"))
}

/// Returns the number of late cycles and their causes.
pub(super) fn counts(late: &LateCounts, n_ticks: u64) -> String {
    let n = late.all();
    if n == 0 {
        return format!("none of {n_ticks} cycles was late");
    }
    let causes = late.by_cause().into_iter().filter(|(_, n)| *n > 0);
    let causes: Vec<_> = causes.map(|(cause, n)| format!("{n} by {}", in_words(cause))).collect();
    format!("{n} of {n_ticks} cycles were late, {} skipped: {}", late.missed, causes.join(", "))
}

/// Returns a cause in two words.
pub(super) fn in_words(cause: LateCause) -> &'static str {
    match cause {
        LateCause::WakeUp => "late wake-up",
        LateCause::Preemption => "preemption",
        LateCause::Receive => "late answers",
        LateCause::Computation => "computation",
        LateCause::Send => "a blocked bus",
    }
}

/// Returns the heading of the table of stages.
pub(super) fn stages_heading() -> String {
    format!("{:<20}{:>10}{:>10}{:>10}", "us", "p50", "p99", "max")
}

/// Returns a row of the table of stages.
pub(super) fn stage_row(name: &str, [p50_us, p99_us, max_us]: [f64; 3]) -> String {
    format!("{name:<20}{p50_us:>10.1}{p99_us:>10.1}{max_us:>10.1}")
}

/// Returns the table of the stages of a loop.
pub(super) fn stages_table(stages: [(&str, &LatencyFigures); 4]) -> String {
    let rows = stages
        .iter()
        .map(|(name, figures)| stage_row(name, [figures.p50, figures.p99, figures.max]));
    std::iter::once(stages_heading()).chain(rows).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::StageSpans;

    fn late(cause: LateCause) -> LateCycle {
        let usual = StageSpans {
            wake_us: 12.0,
            receive_us: 30.0,
            control_us: 200.0,
            send_us: 40.0,
            slack_us: 718.0,
        };
        LateCycle {
            tick: 7,
            cause,
            axis: None,
            node: None,
            missed: 0,
            allowed_us: 900.0,
            stages: usual,
            usual,
            answer_us: None,
            usual_answer_us: None,
            refused: false,
            preemptions: 0,
            minor_faults: 0,
            major_faults: 0,
        }
    }

    #[test]
    fn every_cause_has_its_sentence() {
        let mut cycle = late(LateCause::WakeUp);
        (cycle.stages.wake_us, cycle.missed) = (2812.4, 2);
        assert_eq!(
            sentence(&cycle),
            "the host woke the loop 2812 us late (usually 12); 2 cycles were skipped"
        );
        let mut cycle = late(LateCause::Receive);
        (cycle.node, cycle.axis) = (Some(2), Some("y".to_owned()));
        (cycle.answer_us, cycle.usual_answer_us) = (Some(1310.0), Some(320.0));
        assert_eq!(sentence(&cycle), "node 2 (y) answered 1310 us after SYNC (usually 320)");
        cycle.answer_us = None;
        assert_eq!(sentence(&cycle), "node 2 (y) did not answer (usually 320 us after SYNC)");
        cycle.stages.receive_us = 800.0;
        assert_eq!(
            sentence(&cycle),
            "receiving took 800 us (usually 30), most of it for node 2 (y)"
        );
        let mut cycle = late(LateCause::Computation);
        (cycle.stages.control_us, cycle.major_faults) = (931.0, 3);
        assert_eq!(
            sentence(&cycle),
            "the computation took 931 us (usually 200), with 3 page faults from disk"
        );
        let mut cycle = late(LateCause::Send);
        cycle.stages.send_us = 700.0;
        assert!(sentence(&cycle).ends_with("sending took 700 us (usually 40)"));
        cycle.refused = true;
        assert!(sentence(&cycle).ends_with("its queue was full"));
        assert!(sentence(&late(LateCause::Preemption)).ends_with("took 282 us (usually 282)"));
    }

    #[test]
    fn late_cycles_are_counted_by_their_causes() {
        let late = LateCounts { wake_up: 8, receive: 2, missed: 3, ..LateCounts::default() };
        assert_eq!(
            counts(&late, 5000),
            "10 of 5000 cycles were late, 3 skipped: 8 by late wake-up, 2 by late answers"
        );
        assert_eq!(counts(&LateCounts::default(), 5000), "none of 5000 cycles was late");
    }
}

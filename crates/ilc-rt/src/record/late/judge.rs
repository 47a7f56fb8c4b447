//! The cause of a lost deadline, from the stamps of the cycles around it: a pure function.

use super::{LateCause, StageSpans};
use crate::rt::flight::PLACES_MAX;
use crate::rt::{Nanos, Stamps};

/// Share of a cycle by which a stage must have grown to be its cause; else the longest one is.
const GROWN_SHARE: f64 = 0.1;
/// Cycles before a stop in which its cause is looked for.
const BEFORE_STOP: usize = 32;
/// Cycles without an answer of a place that has answered before.
const SILENT_CYCLES: usize = 3;

/// Cause of a lost deadline; places are numbers of axes, then the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// The cycle that lost it: a cycle that only began late because of the one before is not the cause.
    pub stamps: Stamps,
    /// Part that was late.
    pub cause: LateCause,
    /// Place that was waited for, if it was one.
    pub place: Option<usize>,
    /// Its stages, and the usual ones.
    pub stages: StageSpans,
    /// Median of each stage in the cycles before.
    pub usual: StageSpans,
    /// Time from the exchange to the answer that was waited for.
    pub answer_us: Option<f64>,
    /// Its median in the cycles before.
    pub usual_answer_us: Option<f64>,
}

/// Finds the cause of the last of some cycles, which was late; the others are what is usual. `None` without a cycle.
///
/// The cause is the stage that has grown most over its median in the cycles before, or the longest one if none has
/// grown: a cycle that never fits has no exception to blame.
pub fn judge(cycles: &[Stamps], period: Nanos, allowed: Nanos) -> Option<Verdict> {
    let mut at = cycles.len().checked_sub(1)?;
    while let Some(before) = backlog_of(cycles, at) {
        at = before;
    }
    let (stamps, usual) = (&cycles[at], usual(&cycles[..at], period));
    let stages = spans(cycles, at, period);
    let verdict = |cause, place: Option<usize>| {
        let answer_ns = place.map(|place| stamps.answer_ns[place]).filter(|span_ns| *span_ns > 0);
        Verdict {
            stamps: *stamps,
            cause,
            place,
            stages,
            usual,
            answer_us: answer_ns.map(|span_ns| f64::from(span_ns) * 1e-3),
            usual_answer_us: place.and_then(|place| usual_answer_us(&cycles[..at], place)),
        }
    };
    if stamps.used() <= allowed && stamps.missed == 0 && stamps.late_answers != 0 {
        return Some(verdict(LateCause::Receive, latest(stamps)));
    }
    if stamps.used() <= allowed && stamps.missed == 0 && stamps.refused {
        return Some(verdict(LateCause::Send, None));
    }
    let cause = longest(&stages, &usual);
    let is_interrupted = stamps.interruptions.preemptions > 0 && !stamps.refused;
    Some(match cause {
        LateCause::WakeUp => verdict(cause, None),
        _ if is_interrupted => verdict(LateCause::Preemption, None),
        LateCause::Receive => verdict(cause, waited_for(stamps)),
        _ => verdict(cause, None),
    })
}

/// Finds who was late before the stop in the last of some cycles; `None` if nothing was.
pub fn judge_stop(cycles: &[Stamps], period: Nanos, allowed: Nanos) -> Option<Verdict> {
    let (at, stamps) = (cycles.len().checked_sub(1)?, cycles.last()?);
    let recent = cycles.len().saturating_sub(BEFORE_STOP)..cycles.len();
    // A SYNC that was not sent is not answered.
    let refused = recent.clone().rev().find(|at| cycles[*at].refused);
    let Some(place) = (0..PLACES_MAX).find(|place| is_silent(cycles, *place) && refused.is_none())
    else {
        let late = recent
            .filter(|at| cycles[*at].late)
            .max_by_key(|at| (cycles[*at].missed, cycles[*at].used()));
        return judge(&cycles[..=refused.or(late)?], period, allowed);
    };
    Some(Verdict {
        stamps: *stamps,
        cause: LateCause::Receive,
        place: Some(place),
        stages: spans(cycles, at, period),
        usual: usual(&cycles[..at], period),
        answer_us: None,
        usual_answer_us: usual_answer_us(cycles, place),
    })
}

/// Returns the stages of a cycle, with the one before it at hand.
///
/// # Panics
/// If there is no such cycle.
pub fn spans(cycles: &[Stamps], at: usize, period: Nanos) -> StageSpans {
    let stamps = &cycles[at];
    let free = previous(cycles, at).map_or(stamps.due, |before| stamps.due.max(before.ended));
    let micros = |span: Nanos| span.0 as f64 * 1e-3;
    let computing = stamps.controlled.since(stamps.received).plus(stamps.ended.since(stamps.sent));
    StageSpans {
        wake_us: micros(stamps.woke.since(free)),
        receive_us: micros(stamps.received.since(stamps.woke)),
        control_us: micros(computing),
        send_us: micros(stamps.sent.since(stamps.controlled)),
        slack_us: micros(period) - micros(stamps.used()),
    }
}

/// Returns the cycle before one, if it is there.
fn previous(cycles: &[Stamps], at: usize) -> Option<&Stamps> {
    let before = cycles.get(at.checked_sub(1)?)?;
    (before.tick + 1 == cycles[at].tick).then_some(before)
}

/// Returns the place of the cycle before one that began late since that one had not ended.
fn backlog_of(cycles: &[Stamps], at: usize) -> Option<usize> {
    let backlog = previous(cycles, at)?.ended.since(cycles[at].due);
    let late = cycles[at].woke.since(cycles[at].due);
    (backlog.0 > 0 && 2 * backlog.0 >= late.0 && 2 * late.0 >= cycles[at].used().0).then(|| at - 1)
}

/// Returns the median of each stage over the cycles that were not late, or over all if all were.
fn usual(cycles: &[Stamps], period: Nanos) -> StageSpans {
    let of = |wanted: fn(&Stamps) -> bool| -> Vec<StageSpans> {
        let chosen = (0..cycles.len()).filter(|at| wanted(&cycles[*at]));
        chosen.map(|at| spans(cycles, at, period)).collect()
    };
    let mut rows = of(|stamps| !stamps.late);
    if rows.is_empty() {
        rows = of(|_| true);
    }
    let middle = |stage: fn(&StageSpans) -> f64| median(rows.iter().map(stage).collect());
    let of = |stage| middle(stage).unwrap_or(0.0);
    StageSpans {
        wake_us: of(|row| row.wake_us),
        receive_us: of(|row| row.receive_us),
        control_us: of(|row| row.control_us),
        send_us: of(|row| row.send_us),
        slack_us: of(|row| row.slack_us),
    }
}

fn usual_answer_us(cycles: &[Stamps], place: usize) -> Option<f64> {
    let answers = cycles.iter().map(|stamps| stamps.answer_ns[place]);
    median(answers.filter(|ns| *ns > 0).map(|ns| f64::from(ns) * 1e-3).collect())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Returns the cause that the stages tell.
fn longest(stages: &StageSpans, usual: &StageSpans) -> LateCause {
    let causes = [LateCause::WakeUp, LateCause::Receive, LateCause::Computation, LateCause::Send];
    let spans = causes.into_iter().zip(stages.named()).zip(usual.named());
    let rows: Vec<(LateCause, f64, f64)> = spans
        .map(|((cause, (_, span_us)), (_, usual_us))| (cause, span_us, span_us - usual_us))
        .collect();
    let most = |of: fn(&(LateCause, f64, f64)) -> f64| {
        rows.iter()
            .copied()
            .fold(rows[0], |best, row| if of(&row) > of(&best) { row } else { best })
    };
    let grown = most(|row| row.2);
    if grown.2 > GROWN_SHARE * stages.used_us() { grown.0 } else { most(|row| row.1).0 }
}

/// Returns the place with the latest of the late answers; `None` if all that answer were late: then it was the bus.
fn latest(stamps: &Stamps) -> Option<usize> {
    let is_late = |place: &usize| stamps.late_answers & (1 << place) != 0;
    let answered = (0..PLACES_MAX).filter(|place| stamps.answer_ns[*place] > 0);
    let n_answered = answered.clone().count();
    let late: Vec<usize> = answered.filter(is_late).collect();
    if late.len() > 1 && late.len() == n_answered {
        return None;
    }
    late.into_iter().max_by_key(|place| stamps.answer_ns[*place])
}

/// Returns the place whose message took most of the time of receiving; `None` if no message took most of it.
fn waited_for(stamps: &Stamps) -> Option<usize> {
    let receiving = stamps.received.since(stamps.woke);
    stamps
        .waited_for
        .filter(|_| 2 * u64::from(stamps.waited_ns) > receiving.0)
        .map(usize::from)
        .filter(|place| *place < PLACES_MAX)
}

/// Returns whether a place that has answered before does not any more.
fn is_silent(cycles: &[Stamps], place: usize) -> bool {
    let since = cycles.iter().rev().position(|stamps| stamps.answer_ns[place] > 0);
    since.is_some_and(|since| since >= SILENT_CYCLES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rt::Interruptions;

    const PERIOD: Nanos = Nanos::from_micros(1000);
    const ALLOWED: Nanos = Nanos::from_micros(900);

    /// Cycles with stages of 20, 30, 200 and 50 us, of two places that answer after 300 and 400 us.
    fn good(n: u64) -> Vec<Stamps> {
        (0..n).map(|tick| cycle(tick, [20, 30, 200, 50])).collect()
    }

    fn cycle(tick: u64, stages_us: [u32; 4]) -> Stamps {
        let due = Nanos((tick + 1) * PERIOD.0);
        let mut at = due;
        let [woke, received, controlled, sent] = stages_us.map(|span_us| {
            at = at.plus(Nanos::from_micros(span_us));
            at
        });
        let mut answer_ns = [0; PLACES_MAX];
        answer_ns[..2].copy_from_slice(&[300_000, 400_000]);
        let late = sent.since(due) > ALLOWED;
        let stamps = Stamps { tick, due, woke, received, controlled, sent, ..Stamps::default() };
        Stamps { ended: sent, answer_ns, late, ..stamps }
    }

    fn cause_of(cycles: &[Stamps]) -> (LateCause, Option<usize>) {
        let verdict = judge(cycles, PERIOD, ALLOWED).unwrap();
        (verdict.cause, verdict.place)
    }

    #[test]
    fn the_stage_that_has_grown_is_the_cause() {
        for (stages_us, cause) in [
            ([800, 30, 200, 50], LateCause::WakeUp),
            ([20, 800, 200, 50], LateCause::Receive),
            ([20, 30, 900, 50], LateCause::Computation),
            ([20, 30, 200, 700], LateCause::Send),
        ] {
            let mut cycles = good(20);
            cycles.push(cycle(20, stages_us));
            assert_eq!(cause_of(&cycles), (cause, None), "{stages_us:?}");
        }
        // The longest one is as long as always.
        let mut cycles: Vec<_> = (0..20).map(|tick| cycle(tick, [20, 30, 600, 40])).collect();
        cycles.push(cycle(20, [400, 30, 610, 40]));
        assert_eq!(cause_of(&cycles), (LateCause::WakeUp, None));
    }

    #[test]
    fn a_cycle_that_never_fits_has_its_longest_stage_to_blame() {
        let cycles: Vec<Stamps> = (0..20).map(|tick| cycle(tick, [20, 30, 870, 40])).collect();
        assert_eq!(cause_of(&cycles), (LateCause::Computation, None));
        assert_eq!(cause_of(&cycles[..1]), (LateCause::Computation, None));
        assert!(judge(&[], PERIOD, ALLOWED).is_none());
    }

    #[test]
    fn the_message_that_took_long_names_its_sender() {
        let mut cycles = good(20);
        let slow = cycle(20, [20, 800, 200, 50]);
        cycles.push(Stamps { waited_ns: 700_000, waited_for: Some(1), ..slow });
        assert_eq!(cause_of(&cycles), (LateCause::Receive, Some(1)));
        // Many short ones: it was the bus.
        cycles[20].waited_ns = 20_000;
        assert_eq!(cause_of(&cycles), (LateCause::Receive, None));
    }

    #[test]
    fn a_late_answer_names_its_sender_and_all_of_them_the_bus() {
        let mut cycles = good(20);
        let mut late = cycle(20, [20, 30, 200, 50]);
        (late.late, late.late_answers, late.answer_ns[1]) = (true, 0b10, 1_400_000);
        cycles.push(late);
        let verdict = judge(&cycles, PERIOD, ALLOWED).unwrap();
        assert_eq!((verdict.cause, verdict.place), (LateCause::Receive, Some(1)));
        assert_eq!((verdict.answer_us, verdict.usual_answer_us), (Some(1400.0), Some(400.0)));
        (cycles[20].late_answers, cycles[20].answer_ns[0]) = (0b11, 1_300_000);
        assert_eq!(cause_of(&cycles), (LateCause::Receive, None));
    }

    #[test]
    fn a_thread_that_lost_the_processor_is_not_blamed_for_its_computation() {
        let mut cycles = good(20);
        let interruptions = Interruptions { preemptions: 1, ..Interruptions::default() };
        cycles.push(Stamps { interruptions, ..cycle(20, [20, 30, 900, 50]) });
        assert_eq!(cause_of(&cycles), (LateCause::Preemption, None));
        cycles[20] = Stamps { interruptions, ..cycle(20, [900, 30, 200, 50]) };
        assert_eq!(cause_of(&cycles), (LateCause::WakeUp, None));
    }

    #[test]
    fn a_cycle_that_began_late_because_of_the_one_before_is_not_the_cause() {
        let mut cycles = good(20);
        cycles.push(cycle(20, [20, 30, 2450, 50]));
        // Due at 22 ms, it begins at 23.55.
        let mut next = cycle(21, [1550, 30, 200, 50]);
        (next.missed, next.late) = (1, true);
        cycles.push(next);
        let verdict = judge(&cycles, PERIOD, ALLOWED).unwrap();
        assert_eq!((verdict.stamps.tick, verdict.cause), (20, LateCause::Computation));
        // Had the host slept as long as well, it would be the host.
        cycles[21] = Stamps { missed: 3, late: true, ..cycle(21, [4000, 30, 200, 50]) };
        let verdict = judge(&cycles, PERIOD, ALLOWED).unwrap();
        assert_eq!((verdict.stamps.tick, verdict.cause), (21, LateCause::WakeUp));
        assert!((verdict.stages.wake_us - 2450.0).abs() < 1e-9, "{:?}", verdict.stages);
    }

    #[test]
    fn a_stop_is_explained_by_what_was_late_before_it_or_by_nothing() {
        let mut cycles = good(40);
        assert_eq!(judge_stop(&cycles, PERIOD, ALLOWED), None);
        for stamps in &mut cycles[35..] {
            stamps.answer_ns[1] = 0;
        }
        let verdict = judge_stop(&cycles, PERIOD, ALLOWED).unwrap();
        assert_eq!((verdict.cause, verdict.place), (LateCause::Receive, Some(1)));
        assert_eq!((verdict.answer_us, verdict.usual_answer_us), (None, Some(400.0)));
        cycles[38].refused = true;
        let verdict = judge_stop(&cycles, PERIOD, ALLOWED).unwrap();
        assert_eq!((verdict.stamps.tick, verdict.cause), (38, LateCause::Send));
        let mut slow = good(90);
        slow[30] = cycle(30, [20, 30, 2450, 50]);
        let verdict = judge_stop(&slow[..40], PERIOD, ALLOWED).unwrap();
        assert_eq!((verdict.stamps.tick, verdict.cause), (30, LateCause::Computation));
        // Too long ago to matter.
        assert_eq!(judge_stop(&slow, PERIOD, ALLOWED), None);
        assert_eq!(judge_stop(&[], PERIOD, ALLOWED), None);
    }
}

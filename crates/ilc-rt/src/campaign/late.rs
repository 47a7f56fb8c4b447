//! Lost deadlines of a running loop: judged, named, counted, and kept beside the library.
//!
//! For `running`, which passes the recorded cycles on, and `ending`, which has the rest of the recorder.

use std::collections::VecDeque;
use std::path::Path;

use crate::config::Cell;
use crate::library::IN_MEMORY;
use crate::record::{
    AnswerTimes, CycleRow, Event, FlightRecord, LateCase, LateCounts, LateCycle, StageFigures,
    StageSpans, StopCase, Verdict, judge, judge_stop, spans,
};
use crate::rt::{Nanos, Stamps};
use crate::servo::Timing;

/// Worst cycles that are kept.
const CASES_MAX: usize = 16;
/// Cycles that are kept as the context of the next late one.
const CONTEXT: usize = 64;
/// Time between two events, unless a cycle is worse than all before.
const EVENT_EVERY_S: f64 = 1.0;

/// The late cycles of a campaign.
pub(super) struct LateLog {
    /// Axis and node of each place.
    places: Vec<(Option<String>, u8)>,
    period: Nanos,
    late_share: f64,
    context: VecDeque<Stamps>,
    counts: LateCounts,
    /// Worst first.
    cases: Vec<LateCase>,
    /// Tick of the cycle that was judged last, which may be late in the next one as well.
    judged_tick: Option<u64>,
    /// Cycles between two events.
    event_every: u64,
    /// Tick of the last event.
    told_tick: Option<u64>,
    /// Late cycles since then.
    n_untold: u64,
}

/// The recorder of a loop that is over.
pub(super) struct Recorded {
    /// Its last cycles.
    pub(super) cycles: Vec<Stamps>,
    pub(super) timing: Timing,
}

impl LateLog {
    pub(super) fn new(cell: &Cell) -> Self {
        let axes = cell.axes.iter().map(|axis| (Some(axis.name.clone()), axis.node));
        let tool = cell.tcp_encoder.iter().map(|tool| (None, tool.node));
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
        let event_every = (EVENT_EVERY_S / cell.cycle_s()) as u64;
        Self {
            places: axes.chain(tool).collect(),
            period: Nanos::from_micros(cell.cell.cycle_us),
            late_share: cell.realtime.late_share,
            context: VecDeque::with_capacity(CONTEXT),
            counts: LateCounts::default(),
            cases: Vec::new(),
            judged_tick: None,
            event_every,
            told_tick: None,
            n_untold: 0,
        }
    }

    /// Takes a recorded cycle of a run; returns the event that tells it, if it is one to tell.
    pub(super) fn take(&mut self, stamps: Stamps, iteration: u32) -> Option<Event> {
        if self.context.len() == CONTEXT {
            self.context.pop_front();
        }
        self.context.push_back(stamps);
        if !stamps.late {
            return None;
        }
        self.counts.missed += u64::from(stamps.missed);
        let cycles = self.context.make_contiguous();
        let allowed = allowed(self.period, self.late_share);
        let verdict = judge(cycles, self.period, allowed)?;
        if self.judged_tick == Some(verdict.stamps.tick) {
            // The cycle after it had to begin late.
            if let Some(case) = self.case_of(verdict.stamps.tick) {
                case.cycle.missed += stamps.missed;
            }
            return None;
        }
        self.judged_tick = Some(verdict.stamps.tick);
        self.counts.add(verdict.cause);
        let before = rows(self.context.make_contiguous(), self.period);
        let cycle = LateCycle { missed: stamps.missed, ..self.named(&verdict) };
        self.n_untold += 1;
        let is_worst =
            self.cases.first().is_none_or(|worst| badness(&cycle) > badness(&worst.cycle));
        self.keep(LateCase { iteration, cycle: cycle.clone(), before });
        let is_due =
            self.told_tick.is_none_or(|told| stamps.tick.saturating_sub(told) >= self.event_every);
        (is_worst || is_due).then(|| {
            self.told_tick = Some(stamps.tick);
            Event::Late { iteration, count: std::mem::take(&mut self.n_untold), cycle }
        })
    }

    fn case_of(&mut self, tick: u64) -> Option<&mut LateCase> {
        self.cases.iter_mut().find(|case| case.cycle.tick == tick)
    }

    /// Keeps a case if it is among the worst.
    fn keep(&mut self, case: LateCase) {
        let place =
            self.cases.partition_point(|other| badness(&other.cycle) >= badness(&case.cycle));
        self.cases.insert(place, case);
        self.cases.truncate(CASES_MAX);
    }

    /// Returns the cause with the names of the cell.
    fn named(&self, verdict: &Verdict) -> LateCycle {
        let place = verdict.place.and_then(|place| self.places.get(place));
        let Verdict { stamps, .. } = verdict;
        LateCycle {
            tick: stamps.tick,
            cause: verdict.cause,
            axis: place.and_then(|(axis, _)| axis.clone()),
            node: place.map(|(_, node)| *node),
            missed: stamps.missed,
            allowed_us: allowed(self.period, self.late_share).0 as f64 * 1e-3,
            stages: verdict.stages,
            usual: verdict.usual,
            answer_us: verdict.answer_us,
            usual_answer_us: verdict.usual_answer_us,
            refused: stamps.refused,
            preemptions: stamps.interruptions.preemptions,
            minor_faults: stamps.interruptions.minor_faults,
            major_faults: stamps.interruptions.major_faults,
        }
    }

    /// Returns who was late before the stop, from the recorder of a loop that is over.
    pub(super) fn before_stop(&self, recorded: &Recorded) -> Option<LateCycle> {
        let cycles = until_stop(&recorded.cycles)?;
        let verdict = judge_stop(cycles, self.period, allowed(self.period, self.late_share))?;
        Some(self.named(&verdict))
    }

    /// Returns the record of the loop, which is over; `reason` is that of the fault that stopped it.
    pub(super) fn record(
        &self,
        cell: &Cell,
        campaign: &str,
        recorded: &Recorded,
        reason: Option<String>,
    ) -> FlightRecord {
        let Recorded { cycles, timing } = recorded;
        let answers =
            self.places.iter().zip(&timing.stages.answers).map(|((axis, node), times)| {
                let times = times.figures();
                AnswerTimes {
                    axis: axis.clone(),
                    node: *node,
                    count: times.count,
                    p50_us: times.p50,
                    p99_us: times.p99,
                    max_us: times.max,
                }
            });
        FlightRecord {
            cell: cell.cell.name.clone(),
            campaign: campaign.to_owned(),
            cycle_us: cell.cell.cycle_us,
            late_share: self.late_share,
            stages_us: StageFigures {
                wake: timing.wake_late.figures(),
                receive: timing.stages.receive.figures(),
                control: timing.stages.control.figures(),
                send: timing.stages.send.figures(),
            },
            answers: answers.collect(),
            late: self.counts,
            worst: self.cases.clone(),
            good: good(cycles, self.period),
            fault: reason.map(|reason| {
                let before = until_stop(cycles).unwrap_or_default();
                let first = before.len().saturating_sub(CONTEXT);
                let late = self.before_stop(recorded);
                StopCase { reason, late, before: rows(&before[first..], self.period) }
            }),
        }
    }
}

/// Writes a record beside the library; returns the file. One that cannot be written is logged: no run is lost.
pub(super) fn write(record: &FlightRecord, library: &Path) -> Option<String> {
    if library == Path::new(IN_MEMORY) {
        return None;
    }
    let path = FlightRecord::path(library, &record.cell);
    match record.write(&path) {
        Ok(()) => Some(path.display().to_string()),
        Err(error) => {
            tracing::warn!("{}: the flight record was not written: {error}", path.display());
            None
        }
    }
}

fn allowed(period: Nanos, late_share: f64) -> Nanos {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share")]
    Nanos((period.0 as f64 * late_share) as u64)
}

/// Returns the measure by which one late cycle is worse than another: the time that it or its answer took.
fn badness(cycle: &LateCycle) -> f64 {
    cycle.stages.used_us().max(cycle.answer_us.unwrap_or(0.0))
}

/// Returns the cycles up to the one in which a stop began.
fn until_stop(cycles: &[Stamps]) -> Option<&[Stamps]> {
    let at = cycles.iter().position(|stamps| stamps.stopped)?;
    Some(&cycles[..=at])
}

fn rows(cycles: &[Stamps], period: Nanos) -> Vec<CycleRow> {
    let row = |at: usize| CycleRow {
        tick: cycles[at].tick,
        stages: spans(cycles, at, period),
        missed: cycles[at].missed,
        late: cycles[at].late,
    };
    (0..cycles.len()).map(row).collect()
}

/// Returns the cycle in the middle of those that were not late, by the time they took.
fn good(cycles: &[Stamps], period: Nanos) -> Option<StageSpans> {
    let mut good: Vec<usize> = (0..cycles.len()).filter(|at| !cycles[*at].late).collect();
    good.sort_by_key(|at| cycles[*at].used());
    good.get(good.len() / 2).map(|at| spans(cycles, *at, period))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::LateCause;

    const CELL: &str = include_str!("../../../../examples/01_gantry.toml");

    fn log() -> LateLog {
        LateLog::new(&Cell::parse(CELL, "gantry.toml").unwrap())
    }

    /// A cycle that computes for a time.
    fn cycle(tick: u64, control_us: u32) -> Stamps {
        let period = Nanos::from_micros(2000);
        let due = Nanos((tick + 1) * period.0);
        let sent = due.plus(Nanos::from_micros(control_us));
        let stamps = Stamps { tick, due, woke: due, received: due, ..Stamps::default() };
        Stamps { controlled: sent, sent, ended: sent, late: control_us > 1800, ..stamps }
    }

    #[test]
    fn events_are_as_many_as_a_person_can_read_and_every_cycle_is_counted() {
        let mut log = log();
        let mut told = Vec::new();
        for tick in 0..2000 {
            // One in ten is late, the first ones worse and worse.
            let late_us = 1900 + u32::try_from(tick.min(30)).unwrap();
            let stamps = cycle(tick, if tick % 10 == 9 { late_us } else { 200 });
            told.extend(log.take(stamps, 0).map(|event| (tick, event)));
        }
        let ticks: Vec<u64> = told.iter().map(|(tick, _)| *tick).collect();
        assert_eq!(ticks, [9, 19, 29, 39, 539, 1039, 1539]);
        let counts: u64 = told
            .iter()
            .map(|(_, event)| match event {
                Event::Late { count, cycle, .. } => {
                    assert_eq!(cycle.cause, LateCause::Computation);
                    *count
                }
                _ => 0,
            })
            .sum();
        assert_eq!((counts, log.counts.computation, log.counts.all()), (154, 200, 200));
        assert_eq!(log.cases.len(), CASES_MAX);
        assert!(log.cases.is_sorted_by(|a, b| badness(&a.cycle) >= badness(&b.cycle)));
    }

    #[test]
    fn cycles_that_were_skipped_belong_to_the_cycle_that_took_so_long() {
        let mut log = log();
        for tick in 0..20 {
            log.take(cycle(tick, 200), 0);
        }
        assert!(log.take(cycle(20, 5000), 3).is_some());
        // Due at 44 ms, when the one before has 3 ms to go.
        let mut next = cycle(21, 3200);
        (next.woke, next.received) = (Nanos(47_000_000), Nanos(47_000_000));
        (next.missed, next.late) = (1, true);
        assert_eq!(log.take(next, 3), None);
        assert_eq!((log.counts.all(), log.counts.missed), (1, 1));
        let case = &log.cases[0];
        assert_eq!((case.iteration, case.cycle.tick, case.cycle.missed), (3, 20, 1));
        assert_eq!(case.before.last().unwrap().tick, 20);
    }
}

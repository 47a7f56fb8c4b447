//! The flight recorder tells who was late: delays of each kind, on a clock that a test sets.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use ilc_rt::config::Overrun;
use ilc_rt::record::{LateCause, Verdict, judge, judge_stop};
use ilc_rt::rt::{Clock, Interruptions, ManualClock, Nanos, Stamps};
use ilc_rt::servo::{PhaseName, StopReason, Timing, run_until};
use ilc_tests::rig::{Rig, node};
use ilc_tests::short;

const PERIOD: Nanos = Nanos::from_micros(2000);
const ALLOWED: Nanos = Nanos::from_micros(1800);
/// Readings of the clock in a tick from the one that ends the computation: controlled, sent, executed, ended.
const AFTER_CONTROL: u64 = 4;

/// A clock that stands still within a cycle, unless the computation is to take long.
#[derive(Default)]
struct Slowed {
    clock: ManualClock,
    /// Readings since the last sleep, and in the cycle before.
    n_readings: AtomicU64,
    n_before: AtomicU64,
    computing_ns: AtomicU64,
    /// Cycles until the computation takes long: the readings of one are counted first.
    n_cycles: AtomicU64,
    /// True if another thread has the processor meanwhile.
    is_preempted: AtomicBool,
}

impl Slowed {
    fn compute_for(&self, micros: u32) {
        self.computing_ns.store(u64::from(micros) * 1000, Ordering::Relaxed);
        self.n_cycles.store(3, Ordering::Relaxed);
    }
}

impl Clock for Slowed {
    fn now(&self) -> Nanos {
        let n_readings = self.n_readings.fetch_add(1, Ordering::Relaxed) + 1;
        let is_control = n_readings + AFTER_CONTROL == self.n_before.load(Ordering::Relaxed) + 1;
        if is_control && self.n_cycles.load(Ordering::Relaxed) == 1 {
            self.clock.advance(Nanos(self.computing_ns.swap(0, Ordering::Relaxed)));
            if self.is_preempted.swap(false, Ordering::Relaxed) {
                self.clock.preempt();
            }
        }
        self.clock.now()
    }

    fn sleep_until(&self, deadline: Nanos) {
        let n_cycles = self.n_cycles.load(Ordering::Relaxed);
        self.n_cycles.store(n_cycles.saturating_sub(1), Ordering::Relaxed);
        self.n_before.store(self.n_readings.swap(0, Ordering::Relaxed), Ordering::Relaxed);
        self.clock.sleep_until(deadline);
    }

    fn since_epoch(&self) -> Nanos {
        self.clock.since_epoch()
    }

    fn interruptions(&self) -> Interruptions {
        self.clock.interruptions()
    }
}

/// The loop of a gantry in the middle of a run, on its grid.
struct Bench {
    rig: Rig,
    clock: Arc<Slowed>,
    timing: Timing,
}

impl Bench {
    fn new() -> Self {
        Self::with(Overrun::KeepPhase)
    }

    fn with(overrun: Overrun) -> Self {
        let clock = Arc::new(Slowed::default());
        let mut cell = short("01_gantry.toml");
        cell.realtime.overrun = overrun;
        let rig = Rig::on_clock(&cell, 2);
        let rig = rig.with_recorder(Arc::clone(&clock) as Arc<dyn Clock>, 0.9);
        let mut bench = Self { rig, clock, timing: Timing::default() };
        while bench.rig.phase.0 != PhaseName::Running {
            bench.cycles(10);
        }
        bench.cycles(50);
        assert!(bench.rig.recorded.is_empty(), "{:?}", bench.rig.recorded);
        bench
    }

    /// Runs so many cycles of the grid.
    fn cycles(&mut self, n: u64) {
        let end = Nanos(self.clock.clock.now().0 + n * PERIOD.0 + 1);
        run_until(&mut self.rig.cycle, self.clock.as_ref(), &mut self.timing, end);
        let n_syncs = self.rig.tap.line().n_syncs();
        self.rig.read_mail(n_syncs);
    }

    /// Lets time pass while a frame of a node is taken, once.
    fn slow_frame_of(&self, number: u8, micros: u32) {
        let clock = Arc::clone(&self.clock);
        let mut left = Some(Nanos::from_micros(micros));
        self.rig.tap.line().distort(Box::new(move |_, frame, queue| {
            if frame.id() == 0x180 + u16::from(number)
                && let Some(span) = left.take()
            {
                clock.clock.advance(span);
            }
            queue.push_back(frame);
        }));
    }

    /// Holds the next answers of some nodes back until the next SYNC.
    fn hold_answers_of(&self, numbers: &'static [u8]) {
        let (mut first, mut held) = (None, VecDeque::new());
        self.rig.tap.line().distort(Box::new(move |n_syncs, frame, queue| {
            let first = *first.get_or_insert(n_syncs);
            let is_theirs = numbers.iter().any(|number| frame.id() & 0x7F == u16::from(*number));
            if is_theirs && n_syncs == first {
                held.push_back(frame);
                return;
            }
            if n_syncs > first {
                queue.extend(held.drain(..));
            }
            queue.push_back(frame);
        }));
    }

    /// Returns the verdict on the first cycle that was late.
    fn verdict(&self) -> Verdict {
        let at = self.rig.recorded.iter().position(|stamps| stamps.late).unwrap();
        judge(&self.rig.recorded[..=at], PERIOD, ALLOWED).unwrap()
    }

    fn n_late(&self) -> usize {
        self.rig.recorded.iter().filter(|stamps| stamps.late).count()
    }
}

#[test]
fn a_late_wake_up_is_the_host() {
    let mut bench = Bench::new();
    bench.clock.clock.oversleep(Nanos::from_micros(1900));
    bench.cycles(20);
    let verdict = bench.verdict();
    assert_eq!((verdict.cause, verdict.place), (LateCause::WakeUp, None));
    assert!((verdict.stages.wake_us - 1900.0).abs() < 1.0, "{:?}", verdict.stages);
    assert_eq!(bench.n_late(), 1);
    assert_eq!(bench.rig.reason, None);
}

#[test]
fn cycles_that_were_slept_through_are_overruns_of_the_host() {
    let mut bench = Bench::new();
    bench.clock.clock.oversleep(Nanos::from_micros(7100));
    bench.cycles(20);
    let verdict = bench.verdict();
    assert_eq!((verdict.cause, verdict.stamps.missed), (LateCause::WakeUp, 3));
    // The grid is kept: later cycles are on time.
    assert_eq!(bench.n_late(), 1);
    bench.rig.tick_until(|rig| !rig.ended.is_empty());
    assert_eq!(bench.rig.ended[0], (0, 3));
}

#[test]
fn missed_cycles_are_made_up_for_at_once_where_the_cell_asks_for_it() {
    let mut kept = Bench::new();
    let mut caught_up = Bench::with(Overrun::CatchUp);
    for bench in [&mut kept, &mut caught_up] {
        bench.cycles(20);
        bench.clock.clock.oversleep(Nanos::from_micros(7100));
        bench.cycles(30);
    }
    let n_syncs = |bench: &Bench| bench.rig.tap.line().n_syncs();
    assert_eq!(n_syncs(&caught_up), n_syncs(&kept) + 3);
    // Both counted the same cycles, once each, and learn nothing from the run.
    for bench in [&mut kept, &mut caught_up] {
        bench.rig.tick_until(|rig| !rig.ended.is_empty());
        assert_eq!((bench.rig.ended[0], bench.rig.reason), ((0, 3), None));
    }
}

#[test]
fn more_missed_cycles_than_can_be_made_up_for_are_skipped() {
    let mut bench = Bench::with(Overrun::CatchUp);
    let before = bench.rig.tap.line().n_syncs();
    bench.clock.clock.oversleep(Nanos::from_micros(2000 * 11 + 100));
    bench.cycles(30);
    assert_eq!(bench.rig.tap.line().n_syncs() - before, 30 - 11);
    assert_eq!(bench.rig.reason, None);
}

#[test]
fn the_first_missed_cycle_stops_where_the_cell_asks_for_it() {
    let mut bench = Bench::with(Overrun::Stop);
    bench.clock.clock.oversleep(Nanos::from_micros(2100));
    bench.cycles(20);
    assert!(
        matches!(bench.rig.reason, Some(StopReason::Overrun { cycles: 1 })),
        "{:?}",
        bench.rig.reason
    );
}

#[test]
fn a_message_that_takes_long_names_its_node() {
    for number in [1, 2] {
        let mut bench = Bench::new();
        bench.slow_frame_of(number, 1850);
        bench.cycles(20);
        let verdict = bench.verdict();
        let place = Some(usize::from(number) - 1);
        assert_eq!((verdict.cause, verdict.place), (LateCause::Receive, place));
        assert!((verdict.stages.receive_us - 1850.0).abs() < 1.0, "{:?}", verdict.stages);
        assert_eq!(bench.n_late(), 1);
    }
}

#[test]
fn an_answer_after_the_next_sync_names_its_node_and_all_of_them_the_bus() {
    let cases: [(&'static [u8], Option<usize>); 4] =
        [(&[1], Some(0)), (&[2], Some(1)), (&[10], Some(2)), (&[1, 2, 10], None)];
    for (numbers, place) in cases {
        let mut bench = Bench::new();
        bench.hold_answers_of(numbers);
        bench.cycles(30);
        let verdict = bench.verdict();
        assert_eq!((verdict.cause, verdict.place), (LateCause::Receive, place), "{numbers:?}");
        if place.is_some() {
            // On this clock an answer is usually taken a cycle after its SYNC.
            assert_eq!(verdict.answer_us, Some(4000.0), "{numbers:?}");
            assert_eq!(verdict.usual_answer_us, Some(2000.0), "{numbers:?}");
        }
        assert_eq!(bench.n_late(), 1, "{numbers:?}");
        assert_eq!(bench.rig.reason, None, "{numbers:?}");
    }
}

#[test]
fn an_answer_that_is_lost_was_not_late() {
    let mut bench = Bench::new();
    let mut lost = false;
    bench.rig.tap.line().distort(Box::new(move |_, frame, queue| {
        if frame.id() == 0x181 && !lost {
            lost = true;
            return;
        }
        queue.push_back(frame);
    }));
    bench.cycles(40);
    assert!(bench.rig.recorded.is_empty(), "{:?}", bench.rig.recorded);
}

#[test]
fn a_computation_that_takes_long_is_the_cause_of_the_cycles_it_costs() {
    let mut bench = Bench::new();
    bench.clock.compute_for(5000);
    bench.cycles(20);
    let verdict = bench.verdict();
    assert_eq!((verdict.cause, verdict.place), (LateCause::Computation, None));
    assert!((verdict.stages.control_us - 5000.0).abs() < 1.0, "{:?}", verdict.stages);
    // The next one began late, and skipped one, because of it.
    assert_eq!(bench.n_late(), 2);
    let last = bench.rig.recorded.iter().rposition(|stamps| stamps.late).unwrap();
    let next = judge(&bench.rig.recorded[..=last], PERIOD, ALLOWED).unwrap();
    assert_eq!((next.stamps.tick, next.cause), (verdict.stamps.tick, LateCause::Computation));
    assert_eq!(bench.rig.recorded[last].missed, 1);
}

#[test]
fn a_thread_that_loses_the_processor_is_told_from_a_slow_computation() {
    let mut bench = Bench::new();
    bench.clock.is_preempted.store(true, Ordering::Relaxed);
    bench.clock.compute_for(1900);
    bench.cycles(20);
    assert_eq!(bench.verdict().cause, LateCause::Preemption);
}

#[test]
fn what_interrupted_the_thread_between_two_measurements_is_not_counted() {
    let mut bench = Bench::new();
    bench.cycles(5);
    bench.clock.clock.preempt();
    bench.cycles(5);
    assert_eq!(bench.timing.stages.interruptions, Interruptions::default());
}

#[test]
fn a_bus_that_blocks_is_told_from_a_slow_computation() {
    let mut bench = Bench::new();
    let clock = Arc::clone(&bench.clock);
    bench
        .rig
        .tap
        .line()
        .meddle_after(5, Box::new(move |_, _| clock.clock.advance(Nanos::from_micros(1850))));
    bench.cycles(20);
    let verdict = bench.verdict();
    assert_eq!((verdict.cause, verdict.place), (LateCause::Send, None));
    assert!((verdict.stages.send_us - 1850.0).abs() < 1.0, "{:?}", verdict.stages);
}

#[test]
fn a_stop_keeps_its_cycles_and_is_explained() {
    let mut bench = Bench::new();
    bench.rig.tap.line().meddle(|machine, _| assert!(machine.mute(node(2))));
    bench.cycles(60);
    assert!(matches!(bench.rig.reason, Some(StopReason::SilentAxis { axis: 1, .. })));
    let stopped = |stamps: &Stamps| stamps.stopped;
    assert_eq!(bench.rig.recorded.iter().filter(|stamps| stopped(stamps)).count(), 1);
    let cycles = bench.rig.cycle.flight().cycles();
    let at = cycles.iter().position(stopped).unwrap();
    let verdict = judge_stop(&cycles[..=at], PERIOD, ALLOWED).unwrap();
    assert_eq!((verdict.cause, verdict.place), (LateCause::Receive, Some(1)));

    let mut bench = Bench::new();
    bench.rig.tap.line().refuse(1000);
    bench.cycles(60);
    assert!(matches!(bench.rig.reason, Some(StopReason::Congested { .. })));
    let cycles = bench.rig.cycle.flight().cycles();
    let at = cycles.iter().position(stopped).unwrap();
    let verdict = judge_stop(&cycles[..=at], PERIOD, ALLOWED).unwrap();
    assert_eq!(verdict.cause, LateCause::Send);

    // Asked for, and on time.
    let mut bench = Bench::new();
    bench.rig.ask_to_stop(15);
    bench.cycles(60);
    assert!(bench.rig.recorded.is_empty());
}

#[test]
fn times_of_the_stages_are_those_of_the_clock() {
    let mut bench = Bench::new();
    bench.slow_frame_of(2, 100);
    bench.cycles(5);
    bench.clock.compute_for(300);
    bench.cycles(5);
    let stages = &bench.timing.stages;
    let max = [&stages.receive, &stages.control, &stages.send].map(|times| times.figures().max);
    for (found, expected) in max.into_iter().zip([100.0, 300.0, 0.0]) {
        assert!((found - expected).abs() < 0.02 * expected + 0.01, "{max:?}");
    }
    assert!((bench.timing.stages.answers[1].figures().p50 - 2000.0).abs() < 20.0);
    assert_eq!(bench.timing.stages.answers[5].figures().count, 0);
}

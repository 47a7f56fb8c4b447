//! The flight recorder of the loop: the time stamps of the stages of its last cycles, in a ring.
//!
//! Written by the loop in every tick, without locks and without allocation; read by the campaign when a
//! deadline was lost, or when the loop is over. Nothing here judges: `record::late` does.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::Arc;
use std::time::Duration;

use super::clock::{Clock, Interruptions, Nanos};

/// Number of cycles in the ring.
pub const CYCLES_KEPT: usize = 4096;
/// Cycles up to a late one that are reported with it.
pub const CYCLES_TOLD: u64 = 16;
/// Largest number of senders of answers: the axes, and the tool.
pub const PLACES_MAX: usize = 13;

/// Cycles that are still recorded after a stop has begun: the ring keeps what was before.
const CYCLES_AFTER: u64 = 1024;
/// Exchanges whose times are kept, for the answers that are late.
const EXCHANGES: usize = 64;

/// The stages of a cycle in time stamps of the loop's clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamps {
    /// Number of the tick since the loop began.
    pub tick: u64,
    /// Time on the grid at which it was due.
    pub due: Nanos,
    /// It began.
    pub woke: Nanos,
    /// All messages that had arrived were taken.
    pub received: Nanos,
    /// All commands were computed.
    pub controlled: Nanos,
    /// The exchange was passed to the bus.
    pub sent: Nanos,
    /// It was over.
    pub ended: Nanos,
    /// Cycles that were skipped before it.
    pub missed: u32,
    /// Time from the exchange to its answer, ns, of each place: the longest one that arrived in this tick, 0 if none
    /// did.
    pub answer_ns: [u32; PLACES_MAX],
    /// Places, one bit each, whose answer to an earlier exchange was late, and came in this tick.
    pub late_answers: u16,
    /// Longest time that taking one message took, ns.
    pub waited_ns: u32,
    /// Place that sent this message; none for other messages.
    pub waited_for: Option<u8>,
    /// True if the bus did not take every frame.
    pub refused: bool,
    /// Interruptions of the thread since the tick before.
    pub interruptions: Interruptions,
    /// True if this cycle lost its deadline.
    pub late: bool,
    /// True if the loop stopped for a fault in this cycle.
    pub stopped: bool,
}

impl Stamps {
    /// Returns the time from its place on the grid to its end.
    pub const fn used(&self) -> Nanos {
        self.ended.since(self.due)
    }
}

/// The recorder; without a clock it records nothing.
pub struct Flight {
    clock: Option<Arc<dyn Clock>>,
    /// Time after which a cycle is late.
    late_after: Nanos,
    ring: Box<[Stamps]>,
    /// Ticks recorded.
    n_ticks: u64,
    /// Ticks told, or too old to be.
    told: u64,
    /// The cycle that is running.
    now: Stamps,
    /// Time at which the last message was taken, and how long that took, ns.
    taken: Nanos,
    taking_ns: u32,
    /// True if no message of this tick took longer.
    is_longest: bool,
    /// Time at which the system received that message, or at which it was taken.
    arrived: Nanos,
    /// Times of the last exchanges.
    exchanges: [Nanos; EXCHANGES],
    n_exchanges: u64,
    /// Places with an answer in this tick that was behind.
    behind: u16,
    before: Interruptions,
    /// Tick in which a stop began.
    stopped_at: Option<u64>,
}

impl std::fmt::Debug for Flight {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Flight").field("n_ticks", &self.n_ticks).finish_non_exhaustive()
    }
}

impl Default for Flight {
    fn default() -> Self {
        Self {
            clock: None,
            late_after: Nanos(u64::MAX),
            ring: Box::default(),
            n_ticks: 0,
            told: 0,
            now: Stamps::default(),
            taken: Nanos(0),
            taking_ns: 0,
            is_longest: false,
            arrived: Nanos(0),
            exchanges: [Nanos(0); EXCHANGES],
            n_exchanges: 0,
            behind: 0,
            before: Interruptions::default(),
            stopped_at: None,
        }
    }
}

impl Flight {
    /// Creates the recorder of a loop whose cycles are late after a share of their period. Cold.
    #[expect(clippy::disallowed_macros, reason = "cold: set-up")]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below a period")]
    pub fn new(clock: Arc<dyn Clock>, period: Nanos, late_share: f64) -> Self {
        // Other than zero, so that every page is touched now and not in a tick.
        let blank = Stamps { tick: u64::MAX, ..Stamps::default() };
        Self {
            clock: Some(clock),
            late_after: Nanos((period.0 as f64 * late_share) as u64),
            ring: vec![blank; CYCLES_KEPT].into_boxed_slice(),
            ..Self::default()
        }
    }

    /// Counts interruptions from now on, without those of the thread before its first tick or between two
    /// measurements.
    pub fn start(&mut self) {
        if let Some(clock) = &self.clock {
            self.before = clock.interruptions();
        }
    }

    /// Begins a cycle that was due at a time and began at another.
    pub fn begin(&mut self, due: Nanos, woke: Nanos, missed: u32) {
        if self.clock.is_none() {
            return;
        }
        self.now = Stamps { tick: self.n_ticks, due, woke, missed, ..Stamps::default() };
        self.taken = woke;
        self.behind = 0;
    }

    /// Records that a message was taken, with the time since the epoch at which the system received it, if it
    /// tells.
    pub fn message(&mut self, arrival: Option<Duration>) {
        let Some(clock) = &self.clock else { return };
        let now = clock.now();
        self.taking_ns = saturate(now.since(self.taken));
        self.taken = now;
        self.arrived = match arrival {
            Some(arrival) => {
                let age = clock.since_epoch().since(Nanos::from(arrival));
                Nanos(now.0.saturating_sub(age.0))
            }
            None => now,
        };
        self.wait();
    }

    /// Records that the message was an answer of a place, to the exchange `behind` exchanges ago: 1 is the newest.
    pub fn answered(&mut self, place: usize, behind: u64) {
        if self.clock.is_none() || place >= PLACES_MAX {
            return;
        }
        if self.is_longest {
            self.now.waited_for = u8::try_from(place).ok();
        }
        if behind == 0 || behind > self.n_exchanges || behind >= EXCHANGES as u64 {
            return;
        }
        let asked = self.exchanges[index(self.n_exchanges - behind, EXCHANGES)];
        let span_ns = saturate(self.arrived.since(asked)).max(1);
        let longest_ns = &mut self.now.answer_ns[place];
        *longest_ns = span_ns.max(*longest_ns);
        if behind > 1 {
            self.behind |= 1 << place;
        }
    }

    /// Ends the first stage; `is_complete` tells of a place whether all its answers have arrived. One that lags
    /// on may have lost an answer, so that none is late.
    pub fn received(&mut self, is_complete: impl Fn(usize) -> bool) {
        let Some(clock) = &self.clock else { return };
        let now = clock.now();
        self.taking_ns = saturate(now.since(self.taken));
        self.now.received = now;
        self.wait();
        for place in 0..PLACES_MAX {
            if self.behind & (1 << place) != 0 && is_complete(place) {
                self.now.late_answers |= 1 << place;
            }
        }
    }

    fn wait(&mut self) {
        self.is_longest = self.taking_ns > self.now.waited_ns;
        if self.is_longest {
            (self.now.waited_ns, self.now.waited_for) = (self.taking_ns, None);
        }
    }

    /// Ends the computation.
    pub fn controlled(&mut self) {
        if let Some(clock) = &self.clock {
            self.now.controlled = clock.now();
        }
    }

    /// Ends the exchange.
    pub fn sent(&mut self, refused: bool) {
        let Some(clock) = &self.clock else { return };
        let now = clock.now();
        (self.now.sent, self.now.refused) = (now, refused);
        self.exchanges[index(self.n_exchanges, EXCHANGES)] = now;
        self.n_exchanges += 1;
    }

    /// Records that the axes are being stopped for a fault.
    pub fn stop(&mut self) {
        if self.clock.is_some() {
            self.now.stopped = true;
            self.stopped_at = self.stopped_at.or(Some(self.n_ticks));
        }
    }

    /// Ends the cycle and returns it, with its verdict: late if it used more than its share, skipped others, or if an
    /// answer was late that was not in the tick before. `None` without a clock.
    pub fn end(&mut self) -> Option<Stamps> {
        let clock = self.clock.as_ref()?;
        let now = &mut self.now;
        now.ended = clock.now();
        // A tick without a stage, e.g. one that holds still.
        now.received = now.received.max(now.woke);
        now.controlled = now.controlled.max(now.received);
        now.sent = now.sent.max(now.controlled);
        let interruptions = clock.interruptions();
        now.interruptions = interruptions.since(self.before);
        self.before = interruptions;
        let earlier = match self.n_ticks.checked_sub(1) {
            Some(tick) => self.ring[index(tick, CYCLES_KEPT)].late_answers,
            None => 0,
        };
        now.late =
            now.missed > 0 || now.used() > self.late_after || now.late_answers & !earlier != 0;
        let ended = *now;
        if self.stopped_at.is_none_or(|at| self.n_ticks <= at + CYCLES_AFTER) {
            self.ring[index(self.n_ticks, CYCLES_KEPT)] = ended;
            self.n_ticks += 1;
        }
        Some(ended)
    }

    /// Returns the newest cycles that were not told yet, oldest first; they then count as told.
    pub fn untold(&mut self) -> impl Iterator<Item = Stamps> + '_ {
        let first = self.told.max(self.n_ticks.saturating_sub(CYCLES_TOLD));
        self.told = self.n_ticks;
        let ring = &self.ring;
        (first..self.n_ticks).map(|tick| ring[index(tick, CYCLES_KEPT)])
    }

    /// Returns the recorded cycles, oldest first; fewer than were made once the ring is full. Cold.
    pub fn cycles(&self) -> Vec<Stamps> {
        let first = self.n_ticks.saturating_sub(self.ring.len() as u64);
        (first..self.n_ticks).map(|tick| self.ring[index(tick, CYCLES_KEPT)]).collect()
    }
}

fn saturate(span: Nanos) -> u32 {
    u32::try_from(span.0).unwrap_or(u32::MAX)
}

#[expect(clippy::cast_possible_truncation, reason = "below the size")]
fn index(count: u64, size: usize) -> usize {
    (count % size as u64) as usize
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "tests are cold")]
mod tests {
    use super::super::clock::ManualClock;
    use super::*;

    const PERIOD: Nanos = Nanos::from_micros(1000);

    struct Loop {
        clock: Arc<ManualClock>,
        flight: Flight,
        due: Nanos,
    }

    impl Loop {
        fn new() -> Self {
            let clock = Arc::new(ManualClock::default());
            let flight = Flight::new(Arc::clone(&clock) as Arc<dyn Clock>, PERIOD, 0.9);
            Self { clock, flight, due: PERIOD }
        }

        fn wait(&self, micros: u32) {
            self.clock.advance(Nanos::from_micros(micros));
        }

        /// Runs a tick whose places are answered so many exchanges behind.
        fn tick(&mut self, answers: &[(usize, u64)]) -> Stamps {
            self.clock.sleep_until(self.due);
            self.flight.begin(self.due, self.clock.now(), 0);
            for (place, behind) in answers {
                self.wait(10);
                self.flight.message(None);
                self.flight.answered(*place, *behind);
            }
            self.flight.received(|_| true);
            self.wait(30);
            self.flight.controlled();
            self.wait(5);
            self.flight.sent(false);
            self.due = self.due.plus(PERIOD);
            self.flight.end().unwrap()
        }
    }

    #[test]
    fn every_stage_has_its_stamp() {
        let mut run = Loop::new();
        run.tick(&[]);
        let stamps = run.tick(&[(0, 1), (3, 1)]);
        let micros = |time: Nanos| time.since(stamps.due).0 / 1000;
        assert_eq!(micros(stamps.woke), 0);
        assert_eq!(micros(stamps.received), 20);
        assert_eq!(micros(stamps.controlled), 50);
        assert_eq!(micros(stamps.sent), 55);
        // The exchange of the tick before was 35 us after its time on the grid.
        assert_eq!((stamps.answer_ns[0], stamps.answer_ns[3]), (975_000, 985_000));
        assert_eq!((stamps.waited_ns, stamps.waited_for), (10_000, Some(0)));
        assert!(!stamps.late);
    }

    #[test]
    fn the_system_tells_when_a_frame_arrived() {
        let mut run = Loop::new();
        run.tick(&[]);
        run.clock.sleep_until(run.due);
        run.flight.begin(run.due, run.clock.now(), 0);
        // 300 us after the exchange, long before the loop took it.
        run.flight.message(Some(Duration::from_micros(1035 + 300)));
        run.flight.answered(1, 1);
        run.flight.received(|_| true);
        assert_eq!(run.flight.end().unwrap().answer_ns[1], 300_000);
    }

    #[test]
    fn a_late_answer_is_one_that_comes_after_the_next_exchange_and_is_told_once() {
        let mut run = Loop::new();
        for _ in 0..3 {
            run.tick(&[(0, 1), (1, 1)]);
        }
        assert!(!run.tick(&[(0, 1)]).late);
        let caught_up = run.tick(&[(0, 1), (1, 2), (1, 1)]);
        assert_eq!((caught_up.late, caught_up.late_answers), (true, 0b10));
        assert_eq!(caught_up.answer_ns[1], 1_965_000);
        assert!(!run.tick(&[(0, 1), (1, 2), (1, 1)]).late);
    }

    #[test]
    fn the_ring_keeps_the_newest_cycles_and_those_before_a_stop() {
        let mut run = Loop::new();
        for _ in 0..CYCLES_KEPT + 100 {
            run.tick(&[]);
        }
        assert_eq!(run.flight.untold().count() as u64, CYCLES_TOLD);
        assert_eq!(run.flight.untold().count(), 0);
        let cycles = run.flight.cycles();
        assert_eq!((cycles.len(), cycles[0].tick), (CYCLES_KEPT, 100));
        run.flight.stop();
        for _ in 0..2 * CYCLES_KEPT {
            run.tick(&[]);
        }
        let cycles = run.flight.cycles();
        assert_eq!(cycles.last().unwrap().tick, CYCLES_KEPT as u64 + 100 + CYCLES_AFTER);
        assert_eq!(cycles.len(), CYCLES_KEPT);
    }

    #[test]
    fn without_a_clock_nothing_is_recorded() {
        let mut flight = Flight::default();
        flight.begin(PERIOD, PERIOD, 0);
        flight.message(None);
        flight.answered(0, 1);
        flight.received(|_| true);
        flight.controlled();
        flight.sent(true);
        flight.stop();
        assert_eq!(flight.end(), None);
        assert!(flight.cycles().is_empty() && flight.untold().count() == 0);
    }
}

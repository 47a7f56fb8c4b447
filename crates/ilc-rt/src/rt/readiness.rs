//! Settings that this machine grants the loop's thread, and how punctually it wakes it, tried before anything moves.
//!
//! `campaign` asks before bring-up, `ilc-rt latency` before it measures.

use super::clock::{Clock, MonotonicClock, Nanos};
use super::thread::{RtReport, RtRequest, enter};

/// Time between the wake-ups that are tried.
const EVERY: Nanos = Nanos::from_micros(200);
/// Shortest and longest measured time before a tick at which the loop's thread stops sleeping.
const SPIN_US: (u32, u32) = (20, 100);
/// The longest as a part of the cycle: a thread that never sleeps is held back by the kernel for 50 ms of a second
/// in favour of others on its processor.
const AWAKE: (u64, u64) = (3, 5);
/// The longest with a processor that no other thread of the program uses, and as a part of the cycle.
const OWN_SPIN: (Nanos, u64) = (Nanos::from_micros(300), 3);

/// Choice of the time of busy-waiting: so many wake-ups are tried, and it is longer than all but one of them are late.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Trial {
    wake_ups: usize,
    longest: Nanos,
}

impl Trial {
    fn new(request: RtRequest, cycle: Nanos) -> Self {
        let (part, whole) = AWAKE;
        let shared = Nanos(Nanos::from_micros(SPIN_US.1).0.min(cycle.0 * part / whole));
        if request.cpu.is_none() {
            return Self { wake_ups: 100, longest: shared };
        }
        let (most, part) = OWN_SPIN;
        let longest = most.0.min(cycle.0 / part).max(shared.0);
        Self { wake_ups: 1000, longest: Nanos(longest) }
    }

    /// Measures, within the bounds.
    fn measure(self) -> Nanos {
        let clock = MonotonicClock::new(Nanos(0));
        let mut late_ns = vec![0_u64; self.wake_ups];
        for late_ns in &mut late_ns {
            let due = clock.now().plus(EVERY);
            clock.sleep_until(due);
            *late_ns = clock.now().since(due).0;
        }
        late_ns.sort_unstable();
        let least = Nanos::from_micros(SPIN_US.0).0.min(self.longest.0);
        Nanos(late_ns[self.wake_ups - 2].clamp(least, self.longest.0))
    }
}

/// Settings that a thread was granted, and the busy-waiting that it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Readiness {
    /// Granted settings.
    pub report: RtReport,
    /// Time before a tick at which to stop sleeping and busy-wait.
    pub spin: Nanos,
}

impl Readiness {
    /// Tries a request for a loop of a cycle on a thread that ends at once; `spin_us` in place of a measured time of
    /// busy-waiting.
    pub fn probe(request: RtRequest, cycle: Nanos, spin_us: Option<u32>) -> Self {
        let tried = std::thread::spawn(move || {
            let report = enter(request);
            let spin =
                spin_us.map_or_else(|| Trial::new(request, cycle).measure(), Nanos::from_micros);
            Self { report, spin }
        });
        tried.join().unwrap_or_else(|_| Self {
            report: RtReport::refusing(request, "the thread that tried it has died"),
            spin: Nanos::from_micros(SPIN_US.1),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::thread::Refused;
    use super::*;

    const CYCLE: Nanos = Nanos::from_micros(1000);

    #[test]
    fn busy_waiting_is_measured_within_bounds_unless_it_is_given() {
        let request = RtRequest { lock_memory: false, ..RtRequest::default() };
        let measured = Readiness::probe(request, CYCLE, None).spin;
        assert!((20_000..=100_000).contains(&measured.0), "{measured:?}");
        assert_eq!(Readiness::probe(request, CYCLE, Some(0)).spin, Nanos(0));
        assert_eq!(Readiness::probe(request, CYCLE, Some(7)).spin, Nanos(7_000));
    }

    #[test]
    fn a_processor_of_its_own_may_be_kept_busy_for_a_third_of_the_cycle() {
        let longest_us = |cpu, cycle_us| {
            let request = RtRequest { cpu, ..RtRequest::default() };
            Trial::new(request, Nanos::from_micros(cycle_us)).longest.0 / 1000
        };
        let shared = [30, 50, 100, 1000, 10_000].map(|cycle_us| longest_us(None, cycle_us));
        assert_eq!(shared, [18, 30, 60, 100, 100]);
        let own = [50, 300, 600, 900, 10_000].map(|cycle_us| longest_us(Some(1), cycle_us));
        assert_eq!(own, [30, 100, 200, 300, 300]);
    }

    #[test]
    fn the_shortest_cycle_is_measured_too() {
        let request = RtRequest { lock_memory: false, ..RtRequest::default() };
        let measured = Readiness::probe(request, Nanos::from_micros(20), None).spin;
        assert_eq!(measured, Nanos(12_000));
    }

    #[test]
    fn what_was_refused_is_named() {
        let request = RtRequest { priority: 1000, lock_memory: false, cpu: Some(100_000) };
        let refused = Readiness::probe(request, CYCLE, Some(0)).report.refused;
        assert!(
            matches!(refused[..], [Refused::Priority(1000, _), Refused::Processor(100_000, _)]),
            "{refused:?}"
        );
    }
}

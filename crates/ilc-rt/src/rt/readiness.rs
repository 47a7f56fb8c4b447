//! Settings that this machine grants the loop's thread, and how punctually it wakes it, tried before anything moves.
//!
//! `campaign` asks before bring-up, `ilc-rt latency` before it measures.

use super::clock::{Clock, MonotonicClock, Nanos};
use super::thread::{RtReport, RtRequest, enter};

/// Wake-ups tried, and the time between them.
const WAKE_UPS: usize = 100;
const EVERY: Nanos = Nanos::from_micros(200);
/// Shortest and longest measured time before a tick at which the loop's thread stops sleeping.
const SPIN_US: (u32, u32) = (20, 100);

/// Settings that a thread was granted, and the busy-waiting that it needs.
#[derive(Clone, Debug, PartialEq)]
pub struct Readiness {
    /// Granted settings.
    pub report: RtReport,
    /// Time before a tick at which to stop sleeping and busy-wait.
    pub spin: Nanos,
}

impl Readiness {
    /// Tries a request on a thread that ends at once; `spin_us` in place of a measured time of busy-waiting.
    pub fn probe(request: RtRequest, spin_us: Option<u32>) -> Self {
        let tried = std::thread::spawn(move || {
            let report = enter(request);
            let spin = spin_us.map_or_else(measure_spin, Nanos::from_micros);
            Self { report, spin }
        });
        tried.join().unwrap_or_else(|_| Self {
            report: RtReport::refusing(request, "the thread that tried it has died"),
            spin: Nanos::from_micros(SPIN_US.1),
        })
    }
}

/// Returns the 99th percentile of the lateness of wake-ups, within bounds.
fn measure_spin() -> Nanos {
    let clock = MonotonicClock::new(Nanos(0));
    let mut late_ns = [0_u64; WAKE_UPS];
    for late_ns in &mut late_ns {
        let due = clock.now().plus(EVERY);
        clock.sleep_until(due);
        *late_ns = clock.now().since(due).0;
    }
    late_ns.sort_unstable();
    let (least, most) = (Nanos::from_micros(SPIN_US.0), Nanos::from_micros(SPIN_US.1));
    Nanos(late_ns[WAKE_UPS - 2].clamp(least.0, most.0))
}

#[cfg(test)]
mod tests {
    use super::super::thread::Refused;
    use super::*;

    #[test]
    fn busy_waiting_is_measured_within_bounds_unless_it_is_given() {
        let request = RtRequest { lock_memory: false, ..RtRequest::default() };
        let measured = Readiness::probe(request, None).spin;
        assert!((20_000..=100_000).contains(&measured.0), "{measured:?}");
        assert_eq!(Readiness::probe(request, Some(0)).spin, Nanos(0));
        assert_eq!(Readiness::probe(request, Some(7)).spin, Nanos(7_000));
    }

    #[test]
    fn what_was_refused_is_named() {
        let request = RtRequest { priority: 1000, lock_memory: false, cpu: Some(100_000) };
        let refused = Readiness::probe(request, Some(0)).report.refused;
        assert!(
            matches!(refused[..], [Refused::Priority(1000, _), Refused::Processor(100_000, _)]),
            "{refused:?}"
        );
    }
}

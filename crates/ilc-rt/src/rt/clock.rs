//! Integer time, the clock as the loop sees it, and the monotonic clock of the machine.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::time::Duration;

/// A time or time span in nanoseconds; integer, so that a grid of ticks never drifts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Nanos(pub u64);

impl Nanos {
    /// Converts microseconds.
    pub const fn from_micros(micros: u32) -> Self {
        Self(micros as u64 * 1000)
    }

    /// Returns the span in seconds.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Returns this time plus `span`.
    #[must_use]
    pub const fn plus(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }

    /// Returns the span since `earlier`; zero if `earlier` is later.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

impl From<Duration> for Nanos {
    fn from(span: Duration) -> Self {
        Self(u64::try_from(span.as_nanos()).unwrap_or(u64::MAX))
    }
}

/// Time, and what the host did to the thread that asks: of the machine, or set by a test.
pub trait Clock: Send + Sync {
    /// Returns the current time.
    fn now(&self) -> Nanos;

    /// Waits until `deadline`; returns at once if it has passed.
    fn sleep_until(&self, deadline: Nanos);

    /// Returns the current time since the epoch, as the system stamps received frames.
    fn since_epoch(&self) -> Nanos;

    /// Returns the interruptions of the calling thread so far.
    fn interruptions(&self) -> Interruptions;
}

/// Counts of what kept a thread from computing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Interruptions {
    /// Times that another thread took the processor.
    pub preemptions: u32,
    /// Page faults that needed no disk.
    pub minor_faults: u32,
    /// Page faults that waited for a disk.
    pub major_faults: u32,
}

impl Interruptions {
    /// Returns the counts since earlier ones.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self {
            preemptions: self.preemptions.wrapping_sub(earlier.preemptions),
            minor_faults: self.minor_faults.wrapping_sub(earlier.minor_faults),
            major_faults: self.major_faults.wrapping_sub(earlier.major_faults),
        }
    }

    /// Returns both counts together.
    #[must_use]
    pub const fn plus(self, other: Self) -> Self {
        Self {
            preemptions: self.preemptions.wrapping_add(other.preemptions),
            minor_faults: self.minor_faults.wrapping_add(other.minor_faults),
            major_faults: self.major_faults.wrapping_add(other.major_faults),
        }
    }
}

/// `CLOCK_MONOTONIC`: sleeps to an absolute deadline, and busy-waits the last stretch. Passed as an
/// argument; other code never reads the system clock.
///
/// # Real Time
/// The kernel wakes a thread tens of microseconds late. Busy-waiting the last `spin` of each wait
/// removes this jitter at the price of processor time.
#[derive(Clone, Copy, Debug)]
pub struct MonotonicClock {
    spin: Nanos,
}

impl MonotonicClock {
    /// Creates the clock; it stops sleeping `spin` before a deadline and busy-waits.
    pub const fn new(spin: Nanos) -> Self {
        Self { spin }
    }
}

/// Returns the time of a clock of the system.
#[expect(unsafe_code, reason = "clock_gettime has no safe wrapper in the standard library")]
fn read(clock: libc::clockid_t) -> Nanos {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is a valid, exclusively borrowed timespec for the whole call.
    unsafe { libc::clock_gettime(clock, &raw mut now) };
    Nanos(now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs())
}

impl Clock for MonotonicClock {
    fn now(&self) -> Nanos {
        read(libc::CLOCK_MONOTONIC)
    }

    #[expect(unsafe_code, reason = "clock_nanosleep has no safe wrapper in the standard library")]
    fn sleep_until(&self, deadline: Nanos) {
        let wake = deadline.0.saturating_sub(self.spin.0);
        if wake > self.now().0 {
            let until = libc::timespec {
                tv_sec: (wake / 1_000_000_000).cast_signed(),
                tv_nsec: (wake % 1_000_000_000).cast_signed(),
            };
            // SAFETY: `until` outlives the call, and a null remainder is allowed for absolute
            // sleeps. An early return on a signal is harmless: the busy-wait below covers the rest.
            unsafe {
                libc::clock_nanosleep(
                    libc::CLOCK_MONOTONIC,
                    libc::TIMER_ABSTIME,
                    &raw const until,
                    std::ptr::null_mut(),
                );
            }
        }
        while self.now() < deadline {
            std::hint::spin_loop();
        }
    }

    fn since_epoch(&self) -> Nanos {
        read(libc::CLOCK_REALTIME)
    }

    #[expect(unsafe_code, reason = "getrusage has no safe wrapper in the standard library")]
    fn interruptions(&self) -> Interruptions {
        // SAFETY: zeros are a valid rusage.
        let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
        // SAFETY: `usage` is a valid, exclusively borrowed rusage for the whole call.
        unsafe { libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage) };
        // Only differences count: they wrap.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "wraps")]
        let count = |value: libc::c_long| value as u32;
        Interruptions {
            preemptions: count(usage.ru_nivcsw),
            minor_faults: count(usage.ru_minflt),
            major_faults: count(usage.ru_majflt),
        }
    }
}

/// A clock that stands still until it is set: time for tests of what happens when it runs out.
#[derive(Debug, Default)]
pub struct ManualClock {
    now: AtomicU64,
    /// Further time that passes in the next sleep.
    oversleep: AtomicU64,
    preemptions: AtomicU32,
}

impl ManualClock {
    /// Lets time pass.
    pub fn advance(&self, span: Nanos) {
        self.now.fetch_add(span.0, Ordering::Relaxed);
    }

    /// Lets the next sleep end late by a span.
    pub fn oversleep(&self, span: Nanos) {
        self.oversleep.store(span.0, Ordering::Relaxed);
    }

    /// Counts one more preemption.
    pub fn preempt(&self) {
        self.preemptions.fetch_add(1, Ordering::Relaxed);
    }
}

impl Clock for ManualClock {
    fn now(&self) -> Nanos {
        Nanos(self.now.load(Ordering::Relaxed))
    }

    fn sleep_until(&self, deadline: Nanos) {
        let late = self.oversleep.swap(0, Ordering::Relaxed);
        self.now.fetch_max(deadline.0.saturating_add(late), Ordering::Relaxed);
    }

    fn since_epoch(&self) -> Nanos {
        self.now()
    }

    fn interruptions(&self) -> Interruptions {
        let preemptions = self.preemptions.load(Ordering::Relaxed);
        Interruptions { preemptions, ..Interruptions::default() }
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_macros, reason = "tests are cold")]
mod tests {
    use super::*;

    #[test]
    fn the_monotonic_clock_does_not_wake_early() {
        let clock = MonotonicClock::new(Nanos::from_micros(50));
        let deadline = clock.now().plus(Nanos::from_micros(2000));
        clock.sleep_until(deadline);
        assert!(clock.now() >= deadline);
    }

    #[test]
    fn touching_new_memory_is_a_counted_page_fault() {
        let clock = MonotonicClock::new(Nanos(0));
        let before = clock.interruptions();
        let touched = std::hint::black_box(vec![1_u8; 1 << 24]);
        let since = clock.interruptions().since(before);
        assert!(since.minor_faults > 0 && touched[7] == 1, "{since:?}");
    }

    #[test]
    fn a_manual_clock_passes_only_when_told() {
        let clock = ManualClock::default();
        clock.sleep_until(Nanos(1000));
        assert_eq!((clock.now(), clock.since_epoch()), (Nanos(1000), Nanos(1000)));
        clock.oversleep(Nanos(30));
        clock.sleep_until(Nanos(2000));
        assert_eq!(clock.now(), Nanos(2030));
        clock.sleep_until(Nanos(2000));
        clock.advance(Nanos(5));
        assert_eq!(clock.now(), Nanos(2035));
    }
}

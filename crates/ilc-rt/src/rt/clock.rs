//! Integer time, and the monotonic clock of the machine.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

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

    /// Returns the current time.
    #[expect(unsafe_code, reason = "clock_gettime has no safe wrapper in the standard library")]
    pub fn now(&self) -> Nanos {
        let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: `now` is a valid, exclusively borrowed timespec for the whole call.
        unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &raw mut now) };
        Nanos(now.tv_sec.unsigned_abs() * 1_000_000_000 + now.tv_nsec.unsigned_abs())
    }

    /// Waits until `deadline`; returns at once if it has passed.
    #[expect(unsafe_code, reason = "clock_nanosleep has no safe wrapper in the standard library")]
    pub fn sleep_until(&self, deadline: Nanos) {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_monotonic_clock_does_not_wake_early() {
        let clock = MonotonicClock::new(Nanos::from_micros(50));
        let deadline = clock.now().plus(Nanos::from_micros(2000));
        clock.sleep_until(deadline);
        assert!(clock.now() >= deadline);
    }
}

//! Waits until a descriptor is readable, with a timeout.
//!
//! The only place where a transport waits. The timeout is the operating system's; the remainder
//! after a skipped foreign frame is measured with the system's clock.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::{Duration, Instant};

use super::super::bus::BusError;

/// End of a wait.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deadline {
    end: Option<Instant>,
}

impl Deadline {
    /// Returns the deadline `timeout` from now; one too far to represent never comes.
    #[expect(
        clippy::disallowed_methods,
        reason = "a time-out is system time; no value depends on it"
    )]
    pub(super) fn after(timeout: Duration) -> Self {
        Self { end: Instant::now().checked_add(timeout) }
    }

    /// Returns the remaining time, or `None` if the deadline has passed.
    #[expect(
        clippy::disallowed_methods,
        reason = "a time-out is system time; no value depends on it"
    )]
    pub(super) fn left(self) -> Option<Duration> {
        match self.end {
            None => Some(Duration::MAX),
            Some(end) => end.checked_duration_since(Instant::now()).filter(|left| !left.is_zero()),
        }
    }

    /// Waits until `descriptor` is readable; returns `false` at the deadline.
    ///
    /// # Errors
    /// [`BusError::Os`] if the system refuses to wait.
    #[expect(unsafe_code, reason = "std has no poll")]
    pub(super) fn readable(self, descriptor: BorrowedFd<'_>) -> Result<bool, BusError> {
        loop {
            let Some(left) = self.left() else { return Ok(false) };
            let left = libc::timespec {
                tv_sec: libc::time_t::try_from(left.as_secs()).unwrap_or(libc::time_t::MAX),
                tv_nsec: libc::c_long::from(left.subsec_nanos()),
            };
            let mut entry =
                libc::pollfd { fd: descriptor.as_raw_fd(), events: libc::POLLIN, revents: 0 };
            // SAFETY: `entry` and `left` are valid for the whole call, the count of entries is 1,
            // and a null signal mask leaves the mask unchanged.
            let ready =
                unsafe { libc::ppoll(&raw mut entry, 1, &raw const left, std::ptr::null()) };
            if ready > 0 {
                return Ok(true);
            }
            if ready < 0 {
                let errno = std::io::Error::last_os_error().raw_os_error().unwrap_or(0);
                if errno != libc::EINTR {
                    return Err(BusError::Os(errno));
                }
            }
        }
    }
}

//! Wakes a receiver that waits for a ring buffer to fill.
//!
//! A ring buffer alone can only be polled. The bell lets the receiver sleep meanwhile and costs the
//! sender one atomic exchange, plus one non-blocking system call if a receiver sleeps. A socket
//! pair rather than a condition variable: no lock on either side.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::io::{self, Read, Write};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering, fence};

use super::super::bus::BusError;
use super::wait::Deadline;

/// The sender's end.
#[derive(Debug)]
pub(super) struct Ringer {
    waiting: Arc<AtomicBool>,
    socket: UnixStream,
}

/// The receiver's end.
#[derive(Debug)]
pub(super) struct Bell {
    waiting: Arc<AtomicBool>,
    socket: UnixStream,
}

/// Returns the two ends of a bell.
///
/// # Errors
/// The system's error if there are no descriptors left.
pub(super) fn bell() -> io::Result<(Ringer, Bell)> {
    let (ringer, bell) = UnixStream::pair()?;
    ringer.set_nonblocking(true)?;
    bell.set_nonblocking(true)?;
    let waiting = Arc::new(AtomicBool::new(false));
    Ok((Ringer { waiting: Arc::clone(&waiting), socket: ringer }, Bell { waiting, socket: bell }))
}

impl Ringer {
    /// Wakes the receiver if it waits; called after the buffer was filled.
    pub(super) fn ring(&self) {
        // Orders the filling before the read of `waiting`, against the reverse order in
        // `Bell::wait`: at least one of the two sides sees the other.
        fence(Ordering::SeqCst);
        if self.waiting.load(Ordering::Relaxed) && self.waiting.swap(false, Ordering::AcqRel) {
            // A full socket has rung already; a closed one has no receiver to wake.
            let _ = (&self.socket).write(&[0]);
        }
    }
}

impl Bell {
    /// Waits until `take` returns something or the deadline has passed.
    ///
    /// # Errors
    /// The result of `take`, [`BusError::Closed`] if the sender's end is gone, or [`BusError::Os`]
    /// if the system refuses to wait.
    pub(super) fn wait<T>(
        &mut self,
        deadline: Deadline,
        mut take: impl FnMut() -> Result<Option<T>, BusError>,
    ) -> Result<Option<T>, BusError> {
        loop {
            self.waiting.store(true, Ordering::Relaxed);
            fence(Ordering::SeqCst);
            let taken = take();
            if !matches!(taken, Ok(None)) {
                self.waiting.store(false, Ordering::Relaxed);
                return taken;
            }
            let woken = deadline.readable(self.socket.as_fd());
            self.waiting.store(false, Ordering::Relaxed);
            if !woken? {
                return take();
            }
            if self.is_closed() {
                // The sender's last frame may have arrived after the check above.
                return take()?.map_or(Err(BusError::Closed), |last| Ok(Some(last)));
            }
        }
    }

    /// Drains the socket; returns true if the sender's end is gone.
    fn is_closed(&self) -> bool {
        let mut rung = [0; 16];
        matches!((&self.socket).read(&mut rung), Ok(0))
    }
}

//! Orders of an operator to the loop: which runs may start, pause, feed override.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Feed override without an order, in percent; also the largest.
pub const FEED_WHOLE: u32 = 100;

/// Orders, written by any thread and read by the loop in every tick.
///
/// # Real Time
/// Atomics only: neither side can make the other wait.
#[derive(Debug)]
pub struct Orders {
    /// Runs of lower numbers may start.
    released: AtomicU32,
    feed_percent: AtomicU32,
    paused: AtomicBool,
}

impl Default for Orders {
    fn default() -> Self {
        Self::new(true)
    }
}

impl Orders {
    /// Creates orders that release every run, or none, at the whole feed.
    pub fn new(releases_all: bool) -> Self {
        Self {
            released: AtomicU32::new(if releases_all { u32::MAX } else { 0 }),
            feed_percent: AtomicU32::new(FEED_WHOLE),
            paused: AtomicBool::new(false),
        }
    }

    /// Lets a run start; earlier ones may then start, too.
    pub fn release(&self, run: u32) {
        self.released.fetch_max(run.saturating_add(1), Ordering::Relaxed);
    }

    /// Holds the path, and every start, or goes on.
    pub fn pause(&self, paused: bool) {
        self.paused.store(paused, Ordering::Relaxed);
    }

    /// Sets the feed override, bounded to 1 to 100 percent.
    pub fn set_feed(&self, percent: u32) {
        self.feed_percent.store(percent.clamp(1, FEED_WHOLE), Ordering::Relaxed);
    }

    /// Returns the feed override in percent, without a pause.
    pub fn feed_percent(&self) -> u32 {
        self.feed_percent.load(Ordering::Relaxed)
    }

    /// Returns true if the path is held.
    pub fn is_paused(&self) -> bool {
        self.paused.load(Ordering::Relaxed)
    }

    /// Returns the orders of now: a tick reads them once, so that it follows one state.
    pub(super) fn seen(&self) -> OrdersSeen {
        OrdersSeen {
            released: self.released.load(Ordering::Relaxed),
            feed_percent: self.feed_percent(),
            is_paused: self.is_paused(),
        }
    }

    /// Takes the orders of a recorded tick over.
    pub fn restore(&self, seen: OrdersSeen) {
        self.released.store(seen.released, Ordering::Relaxed);
        self.feed_percent.store(seen.feed_percent, Ordering::Relaxed);
        self.pause(seen.is_paused);
    }
}

/// The orders as a tick read them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OrdersSeen {
    /// Runs of lower numbers may start.
    pub released: u32,
    /// Feed override in percent.
    pub feed_percent: u32,
    /// True if the path is held.
    pub is_paused: bool,
}

impl OrdersSeen {
    /// Returns true if a run may start now.
    pub(super) fn may_start(self, run: u32) -> bool {
        !self.is_paused && run < self.released
    }

    /// Returns the wanted scale of time along the path, 0 to 1.
    pub(super) fn scale(self) -> f64 {
        if self.is_paused { 0.0 } else { f64::from(self.feed_percent) / f64::from(FEED_WHOLE) }
    }
}

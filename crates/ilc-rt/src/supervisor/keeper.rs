//! Keeps the runs: on a thread of its own in real time, in line in lock-step.
//!
//! Writing to a disk can take seconds when others write too. Meanwhile the loop's mailbox must be read and
//! the next input handed over. A run that cannot be kept ends the campaign; those that come after it wait,
//! so that the library never has a gap.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::error::SupervisorError;
use crate::library::{Library, LibraryError};
use crate::record::{IterationRecord, Meta};

/// What came of keeping a run.
#[derive(Debug)]
pub(super) struct Kept {
    /// The run.
    pub(super) record: IterationRecord,
    /// Its key, or why it is not kept; `None` if one before it could not be kept.
    pub(super) result: Option<Result<i64, LibraryError>>,
}

/// The library, and where it is written to.
pub(super) enum Keeper {
    /// In the caller's thread: the result is there at once.
    InLine { shelf: Shelf, done: Option<Kept> },
    /// On a thread of its own.
    Thread {
        records: Option<Sender<IterationRecord>>,
        kept: Receiver<Kept>,
        thread: Option<JoinHandle<Shelf>>,
    },
}

impl Keeper {
    pub(super) fn in_line(library: Library, meta: Arc<Meta>) -> Self {
        Self::InLine { shelf: Shelf { library, meta, is_stuck: false }, done: None }
    }

    pub(super) fn on_thread(library: Library, meta: Arc<Meta>) -> Result<Self, SupervisorError> {
        let (records, todo) = channel();
        let (told, kept) = channel();
        let mut shelf = Shelf { library, meta, is_stuck: false };
        let thread = std::thread::Builder::new()
            .name("ilc-library".to_owned())
            .spawn(move || {
                for record in todo {
                    // Nobody listens after a panic of the campaign; the run is in the library all the same.
                    let _ = told.send(shelf.keep(record));
                }
                shelf
            })
            .map_err(|source| SupervisorError::Thread { what: "library", source })?;
        Ok(Self::Thread { records: Some(records), kept, thread: Some(thread) })
    }

    /// Begins to keep a run.
    pub(super) fn begin(&mut self, record: IterationRecord) {
        match self {
            Self::InLine { shelf, done } => *done = Some(shelf.keep(record)),
            Self::Thread { records: Some(records), .. } => {
                let _ = records.send(record);
            }
            Self::Thread { .. } => {}
        }
    }

    /// What came of the oldest run that was not told of yet, once it is there.
    pub(super) fn take(&mut self) -> Option<Kept> {
        match self {
            Self::InLine { done, .. } => done.take(),
            Self::Thread { kept, .. } => kept.try_recv().ok(),
        }
    }

    /// Waits until all runs have been told of, by [`take`](Self::take); then keeps happen in line.
    pub(super) fn finish(&mut self) -> Vec<Kept> {
        let Self::Thread { records, kept, thread } = self else { return Vec::new() };
        drop(records.take());
        let rest: Vec<Kept> = kept.iter().collect();
        if let Some(shelf) = thread.take().and_then(|thread| thread.join().ok()) {
            *self = Self::InLine { shelf, done: None };
        }
        rest
    }

    /// Tries once more to keep a run, now that the axes are at rest.
    pub(super) fn retry(&mut self, record: &IterationRecord) -> Option<i64> {
        match self {
            Self::InLine { shelf, .. } => shelf.library.append(&shelf.meta, record).ok(),
            Self::Thread { .. } => None,
        }
    }
}

/// A library and what is written into it.
pub(super) struct Shelf {
    library: Library,
    meta: Arc<Meta>,
    is_stuck: bool,
}

impl Shelf {
    fn keep(&mut self, record: IterationRecord) -> Kept {
        if self.is_stuck {
            return Kept { record, result: None };
        }
        let result = self.library.append(&self.meta, &record);
        if result.is_err() {
            self.is_stuck = true;
            self.library.hurry();
        }
        Kept { record, result: Some(result) }
    }
}

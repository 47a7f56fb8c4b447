//! Keeps the runs: on a thread of its own in real time, in line in lock-step.
//!
//! Writing to a disk can take seconds when others write too. Meanwhile the loop's mailbox must be read and
//! the next input handed over. A run that cannot be kept ends the campaign; those that come after it wait,
//! so that the library never has a gap.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::error::CampaignError;
use crate::library::{Library, LibraryError};
use crate::record::{Figures, IterationRecord, Meta};

/// What came of keeping a run.
#[derive(Debug)]
pub(super) struct Kept {
    /// The run.
    pub(super) record: IterationRecord,
    /// Whether the law was asked about it, and what it decides is to be added.
    pub(super) asked: bool,
    /// Its key, or why it is not kept; `None` if one before it could not be kept.
    pub(super) result: Option<Result<i64, LibraryError>>,
}

/// What came of a thing that was to be written.
#[derive(Debug)]
pub(super) enum Told {
    /// Of a run.
    Kept(Box<Kept>),
    /// What the law decided could not be added to a run.
    Unjudged(LibraryError),
}

/// What is to be written.
pub(super) enum Job {
    /// A run, and whether the law was asked about it.
    Keep(Box<IterationRecord>, bool),
    /// What the law decided on a run that is kept.
    Judge(i64, Figures),
}

/// The library, and where it is written to.
pub(super) enum Keeper {
    /// In the caller's thread: the result is there at once.
    InLine { shelf: Shelf, done: VecDeque<Told> },
    /// On a thread of its own.
    Thread { jobs: Option<Sender<Job>>, told: Receiver<Told>, thread: Option<JoinHandle<Shelf>> },
}

impl Keeper {
    pub(super) fn in_line(library: Library, meta: Arc<Meta>) -> Self {
        Self::InLine { shelf: Shelf { library, meta, is_stuck: false }, done: VecDeque::new() }
    }

    pub(super) fn on_thread(library: Library, meta: Arc<Meta>) -> Result<Self, CampaignError> {
        let (jobs, todo) = channel();
        let (done, told) = channel();
        let mut shelf = Shelf { library, meta, is_stuck: false };
        let thread = std::thread::Builder::new()
            .name("ilc-library".to_owned())
            .spawn(move || {
                for job in todo {
                    if let Some(came) = shelf.carry_out(job) {
                        // Nobody listens after a panic of the campaign; the run is kept all the same.
                        let _ = done.send(came);
                    }
                }
                shelf
            })
            .map_err(|source| CampaignError::Thread { what: "library", source })?;
        Ok(Self::Thread { jobs: Some(jobs), told, thread: Some(thread) })
    }

    /// Begins to keep a run.
    pub(super) fn begin(&mut self, record: IterationRecord, asked: bool) {
        self.give(Job::Keep(Box::new(record), asked));
    }

    /// Begins to add what the law decided to a run that is kept.
    pub(super) fn judge(&mut self, id: i64, figures: Figures) {
        self.give(Job::Judge(id, figures));
    }

    fn give(&mut self, job: Job) {
        match self {
            Self::InLine { shelf, done } => done.extend(shelf.carry_out(job)),
            Self::Thread { jobs: Some(jobs), .. } => {
                let _ = jobs.send(job);
            }
            Self::Thread { .. } => {}
        }
    }

    /// What came of the oldest run that was not told of yet, once it is there.
    pub(super) fn take(&mut self) -> Option<Told> {
        match self {
            Self::InLine { done, .. } => done.pop_front(),
            Self::Thread { told, .. } => told.try_recv().ok(),
        }
    }

    /// Waits until all runs have been told of, by [`take`](Self::take); then keeps happen in line.
    pub(super) fn finish(&mut self) -> Vec<Told> {
        let Self::Thread { jobs, told, thread } = self else { return Vec::new() };
        drop(jobs.take());
        let rest: Vec<Told> = told.iter().collect();
        if let Some(shelf) = thread.take().and_then(|thread| thread.join().ok()) {
            *self = Self::InLine { shelf, done: VecDeque::new() };
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
    fn carry_out(&mut self, job: Job) -> Option<Told> {
        match job {
            Job::Keep(record, asked) => Some(Told::Kept(Box::new(self.keep(*record, asked)))),
            Job::Judge(..) if self.is_stuck => None,
            Job::Judge(id, figures) => self.library.judge(id, &figures).err().map(Told::Unjudged),
        }
    }

    fn keep(&mut self, record: IterationRecord, asked: bool) -> Kept {
        if self.is_stuck {
            return Kept { record, asked, result: None };
        }
        let result = self.library.append(&self.meta, &record);
        if result.is_err() {
            self.is_stuck = true;
            self.library.hurry();
        }
        Kept { record, asked, result: Some(result) }
    }
}

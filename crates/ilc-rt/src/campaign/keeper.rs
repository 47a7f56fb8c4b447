//! Storage of the runs, on its own thread.
//!
//! Writing to a disk can take seconds when others write too. Meanwhile the loop's mailbox must be
//! read and the next input passed on. In lock-step the outcome is waited for where the next run starts, so that
//! campaigns repeat event by event. A run that cannot be stored ends the campaign; later ones
//! wait, so that the library never has a gap.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::error::CampaignError;
use super::keep::Thinning;
use crate::config::Keep;
use crate::library::{Library, LibraryError};
use crate::record::{Figures, IterationRecord, Meta};

/// Outcome of storing a run.
#[derive(Debug)]
pub(super) struct Stored {
    /// The run.
    pub(super) record: IterationRecord,
    /// True if the law was asked about it, and its decision is to be added.
    pub(super) asked: bool,
    /// Digest of its arrays.
    pub(super) digest: String,
    /// Its key, or the reason why it is not stored; `None` if an earlier one could not be stored.
    pub(super) result: Option<Result<i64, LibraryError>>,
}

/// Outcome of a request.
#[derive(Debug)]
pub(super) enum StoreEvent {
    /// A run was stored, or not.
    Stored(Box<Stored>),
    /// The law's decision could not be added to a run.
    NotAmended(LibraryError),
}

/// Request to the library.
pub(super) enum StoreRequest {
    /// Append a run; true if the law was asked about it.
    Append(Box<IterationRecord>, bool),
    /// Add the law's decision to a stored run.
    Amend(i64, Box<Figures>),
    /// Store all further runs with another provenance.
    Begin(Arc<Meta>),
}

/// The library, with the thread that writes to it.
pub(super) enum Keeper {
    /// In the caller's thread, once all is over.
    InLine { store: Box<Store>, done: VecDeque<StoreEvent> },
    /// On its own thread.
    Thread {
        requests: Option<Sender<StoreRequest>>,
        events: Receiver<StoreEvent>,
        thread: Option<JoinHandle<Store>>,
        /// Runs whose outcome has not been taken.
        n_begun: usize,
        waits: Waits,
    },
}

/// Time at which an outcome is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Waits {
    /// As soon as it is there.
    Never,
    /// When it is [waited for](Keeper::wait).
    WhenTold,
}

impl Keeper {
    pub(super) fn new(
        library: Library,
        meta: Arc<Meta>,
        keep: Keep,
        waits: Waits,
    ) -> Result<Self, CampaignError> {
        let (requests, received) = channel();
        let (done, events) = channel();
        let mut store = Store::new(library, meta, keep);
        let thread = std::thread::Builder::new()
            .name("ilc-library".to_owned())
            .spawn(move || {
                for request in received {
                    if let Some(came) = store.execute(request) {
                        // There is no receiver after a panic of the campaign; the run is stored
                        // nevertheless.
                        let _ = done.send(came);
                    }
                }
                store
            })
            .map_err(|source| CampaignError::Thread { what: "library", source })?;
        Ok(Self::Thread {
            requests: Some(requests),
            events,
            thread: Some(thread),
            n_begun: 0,
            waits,
        })
    }

    /// Begins to store a run.
    pub(super) fn append(&mut self, record: IterationRecord, asked: bool) {
        if let Self::Thread { n_begun, .. } = self {
            *n_begun += 1;
        }
        self.send(StoreRequest::Append(Box::new(record), asked));
    }

    /// Begins to add the law's decision to a stored run.
    pub(super) fn amend(&mut self, id: i64, figures: Figures) {
        self.send(StoreRequest::Amend(id, Box::new(figures)));
    }

    /// Stores all further runs in another campaign.
    pub(super) fn begin(&mut self, meta: Meta) {
        self.send(StoreRequest::Begin(Arc::new(meta)));
    }

    fn send(&mut self, request: StoreRequest) {
        match self {
            Self::InLine { store, done } => done.extend(store.execute(request)),
            Self::Thread { requests: Some(requests), .. } => {
                let _ = requests.send(request);
            }
            Self::Thread { .. } => {}
        }
    }

    /// Returns the oldest outcome that need not be waited for.
    pub(super) fn poll(&mut self) -> Option<StoreEvent> {
        match self {
            Self::InLine { done, .. } => done.pop_front(),
            Self::Thread { waits: Waits::WhenTold, .. } => None,
            Self::Thread { events, n_begun, .. } => taken(events.try_recv().ok(), n_begun),
        }
    }

    /// In lock-step, blocks until the oldest pending run is stored and returns its outcome; `None` if no run is pending.
    pub(super) fn wait(&mut self) -> Option<StoreEvent> {
        match self {
            Self::Thread { events, n_begun, waits: Waits::WhenTold, .. } if *n_begun > 0 => {
                taken(events.recv().ok(), n_begun)
            }
            _ => None,
        }
    }

    /// Waits until every request is done and returns the outcomes not taken by [`poll`](Self::poll); from
    /// then on requests are executed in line.
    pub(super) fn flush(&mut self) -> Vec<StoreEvent> {
        let Self::Thread { requests, events, thread, .. } = self else { return Vec::new() };
        drop(requests.take());
        let rest: Vec<StoreEvent> = events.iter().collect();
        if let Some(store) = thread.take().and_then(|thread| thread.join().ok()) {
            *self = Self::InLine { store: Box::new(store), done: VecDeque::new() };
        }
        rest
    }

    /// Retries to store a run, now that the axes are at rest.
    pub(super) fn retry(&mut self, record: &IterationRecord) -> Option<i64> {
        match self {
            Self::InLine { store, .. } => store.library.append(&store.meta, record).ok(),
            Self::Thread { .. } => None,
        }
    }
}

/// A library, and the provenance of the runs written into it.
pub(super) struct Store {
    library: Library,
    meta: Arc<Meta>,
    is_stuck: bool,
    thinning: Thinning,
}

impl Store {
    fn new(library: Library, meta: Arc<Meta>, keep: Keep) -> Self {
        Self { library, meta, is_stuck: false, thinning: Thinning::new(keep) }
    }

    fn execute(&mut self, request: StoreRequest) -> Option<StoreEvent> {
        match request {
            StoreRequest::Append(record, asked) => {
                Some(StoreEvent::Stored(Box::new(self.keep(*record, asked))))
            }
            StoreRequest::Begin(meta) => {
                self.meta = meta;
                None
            }
            StoreRequest::Amend(..) if self.is_stuck => None,
            StoreRequest::Amend(id, figures) => {
                self.library.judge(id, &figures).err().map(StoreEvent::NotAmended)
            }
        }
    }

    fn keep(&mut self, record: IterationRecord, asked: bool) -> Stored {
        let digest = record.digest();
        if self.is_stuck {
            return Stored { record, asked, digest, result: None };
        }
        let result = self.library.append(&self.meta, &record);
        if let Ok(id) = &result {
            let gone = self.thinning.add(*id, &self.meta, &record);
            if let Err(error) = self.library.remove(&gone) {
                tracing::warn!("runs that need not be kept stay: {error}");
            }
        } else {
            self.is_stuck = true;
            self.library.hurry();
        }
        Stored { record, asked, digest, result: Some(result) }
    }
}

fn taken(event: Option<StoreEvent>, n_begun: &mut usize) -> Option<StoreEvent> {
    if matches!(event, Some(StoreEvent::Stored(_))) {
        *n_begun -= 1;
    }
    event
}

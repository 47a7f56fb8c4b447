//! Laws of many plants: copies that no two plants use at the same time.

use std::sync::{Mutex, PoisonError};

use super::lanes::LANES;
use crate::learning::Law;

/// Laws of the plants, for a number of threads.
pub struct Laws {
    /// Law of each plant; empty if nothing is learned.
    of_plant: Vec<usize>,
    copies: Vec<Mutex<Vec<Box<dyn Law>>>>,
    threads: usize,
}

impl std::fmt::Debug for Laws {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Laws").field("of_plant", &self.of_plant).finish_non_exhaustive()
    }
}

impl Laws {
    /// Collects the laws: `of_plant` has the index of each plant's law, or nothing if no plant learns, and `make`
    /// makes a copy of the law of an index, as many times as `threads` threads use it at once.
    ///
    /// # Errors
    /// - those of `make`.
    pub fn new<E>(
        of_plant: Vec<usize>,
        threads: usize,
        mut make: impl FnMut(usize) -> Result<Box<dyn Law>, E>,
    ) -> Result<Self, E> {
        let threads = threads.max(1);
        let mut users = vec![0; of_plant.iter().max().map_or(0, |last| last + 1)];
        for law in &of_plant {
            users[*law] += 1;
        }
        let copies = users.into_iter().enumerate().map(|(law, users)| {
            let most = threads.saturating_mul(LANES);
            (0..users.min(most)).map(|_| make(law)).collect::<Result<Vec<_>, E>>().map(Mutex::new)
        });
        let copies = copies.collect::<Result<_, E>>()?;
        Ok(Self { of_plant, copies, threads })
    }

    /// Returns the number of threads.
    pub(super) fn threads(&self) -> usize {
        self.threads
    }

    /// Returns the number of plants that have a law.
    pub(super) fn len(&self) -> usize {
        self.of_plant.len()
    }

    /// Takes a copy of a plant's law; `None` if it does not learn.
    pub(super) fn take(&self, plant: usize) -> Option<Box<dyn Law>> {
        let copies = &self.copies[*self.of_plant.get(plant)?];
        copies.lock().unwrap_or_else(PoisonError::into_inner).pop()
    }

    /// Returns a copy that [`Laws::take`] gave for this plant.
    pub(super) fn put(&self, plant: usize, law: Box<dyn Law>) {
        if let Some(index) = self.of_plant.get(plant) {
            self.copies[*index].lock().unwrap_or_else(PoisonError::into_inner).push(law);
        }
    }
}

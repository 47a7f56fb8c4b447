//! Deletion of runs, and the return of their space.

use std::collections::BTreeSet;

use rusqlite::{Connection, OptionalExtension};

use super::error::LibraryError;
use super::once;
use super::schema;
use super::store::Library;

/// Pages returned in one transaction.
const STEP_PAGES: i64 = 1024;
/// Largest number of pages that are copied at once, in a fraction of a second.
const COPIED_PAGES: i64 = 8192;

impl Library {
    /// Deletes these runs, all or none; the file keeps its size, as later runs use their space.
    ///
    /// # Errors
    /// [`LibraryError::Locked`] or [`LibraryError::Sqlite`] if the file cannot be written.
    pub fn remove(&self, ids: &[i64]) -> Result<(), LibraryError> {
        if ids.is_empty() {
            return Ok(());
        }
        self.transact(|connection| delete(connection, ids).map_err(|source| self.fail(source)))
    }

    /// Deletes these runs, all or none, and returns their space to the system.
    ///
    /// # Errors
    /// As [`Library::remove`] and [`Library::shrink`].
    pub fn discard(&self, ids: &[i64]) -> Result<(), LibraryError> {
        self.remove(ids)?;
        self.shrink(ids.len())
    }

    /// Returns the space of `n_deleted` runs, and of what was kept for them alone, to the system.
    ///
    /// # Errors
    /// [`LibraryError::Locked`], [`LibraryError::Sqlite`] or [`LibraryError::NotShrunk`]: the runs are
    /// deleted, but their space cannot be returned.
    pub fn shrink(&self, n_deleted: usize) -> Result<(), LibraryError> {
        self.transact(|connection| {
            once::forget_descriptions(connection).map_err(|source| self.fail(source))
        })?;
        let path = || self.path.clone();
        self.vacuum().map_err(|source| LibraryError::NotShrunk { path: path(), n_deleted, source })
    }

    /// Returns the pages of deleted runs to the system. The remaining runs are never at risk:
    /// SQLite changes the file in transactions, and an interrupted one is undone.
    fn vacuum(&self) -> rusqlite::Result<()> {
        let is_whole = self.pragma("auto_vacuum")? == 0;
        let n_free = self.pragma("freelist_count")?;
        let n_kept = self.pragma("page_count")? - n_free;
        if is_whole {
            // An older file, without the bookkeeping of incremental vacuum.
            schema::prepare(&self.connection)?;
        }
        if is_whole || n_free > n_kept && n_kept <= COPIED_PAGES {
            // A small rest is copied sooner than the other pages are returned.
            self.connection.execute_batch("VACUUM")?;
        } else {
            // In small steps: a campaign that keeps its run meanwhile must not wait for all of
            // them.
            while self.pragma("freelist_count")? > 0 {
                let mut step =
                    self.connection.prepare(&format!("PRAGMA incremental_vacuum({STEP_PAGES})"))?;
                let mut rows = step.query([])?;
                while rows.next()?.is_some() {}
            }
        }
        // The file shrinks when the log is written back; readers may delay that.
        self.connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()))
    }

    fn pragma(&self, name: &str) -> rusqlite::Result<i64> {
        self.connection.pragma_query_value(None, name, |row| row.get(0))
    }
}

/// Deletes runs, and what was kept for them alone.
fn delete(connection: &Connection, ids: &[i64]) -> rusqlite::Result<()> {
    let (mut places, mut references) = (BTreeSet::new(), BTreeSet::new());
    let mut forget_run =
        connection.prepare_cached("DELETE FROM iteration WHERE id = ?1 RETURNING place")?;
    let mut forget_signals =
        connection.prepare_cached("DELETE FROM signals WHERE id = ?1 RETURNING reference")?;
    for id in ids {
        let place: Option<Option<i64>> = forget_run.query_row([id], |row| row.get(0)).optional()?;
        places.extend(place.flatten());
        references.extend(forget_signals.query_row([id], |row| row.get::<_, i64>(0)).optional()?);
    }
    once::forget_places(connection, &places)?;
    references.into_iter().try_for_each(|reference| once::forget_reference(connection, reference))
}

//! Storing runs: those of a campaign, and those of another library.

use rusqlite::{Connection, Transaction, TransactionBehavior, params};

use super::error::LibraryError;
use super::new_run::NewRun;
use super::row::Row;
use super::store::Library;
use crate::record::{IterationRecord, Meta};

/// SQLite's extended code for a row that already exists.
const UNIQUE: i32 = rusqlite::ffi::SQLITE_CONSTRAINT_UNIQUE;

impl Library {
    /// Stores one run and returns its key.
    ///
    /// # Errors
    /// [`LibraryError::Taken`] if the campaign already has a run of this number;
    /// [`LibraryError::Gone`] if the file does not exist any more; [`LibraryError::Locked`] or
    /// [`LibraryError::Sqlite`] if it cannot be written.
    pub fn append(&self, meta: &Meta, record: &IterationRecord) -> Result<i64, LibraryError> {
        let n_samples = record.reference_m.len() / meta.n_axes.max(1);
        let (id, created_utc, digest) = (None, None, record.digest());
        let run = NewRun { id, created_utc, meta, record, n_samples, digest: &digest };
        let id = self.transact(|connection| {
            run.write(connection).map_err(|source| self.not_stored(run, source))
        })?;
        self.require_file()?;
        Ok(id)
    }

    /// Stores runs of another library under new keys, all or none, and returns how many were new;
    /// those that are here already are left as they are.
    ///
    /// # Errors
    /// That of a row which cannot be given; [`LibraryError::Other`] if a campaign has another run of
    /// this number; [`LibraryError::Damaged`] if arrays do not match their digest; or as
    /// [`Library::append`].
    pub fn insert<E: From<LibraryError>>(
        &self,
        rows: impl IntoIterator<Item = Result<Row, E>>,
    ) -> Result<usize, E> {
        let path = || self.path.clone();
        let n_new = self.transact::<usize, E>(|connection| {
            let mut n_new = 0;
            for row in rows {
                let row = row?;
                if row.record.digest() != row.digest {
                    return Err(LibraryError::Damaged { path: path(), id: row.id }.into());
                }
                let run = NewRun::of_row(&row);
                if is_here(connection, run).map_err(|source| self.fail(source))? {
                    continue;
                }
                run.write(connection).map_err(|source| match self.not_stored(run, source) {
                    LibraryError::Taken { path, campaign, index } => {
                        LibraryError::Other { path, campaign, index }
                    }
                    error => error,
                })?;
                n_new += 1;
            }
            Ok(n_new)
        })?;
        self.require_file()?;
        Ok(n_new)
    }

    /// Does work in one transaction: all of it is stored, or nothing.
    pub(super) fn transact<T, E: From<LibraryError>>(
        &self,
        work: impl FnOnce(&Connection) -> Result<T, E>,
    ) -> Result<T, E> {
        let fail = |source| E::from(self.fail(source));
        let immediate = TransactionBehavior::Immediate;
        let transaction = Transaction::new_unchecked(&self.connection, immediate).map_err(fail)?;
        let done = work(&transaction)?;
        transaction.commit().map_err(fail)?;
        Ok(done)
    }

    fn not_stored(&self, run: NewRun<'_>, source: rusqlite::Error) -> LibraryError {
        match source.sqlite_error() {
            Some(error) if error.extended_code == UNIQUE => LibraryError::Taken {
                path: self.path.clone(),
                campaign: run.meta.campaign.clone(),
                index: run.record.index,
            },
            _ => self.fail(source),
        }
    }
}

/// Returns true if this very run is in the file.
fn is_here(connection: &Connection, run: NewRun<'_>) -> rusqlite::Result<bool> {
    connection
        .prepare_cached(
            "SELECT count(*) FROM iteration WHERE campaign = ?1 AND iteration = ?2 AND digest = ?3",
        )?
        .query_row(params![run.meta.campaign, run.record.index, run.digest], |row| {
            row.get::<_, i64>(0).map(|n| n > 0)
        })
}

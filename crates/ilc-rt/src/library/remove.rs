//! Deletion of runs, and the return of their space.

use std::collections::{BTreeSet, HashSet};

use rusqlite::{Connection, OptionalExtension};

use super::error::LibraryError;
use super::near;
use super::once;
use super::schema;
use super::store::Library;

/// Pages returned in one transaction.
const STEP_PAGES: i64 = 1024;
/// Largest number of pages that are copied at once, in a fraction of a second.
const COPIED_PAGES: i64 = 8192;
/// Ratio of deleted to remaining runs above which the remaining ones are copied.
const DELETED_PER_LEFT: usize = 4;
/// Number of deleted runs up to which each is deleted on its own.
const FEW: usize = 500;

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
    if ids.len() > FEW {
        let gone: HashSet<i64> = ids.iter().copied().collect();
        let mut all = connection.prepare("SELECT id FROM iteration")?;
        let (without, left): (Vec<i64>, Vec<i64>) = all
            .query_map([], |row| row.get(0))?
            .collect::<rusqlite::Result<Vec<i64>>>()?
            .into_iter()
            .partition(|id| gone.contains(id));
        if without.len() > DELETED_PER_LEFT * left.len() {
            return leave(connection, &left);
        }
    }
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

/// Deletes all runs but a few: SQLite empties a whole table sooner than it deletes most of its rows.
fn leave(connection: &Connection, left: &[i64]) -> rusqlite::Result<()> {
    connection.execute_batch("CREATE TEMP TABLE left_id (id INTEGER PRIMARY KEY)")?;
    let mut insert = connection.prepare("INSERT INTO left_id VALUES (?1)")?;
    left.iter().try_for_each(|id| insert.execute([id]).map(drop))?;
    connection.execute_batch(
        "CREATE TEMP TABLE left_run AS SELECT * FROM iteration WHERE id IN left_id;
        CREATE TEMP TABLE left_signals AS SELECT * FROM signals WHERE id IN left_id;
        CREATE TEMP TABLE left_place AS
            SELECT * FROM place WHERE id IN (SELECT place FROM left_run);
        DELETE FROM iteration;
        DELETE FROM signals;
        DELETE FROM place;
        INSERT INTO iteration SELECT * FROM left_run;
        INSERT INTO signals SELECT * FROM left_signals;
        INSERT INTO place SELECT * FROM left_place;
        DELETE FROM reference WHERE id NOT IN (SELECT reference FROM signals);
        DROP TABLE left_id;
        DROP TABLE left_run;
        DROP TABLE left_signals;
        DROP TABLE left_place;",
    )?;
    near::build(connection)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;
    use crate::record::{IterationRecord, Meta};

    /// Runs under some disturbances, in two cells, with two sets of set points.
    fn filled(n_runs: u32) -> Library {
        let library = Library::in_memory().unwrap();
        for index in 0..n_runs {
            let mut run = record(index);
            run.disturbance = match index % 5 {
                0 => Vec::new(),
                part => vec![f64::from(part), f64::from(index % 97)],
            };
            if index % 3 == 0 {
                run.reference_m[0] += 1.0;
            }
            let mut meta = meta("a");
            if index % 7 == 0 {
                meta = Meta { cell: "mill".into(), campaign: "b".into(), ..meta };
            }
            library.append(&meta, &IterationRecord { index, ..run }).unwrap();
        }
        library.connection.execute("UPDATE iteration SET created_utc = 'then'", []).unwrap();
        library
    }

    /// Every value of every table.
    fn content(library: &Library) -> Vec<String> {
        let tables = ["iteration", "signals", "place", "reference", "cell", "near_rowid"];
        let mut all = Vec::new();
        for table in tables {
            let what = if table == "near_rowid" { "rowid" } else { "*" };
            let query = format!("SELECT {what} FROM {table} ORDER BY 1");
            let mut statement = library.connection.prepare(&query).unwrap();
            let n = statement.column_count();
            let mut rows = statement.query([]).unwrap();
            while let Some(row) = rows.next().unwrap() {
                let values = (0..n).map(|at| format!("{:?}", row.get_ref(at).unwrap()));
                all.push(format!("{table}: {}", values.collect::<Vec<_>>().join(", ")));
            }
        }
        all
    }

    #[test]
    fn most_runs_at_once_are_deleted_like_each_on_its_own() {
        for (n_left, every) in [(0, 701), (1, 700), (70, 10)] {
            let (at_once, one_by_one) = (filled(700), filled(700));
            let gone: Vec<i64> = (1..=700).filter(|id| id % every != 0).collect();
            at_once.remove(&gone).unwrap();
            for id in gone {
                one_by_one.remove(&[id]).unwrap();
            }
            assert!(content(&at_once) == content(&one_by_one), "{n_left} left");
            assert_eq!(at_once.list(None).unwrap().len(), n_left);
        }
    }

    #[test]
    fn a_deletion_of_most_runs_that_fails_changes_nothing() {
        let library = filled(700);
        let before = content(&library);
        library.connection.execute_batch("CREATE TEMP TABLE left_signals (id)").unwrap();
        let gone: Vec<i64> = (1..=699).collect();
        assert!(library.remove(&gone).is_err());
        assert!(content(&library) == before);
        library.connection.execute_batch("DROP TABLE left_signals").unwrap();
        library.remove(&gone).unwrap();
        assert_eq!(library.list(None).unwrap().len(), 1);
    }
}

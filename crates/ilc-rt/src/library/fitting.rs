//! Runs that a law can learn a task from: found by their columns, their arrays read when they count.

use rusqlite::params;

use super::error::LibraryError;
use super::recall::Task;
use super::row::{Row, as_integer, numbers};
use super::schema;
use super::signals::squares;
use super::store::Library;

/// Runs that a law can learn a task from, oldest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fitting {
    /// Keys, and beginnings of the digests: a run deleted meanwhile may have left its key to another.
    pub runs: Vec<(i64, u64)>,
    /// Disturbances, `n_runs` x `n_disturbances`.
    pub disturbances: Vec<f64>,
    /// Sums of the squares of the errors, `sum_k |e[k]|^2`.
    pub error_squares: Vec<f64>,
    /// Sample time of the newest run, with whatever disturbance.
    pub cycle_s: Option<f64>,
}

impl Library {
    /// Returns the runs that a law can learn a task from: all of this size, with this number of
    /// disturbances, of the same cell, program, measurement and sample time as the newest run of
    /// this size.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn fitting(
        &self,
        n_samples: usize,
        n_axes: usize,
        n_disturbances: usize,
        task: &Task,
    ) -> Result<Fitting, LibraryError> {
        let is_parted = self.version >= schema::PARTED;
        let squares_of = if is_parted { "error_squares" } else { "NULL" };
        let newest = "SELECT cell, program, measure, cycle_s FROM iteration \
            WHERE n_samples = ?1 AND n_axes = ?2 AND (?3 IS NULL OR cell = ?3) \
            ORDER BY id DESC LIMIT 1";
        let query = format!(
            "SELECT id, disturbance, cycle_s, digest, {squares_of} FROM iteration \
            WHERE n_samples = ?1 AND n_axes = ?2 AND (?3 IS NULL OR cell = ?3) \
            AND (cell, program, measure, cycle_s) = ({newest}) ORDER BY id"
        );
        let mut fitting = Fitting::default();
        let mut read = || -> rusqlite::Result<()> {
            let mut statement = self.connection.prepare_cached(&query)?;
            let sizes = params![as_integer(n_samples), as_integer(n_axes), task.cell];
            let mut rows = statement.query(sizes)?;
            while let Some(row) = rows.next()? {
                fitting.cycle_s = Some(row.get(2)?);
                let disturbance = numbers(row.get_ref(1)?.as_str_or_null()?);
                if disturbance.len() == n_disturbances {
                    fitting.runs.push((row.get(0)?, beginning(row.get_ref(3)?.as_str()?)));
                    fitting.disturbances.extend(disturbance);
                    // Not stored if it is not finite.
                    let squares: Option<f64> = row.get(4)?;
                    fitting.error_squares.push(squares.unwrap_or(f64::INFINITY));
                }
            }
            Ok(())
        };
        read().map_err(|source| self.fail(source))?;
        if !is_parted {
            fitting.error_squares.clear();
            for (id, _) in &fitting.runs {
                fitting.error_squares.push(squares(&self.load_unchecked(*id)?.record.error_m));
            }
        }
        Ok(fitting)
    }

    /// Reads a run as [`Library::load`] does; `None` if it has been deleted meanwhile.
    ///
    /// # Errors
    /// As [`Library::load`], except for a missing run.
    pub fn load_if_there(&self, (id, digest): (i64, u64)) -> Result<Option<Row>, LibraryError> {
        match self.load(id) {
            Ok(row) => Ok(Some(row).filter(|row| beginning(&row.digest) == digest)),
            Err(LibraryError::NoSuchRow { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

/// Returns the first 64 bits of a digest in hexadecimal; 0 for another text.
fn beginning(digest: &str) -> u64 {
    digest.get(..16).and_then(|digits| u64::from_str_radix(digits, 16).ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;

    #[test]
    fn runs_like_the_newest_of_their_size_fit() {
        let library = Library::in_memory().unwrap();
        let keys = |n_samples, n_disturbances, task: &Task| -> Vec<i64> {
            let fitting = library.fitting(n_samples, 2, n_disturbances, task).unwrap();
            fitting.runs.iter().map(|(id, _)| *id).collect()
        };
        let task = Task::default();
        assert_eq!(library.fitting(2, 2, 2, &task).unwrap(), Fitting::default());
        for index in 0..2 {
            library.append(&meta("a"), &record(index)).unwrap();
        }
        let mut bare = record(2);
        bare.disturbance.clear();
        library.append(&meta("a"), &bare).unwrap();
        assert_eq!(keys(2, 2, &task), [1, 2]);
        assert_eq!(keys(2, 0, &task), [3]);
        assert!(keys(3, 2, &task).is_empty());
        assert!(keys(2, 2, &Task { cell: Some("other".into()) }).is_empty());
        let fitting = library.fitting(2, 2, 2, &task).unwrap();
        assert_eq!(fitting.disturbances, [record(0).disturbance, record(1).disturbance].concat());
        assert_eq!(fitting.error_squares, [squares(&record(0).error_m); 2]);
        assert_eq!(fitting.cycle_s, Some(0.002));

        assert_eq!(library.load_if_there(fitting.runs[1]).unwrap().unwrap().record, record(1));
        assert!(library.load_if_there((2, 7)).unwrap().is_none(), "another run has its key");
        library.remove(&[1]).unwrap();
        assert!(library.load_if_there(fitting.runs[0]).unwrap().is_none());

        let mut newer = meta("b");
        newer.program = "[1]".into();
        library.append(&newer, &record(0)).unwrap();
        assert_eq!(keys(2, 2, &task), [4], "of the newest program");
    }
}

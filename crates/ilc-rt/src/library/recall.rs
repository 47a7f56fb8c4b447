//! Recall of runs made under a similar disturbance.

use rusqlite::params;

use super::error::LibraryError;
use super::row::{Row, as_integer, numbers};
use super::schema;
use super::store::Library;

/// Runs of the same task; without a name, all that a library holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Task {
    /// Name of the cell.
    pub cell: Option<String>,
}

/// A run, and the distance of its disturbance from the requested one.
#[derive(Clone, Debug, PartialEq)]
pub struct Near {
    /// The run, without its arrays.
    pub row: Row,
    /// Euclidean distance, in the unit of the disturbance.
    pub distance: f64,
}

impl Library {
    /// Returns the `top` runs nearest in disturbance, the nearest one first; of equally near ones
    /// the older. Runs without a disturbance, or with another number of them, are omitted.
    ///
    /// # Errors
    /// [`LibraryError::Disturbance`] for a missing or non-finite disturbance;
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn recall(
        &self,
        disturbance: &[f64],
        top: usize,
        task: &Task,
    ) -> Result<Vec<Near>, LibraryError> {
        if disturbance.is_empty() || disturbance.iter().any(|value| !value.is_finite()) {
            let found = disturbance.to_vec();
            return Err(LibraryError::Disturbance { path: self.path.clone(), found });
        }
        let mut found: Vec<(f64, i64)> = self
            .disturbances(task)?
            .into_iter()
            .filter(|(_, of_run)| of_run.len() == disturbance.len())
            .map(|(id, of_run)| {
                let squares = disturbance.iter().zip(&of_run).map(|(a, b)| (a - b) * (a - b));
                (squares.sum::<f64>().sqrt(), id)
            })
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found
            .into_iter()
            .take(top)
            .map(|(distance, id)| Ok(Near { row: self.figures(id)?, distance }))
            .collect()
    }

    /// Returns the keys of the runs that a law can learn a task from, oldest first, and the sample
    /// time of the newest one: all of this size, with this number of disturbances, of the same
    /// cell, program, measurement and sample time as the newest run of this size.
    ///
    /// # Errors
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    pub fn fitting(
        &self,
        n_samples: usize,
        n_axes: usize,
        n_disturbances: usize,
        task: &Task,
    ) -> Result<(Vec<i64>, Option<f64>), LibraryError> {
        let query = "WITH size AS (SELECT * FROM iteration \
                WHERE n_samples = ?1 AND n_axes = ?2 AND (?3 IS NULL OR cell = ?3)), \
            newest AS (SELECT cell, program, measure, cycle_s FROM size ORDER BY id DESC LIMIT 1) \
            SELECT id, disturbance, cycle_s FROM size \
            WHERE (cell, program, measure, cycle_s) = (SELECT * FROM newest) ORDER BY id";
        let read = |row: &rusqlite::Row<'_>| {
            let disturbance = numbers(row.get::<_, Option<String>>(1)?.as_deref());
            Ok((row.get::<_, i64>(0)?, disturbance.len(), row.get::<_, f64>(2)?))
        };
        let mut statement = self.connection.prepare(query).map_err(|e| self.fail(e))?;
        let rows = statement
            .query_map(params![as_integer(n_samples), as_integer(n_axes), task.cell], read);
        let rows: Vec<(i64, usize, f64)> =
            rows.and_then(Iterator::collect).map_err(|source| self.fail(source))?;
        let cycle_s = rows.last().map(|(_, _, cycle_s)| *cycle_s);
        let fitting = rows.into_iter().filter(|(_, n, _)| *n == n_disturbances);
        Ok((fitting.map(|(id, _, _)| id).collect(), cycle_s))
    }

    /// Reads key and disturbance of every run of a task that has one.
    fn disturbances(&self, task: &Task) -> Result<Vec<(i64, Vec<f64>)>, LibraryError> {
        // Answered from the index alone: the arrays of all runs may be gigabytes.
        let index = if self.version >= schema::INDEXED {
            "INDEXED BY iteration_by_disturbance"
        } else {
            ""
        };
        let query = format!(
            "SELECT id, disturbance FROM iteration {index} \
            WHERE disturbance IS NOT NULL AND (?1 IS NULL OR cell = ?1)"
        );
        let read = |row: &rusqlite::Row<'_>| {
            Ok((row.get(0)?, numbers(row.get::<_, Option<String>>(1)?.as_deref())))
        };
        let mut statement = self.connection.prepare_cached(&query).map_err(|e| self.fail(e))?;
        let rows = statement.query_map(params![task.cell], read);
        rows.and_then(Iterator::collect).map_err(|source| self.fail(source))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;
    use crate::record::IterationRecord;

    #[test]
    fn the_nearest_runs_come_first_and_the_older_of_equals() {
        let library = Library::in_memory().unwrap();
        for (index, d) in (0_u32..).zip([20.0, 30.0, 22.0, 24.0, 20.0]) {
            let run = IterationRecord { disturbance: vec![d], ..record(index) };
            library.append(&meta("a"), &run).unwrap();
        }
        let bare = IterationRecord { disturbance: Vec::new(), ..record(9) };
        library.append(&meta("a"), &bare).unwrap();
        let task = Task::default();
        let found = library.recall(&[21.0], 4, &task).unwrap();
        let indices: Vec<u32> = found.iter().map(|near| near.row.record.index).collect();
        assert_eq!(indices, [0, 2, 4, 3]);
        assert!((found[3].distance - 3.0).abs() < 1e-15);
        assert!((found[0].row.record.figures.update_ms - 0.5).abs() < 1e-15);
        assert!(found[0].row.record.input.is_empty());
        assert!(library.recall(&[21.0, 0.0], 4, &task).unwrap().is_empty());
        assert!(library.recall(&[], 4, &task).is_err());
        assert!(library.recall(&[f64::NAN], 4, &task).is_err());
        let (fitting, cycle_s) = library.fitting(2, 2, 1, &task).unwrap();
        assert_eq!((fitting, cycle_s), (vec![1, 2, 3, 4, 5], Some(0.002)));
        assert_eq!(library.fitting(2, 2, 0, &task).unwrap().0, [6]);
        assert!(library.fitting(3, 2, 1, &task).unwrap().0.is_empty());
        let mut newer = meta("b");
        newer.program = "[1]".into();
        library.append(&newer, &record(0)).unwrap();
        assert!(library.fitting(2, 2, 1, &task).unwrap().0.is_empty(), "of another program");
        let other = Task { cell: Some("other".into()) };
        assert!(library.recall(&[21.0], 4, &other).unwrap().is_empty());
    }
}

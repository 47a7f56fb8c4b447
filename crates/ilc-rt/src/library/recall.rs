//! Recall of runs made under a similar disturbance.

use rusqlite::params;

use super::error::LibraryError;
use super::near::{Search, distance};
use super::once;
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
        let found = if self.version < schema::PARTED {
            self.nearest_of_all(disturbance, top, task)?
        } else {
            self.nearest(disturbance, top, task).map_err(|source| self.fail(source))?
        };
        found
            .into_iter()
            .map(|(distance, id)| Ok(Near { row: self.figures(id)?, distance }))
            .collect()
    }

    /// Returns distances and keys of the nearest runs.
    fn nearest(
        &self,
        disturbance: &[f64],
        top: usize,
        task: &Task,
    ) -> rusqlite::Result<Vec<(f64, i64)>> {
        let cell = match &task.cell {
            None => None,
            Some(name) => match once::cell_key(&self.connection, name)? {
                None => return Ok(Vec::new()),
                key => key,
            },
        };
        let query = "SELECT id FROM iteration WHERE place = ?1 ORDER BY id LIMIT ?2";
        let mut runs_of = self.connection.prepare_cached(query)?;
        let mut search = Search::new(&self.connection, disturbance, cell);
        let mut found: Vec<(f64, i64)> = Vec::new();
        let mut next = search.next()?;
        while let Some((distance, _)) = next.filter(|_| found.len() < top) {
            let n_nearer = found.len();
            // All places at this distance: the older run comes first, wherever it was made.
            while let Some((_, place)) =
                next.filter(|(other, _)| other.total_cmp(&distance).is_eq())
            {
                let ids = runs_of.query_map(params![place, as_integer(top)], |row| row.get(0))?;
                for id in ids {
                    found.push((distance, id?));
                }
                next = search.next()?;
            }
            found[n_nearer..].sort_unstable_by_key(|(_, id)| *id);
        }
        found.truncate(top);
        Ok(found)
    }

    /// Returns distances and keys of the nearest runs of an older file, all of which are compared.
    fn nearest_of_all(
        &self,
        disturbance: &[f64],
        top: usize,
        task: &Task,
    ) -> Result<Vec<(f64, i64)>, LibraryError> {
        let mut found: Vec<(f64, i64)> = self
            .disturbances(task)?
            .into_iter()
            .filter(|(_, of_run)| of_run.len() == disturbance.len())
            .map(|(id, of_run)| (distance(disturbance, &of_run), id))
            .collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        found.truncate(top);
        Ok(found)
    }

    /// Reads key and disturbance of every run of a task that has one, in an older file.
    fn disturbances(&self, task: &Task) -> Result<Vec<(i64, Vec<f64>)>, LibraryError> {
        // Answered from the index alone: the arrays of all runs may be gigabytes.
        let index = if (schema::INDEXED..schema::PARTED).contains(&self.version) {
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
    use crate::record::{IterationRecord, Meta};
    use proptest::prelude::*;

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
        let other = Task { cell: Some("other".into()) };
        assert!(library.recall(&[21.0], 4, &other).unwrap().is_empty());
    }
    proptest! {
        #![proptest_config(ilc_cases::cases(24))]
        // Coarse values make ties, also between places and at the end of the list.
        #[test]
        fn the_tree_finds_what_a_comparison_with_all_runs_finds(
            seed in prop::collection::vec((0_usize..3, 0_usize..8, prop::array::uniform6(-3.0..3.0_f64)), 1..400),
            scale in prop::sample::select(vec![1e-12, 1.0, 1e9, 1e300]),
            coarse in prop::bool::ANY,
            width in 1_usize..=6,
            top in 1_usize..40,
            gone in prop::collection::vec(0_i64..400, 0..60),
        ) {
            let library = Library::in_memory().unwrap();
            let number = |x: f64| scale * if coarse { x.round() } else { x };
            for (index, (cell, shorter, d)) in (0_u32..).zip(&seed) {
                // Some have another number of disturbances.
                let n = if *shorter == 0 { width.saturating_sub(1) } else { width };
                let disturbance = d[..n].iter().map(|&x| number(x)).collect();
                let run = IterationRecord { disturbance, ..record(index) };
                library.append(&Meta { cell: format!("c{cell}"), ..meta("a") }, &run).unwrap();
            }
            library.remove(&gone).unwrap();
            let here: Vec<f64> = [0.4, -1.0, 0.0, 2.0, 1.0, -0.3].map(number)[..width].into();
            for cell in [None, Some("c1".to_owned()), Some("c9".to_owned())] {
                let task = Task { cell };
                let found = library.nearest(&here, top, &task).unwrap();
                prop_assert_eq!(found, library.nearest_of_all(&here, top, &task).unwrap());
            }
        }
    }

    #[test]
    fn what_is_deleted_leaves_no_place_and_no_set_points() {
        let library = Library::in_memory().unwrap();
        for index in 0..300 {
            let mut run = record(index);
            run.disturbance = vec![f64::from(index / 2), 0.0];
            run.reference_m[0] = f64::from(index % 3);
            library.append(&meta("a"), &run).unwrap();
        }
        let count = |table: &str| -> i64 {
            let query = format!("SELECT count(*) FROM {table}");
            library.connection.query_row(&query, [], |row| row.get(0)).unwrap()
        };
        assert_eq!(["place", "near", "reference", "description"].map(count), [150, 150, 3, 2]);
        // The first of the two runs under a disturbance, and all of one path.
        library.remove(&(1..=299).step_by(2).collect::<Vec<i64>>()).unwrap();
        assert_eq!(["place", "near", "signals", "iteration"].map(count), [150; 4]);
        library.discard(&(1..=300).filter(|id| id % 3 != 0).collect::<Vec<i64>>()).unwrap();
        assert_eq!(["place", "near", "signals", "reference"].map(count), [50, 50, 50, 1]);
        library.discard(&(1..=300).collect::<Vec<i64>>()).unwrap();
        assert_eq!(["place", "near", "signals", "reference", "description"].map(count), [0; 5]);
        assert!(library.recall(&[1.0, 0.0], 3, &Task::default()).unwrap().is_empty());
    }
}

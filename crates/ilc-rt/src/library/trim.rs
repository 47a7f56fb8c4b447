//! Deletion of the least relevant runs.

use std::collections::HashSet;

use rusqlite::params;

use super::error::LibraryError;
use super::recall::Task;
use super::row::numbers;
use super::store::Library;
use crate::learning::law::relevance::shares;

/// The part of a run that trimming needs.
struct Candidate {
    id: i64,
    error_square: f64,
    disturbance: Vec<f64>,
}

impl Library {
    /// Deletes all runs of a task except the `keep` most relevant ones, and returns the number of
    /// deleted runs.
    ///
    /// # Errors
    /// As [`Library::least_relevant`] and [`Library::discard`].
    pub fn trim(&self, keep: usize, task: &Task) -> Result<usize, LibraryError> {
        let gone = self.least_relevant(keep, task)?;
        if !gone.is_empty() {
            self.discard(&gone)?;
        }
        Ok(gone.len())
    }

    /// Returns all runs of a task except the `keep` most relevant ones, the oldest first.
    ///
    /// A run's relevance under a disturbance is that of DPW-ILC,
    /// `1 / (E_j + |d - d_j|^2 + epsilon)`, with the square of its RMS error and each disturbance
    /// in units of their mean and variance over these runs, and `epsilon` = 1e-6. Its share is the
    /// sum of its normalised relevance under the disturbances of all runs; the largest shares are
    /// kept, of equal ones the newer. Among runs without a disturbance those with the smallest
    /// error are kept. The shares of more than 2,000 runs are rounded to a few per mille,
    /// `O(n_runs log n_runs)`.
    ///
    /// # Errors
    /// [`LibraryError::Disturbances`] if runs have different numbers of disturbances;
    /// [`LibraryError::Sqlite`] if the file cannot be read.
    /// # Source
    /// - \[dimarco2016\], Eq. (4.12), (4.13), and Sec. 5.1: trimming as future work.
    pub fn least_relevant(&self, keep: usize, task: &Task) -> Result<Vec<i64>, LibraryError> {
        let runs = self.candidates(task)?;
        if runs.len() <= keep {
            return Ok(Vec::new());
        }
        let width = runs[0].disturbance.len();
        if let Some(other) = runs.iter().find(|run| run.disturbance.len() != width) {
            let (ids, found) = ([runs[0].id, other.id], [width, other.disturbance.len()]);
            return Err(LibraryError::Disturbances { path: self.path.clone(), ids, found });
        }
        let n = runs.len() as f64;
        let mean_error = runs.iter().map(|run| run.error_square).sum::<f64>() / n;
        let errors: Vec<f64> =
            runs.iter().map(|run| run.error_square / positive(mean_error)).collect();
        let scales: Vec<(f64, f64)> = (0..width)
            .map(|axis| {
                let mean = runs.iter().map(|run| run.disturbance[axis]).sum::<f64>() / n;
                let squares = runs.iter().map(|run| (run.disturbance[axis] - mean).powi(2));
                (mean, positive((squares.sum::<f64>() / n).sqrt()))
            })
            .collect();
        let places: Vec<f64> = runs
            .iter()
            .flat_map(|run| run.disturbance.iter().zip(&scales))
            .map(|(d, (mean, deviation))| (d - mean) / deviation)
            .collect();
        let shares = shares(&errors, &places, width, 1e-6);
        let mut order: Vec<usize> = (0..runs.len()).collect();
        order.sort_by(|&a, &b| shares[b].total_cmp(&shares[a]).then(b.cmp(&a)));
        let kept: HashSet<usize> = order.into_iter().take(keep).collect();
        let gone = (0..runs.len()).filter(|number| !kept.contains(number));
        Ok(gone.map(|number| runs[number].id).collect())
    }

    fn candidates(&self, task: &Task) -> Result<Vec<Candidate>, LibraryError> {
        let query = "SELECT id, tracking_rms_m, disturbance FROM iteration \
            WHERE ?1 IS NULL OR cell = ?1 ORDER BY id";
        let mut statement = self.connection.prepare(query).map_err(|e| self.fail(e))?;
        let rows = statement.query_map(params![task.cell], |row| {
            Ok(Candidate {
                id: row.get(0)?,
                error_square: row.get::<_, f64>(1)?.powi(2),
                disturbance: numbers(row.get::<_, Option<String>>(2)?.as_deref()),
            })
        });
        rows.and_then(Iterator::collect).map_err(|source| self.fail(source))
    }
}

/// Returns a scale to divide by: 1 for zero.
fn positive(scale: f64) -> f64 {
    if scale > 0.0 { scale } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;
    use crate::record::IterationRecord;

    fn library(runs: &[(f64, &[f64])]) -> Library {
        let library = Library::in_memory().unwrap();
        for (index, (rms, d)) in (0_u32..).zip(runs) {
            let mut run = IterationRecord { disturbance: d.to_vec(), ..record(index) };
            run.figures.tracking_rms_m = *rms;
            library.append(&meta("a"), &run).unwrap();
        }
        library
    }

    fn left(library: &Library) -> Vec<u32> {
        library.list(None).unwrap().iter().map(|row| row.record.index).collect()
    }

    #[test]
    fn the_better_run_of_each_disturbance_stays() {
        let runs: &[(f64, &[f64])] =
            &[(4e-3, &[20.0]), (1e-4, &[20.0]), (3e-3, &[80.0]), (1e-4, &[80.0]), (5e-3, &[50.0])];
        let library = library(runs);
        assert_eq!(library.trim(9, &Task::default()).unwrap(), 0);
        assert_eq!(library.trim(1, &Task { cell: Some("other".into()) }).unwrap(), 0);
        assert_eq!(library.trim(2, &Task::default()).unwrap(), 3);
        assert_eq!(left(&library), [1, 3]);
    }

    #[test]
    fn without_disturbances_the_smallest_errors_stay() {
        let library = library(&[(3e-3, &[]), (1e-3, &[]), (2e-3, &[]), (1e-3, &[])]);
        assert_eq!(library.trim(2, &Task::default()).unwrap(), 2);
        assert_eq!(left(&library), [1, 3]);
        assert_eq!(library.trim(1, &Task::default()).unwrap(), 1);
        assert_eq!(left(&library), [3], "of equals the newer");
    }

    #[test]
    fn runs_that_cannot_be_compared_are_not_trimmed() {
        let library = library(&[(3e-3, &[1.0]), (1e-3, &[1.0, 2.0]), (2e-3, &[])]);
        assert!(library.trim(1, &Task::default()).unwrap_err().to_string().contains("must have"));
        assert_eq!(left(&library).len(), 3);
    }
}

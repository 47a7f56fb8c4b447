//! Earlier runs in the memory of a law, from a library that is read when they count.

use std::sync::Arc;

use super::error::LibraryError;
use super::fitting::Fitting;
use super::held::Held;
use super::recall::Task;
use crate::learning::law::flexible::Flexible;
use crate::learning::law::relevance::{Each, Relevance, Shelf};
use crate::learning::{Law, LearningError};

/// Runs that are read from a library at a time.
const READ: usize = 256;

/// Runs of a library that a law can learn a task from, see [`Library::fitting`](super::Library::fitting).
#[derive(Debug)]
pub struct Earlier {
    library: Arc<Held>,
    fitting: Fitting,
}

impl Earlier {
    /// Finds the runs of this size, with this number of disturbances.
    ///
    /// # Errors
    /// Those of [`Library::fitting`](super::Library::fitting).
    pub fn of(
        library: Arc<Held>,
        n_samples: usize,
        n_axes: usize,
        n_disturbances: usize,
        task: &Task,
    ) -> Result<Self, LibraryError> {
        let fitting =
            library.read(|library| library.fitting(n_samples, n_axes, n_disturbances, task))?;
        Ok(Self { library, fitting })
    }

    /// Returns the sample time of the newest run of this size.
    pub fn cycle_s(&self) -> Option<f64> {
        self.fitting.cycle_s
    }

    /// Adds the runs to an empty memory, which reads their arrays when they count.
    ///
    /// # Errors
    /// - [`LearningError::Shelf`] if they cannot be read; those of [`Relevance::remember_shelf`].
    pub fn put_on_shelf(mut self, law: &mut Relevance) -> Result<(), LearningError> {
        let error_sums = if law.needs_squares_only() {
            let squares = self.fitting.error_squares.iter();
            squares.map(|squares| law.error_sum_of_squares(*squares)).collect()
        } else {
            // Infinite of a run that is gone by now.
            let mut sums = vec![f64::INFINITY; self.fitting.runs.len()];
            self.read_all(&mut |run, _, error| {
                sums[run] = law.error_sum(error);
                Ok(())
            })?;
            sums
        };
        let disturbances = std::mem::take(&mut self.fitting.disturbances);
        law.remember_shelf(Box::new(self), &error_sums, &disturbances)
    }

    /// Adds the runs to the table of a law for runs of this kind.
    ///
    /// # Errors
    /// - [`LearningError::Shelf`] if they cannot be read; those of [`Law::recall`].
    pub fn tabulate(mut self, law: &mut Flexible) -> Result<(), LearningError> {
        let disturbances = std::mem::take(&mut self.fitting.disturbances);
        let width = disturbances.len() / self.fitting.runs.len().max(1);
        self.read_all(&mut |run, input, error| {
            law.recall(input, error, &disturbances[run * width..][..width]).map(drop)
        })
    }

    fn read_all(&mut self, each: &mut Each<'_>) -> Result<(), LearningError> {
        let all: Vec<usize> = (0..self.fitting.runs.len()).collect();
        self.read(&all, each)
    }
}

impl Shelf for Earlier {
    fn read(&mut self, runs: &[usize], each: &mut Each<'_>) -> Result<(), LearningError> {
        // A few at a time, and used when the library is closed: a law that is called may use it, too.
        for (start, few) in (0..).step_by(READ).zip(runs.chunks(READ)) {
            let keys = few.iter().map(|&run| self.fitting.runs[run]);
            let rows = self.library.read(|library| {
                keys.clone().map(|key| library.load_if_there(key)).collect::<Result<Vec<_>, _>>()
            });
            let told = |error: LibraryError| LearningError::Shelf { reason: error.to_string() };
            for (place, row) in (start..).zip(rows.map_err(told)?) {
                if let Some(row) = row {
                    each(place, &row.record.input, &row.record.error_m)?;
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{meta, record};
    use super::*;
    use crate::learning::law::flexible::TableShape;
    use crate::learning::law::pd::{Pd, PdGains};
    use crate::learning::law::q_filter::QFilter;
    use crate::learning::law::relevance::{RelevanceWeights, RunShape};

    /// Three runs of a library; the second is deleted once they have been found.
    fn earlier() -> Earlier {
        let library = Arc::new(Held::new(":memory:".into()).unwrap());
        for index in 0..3 {
            let mut run = record(index);
            run.disturbance = vec![f64::from(index)];
            (run.input, run.error_m) = (vec![f64::from(index); 4], vec![0.5; 4]);
            library.write(|library| library.append(&meta("a"), &run)).unwrap();
        }
        let earlier = Earlier::of(Arc::clone(&library), 2, 2, 1, &Task::default()).unwrap();
        library.write(|library| library.remove(&[2])).unwrap();
        earlier
    }

    fn core() -> Box<dyn Law> {
        let gains = PdGains { kp: 1.0, kd: 0.0, lead_samples: 0 };
        Box::new(Pd::new(gains, 2, 2, QFilter::None).unwrap())
    }

    #[test]
    fn a_memory_has_the_runs_that_are_still_there() {
        for error_rate in [0.0, 1.0] {
            let (n_inputs, n_outputs) = (2, 2);
            let shape =
                RunShape { n_samples: 2, n_inputs, n_outputs, n_disturbances: 1, dt_s: 0.002 };
            let weights =
                RelevanceWeights { error_rate, disturbance: vec![1.0], ..Default::default() };
            let mut law = Relevance::new(core(), shape, weights, None).unwrap();
            let earlier = earlier();
            assert_eq!(earlier.cycle_s(), Some(0.002));
            earlier.put_on_shelf(&mut law).unwrap();
            let mut next = vec![0.0; 4];
            law.set_disturbance(&[2.0]);
            law.update(&[2.0; 4], &[0.5; 4], &mut next).unwrap();
            assert_eq!(law.relevant(&[0.0]).unwrap().len(), 2, "{error_rate}");
        }
    }

    #[test]
    fn a_table_has_the_runs_that_are_still_there() {
        let (n_inputs, n_outputs) = (2, 2);
        let shape =
            TableShape { n_samples: 2, n_inputs, n_outputs, n_disturbances: 1, tolerance: 0.0 };
        let mut law = Flexible::new(core(), shape).unwrap();
        earlier().tabulate(&mut law).unwrap();
        assert_eq!(law.len(), 2);
    }
}

//! Runs of a library in the memory of [`Relevance`]: places at once, arrays when they count.

use super::super::expectation::check as check_disturbance;
use super::Relevance;
use super::proposals::{Kept, Shelf};
use crate::learning::{LearningError, Result};

impl Relevance {
    /// Returns true if the share of a run's sum due to its error follows from the sum of the squares
    /// of its error: `N_e sum_k |e[k]|^2`.
    pub fn needs_squares_only(&self) -> bool {
        self.weights.error_rate <= 0.0
    }

    /// Returns the share of a run's sum due to its error from the sum of its squares, which suffices
    /// without a weight of the error's rate; as [`Relevance::error_sum`], bit by bit.
    pub fn error_sum_of_squares(&self, squares: f64) -> f64 {
        self.weights.error * squares
    }

    /// Returns the share of a run's sum due to its error.
    pub fn error_sum(&self, error: &[f64]) -> f64 {
        self.weights.error_sum(error, self.shape.n_outputs, self.shape.dt_s)
    }

    /// Adds earlier runs to the memory, as [`Relevance::remember`] does one after the other, and
    /// reads each from its shelf when it first counts. A run that has left the shelf by then is
    /// forgotten. To be called once, with an empty memory.
    ///
    /// # Shapes
    /// - `error_sums`: `n_runs`; `disturbances`: `n_runs` x `n_disturbances`
    /// # Errors
    /// - [`LearningError::Disturbance`], [`LearningError::NotFinite`].
    pub fn remember_shelf(
        &mut self,
        shelf: Box<dyn Shelf>,
        error_sums: &[f64],
        disturbances: &[f64],
    ) -> Result {
        let width = self.shape.n_disturbances;
        let expected = error_sums.len() * width;
        if disturbances.len() != expected || !self.is_empty() {
            let found = disturbances.len();
            return Err(LearningError::Disturbance { found, expected });
        }
        for disturbance in disturbances.chunks(width.max(1)) {
            check_disturbance(disturbance, width)?;
        }
        self.index.extend(&self.weights, error_sums, disturbances);
        self.disturbances.extend_from_slice(disturbances);
        self.proposals.put_on_shelf(shelf, error_sums);
        self.is_replayed = true;
        Ok(())
    }

    /// Computes the proposals of those runs that are on the shelf, and returns, in ascending order,
    /// those that are not there any more.
    pub(super) fn fetch(&mut self, runs: &[usize]) -> Result<Vec<usize>> {
        let number = |run: usize| match self.proposals.kept(run) {
            Kept::Shelf(number, _) => Some((number, run)),
            Kept::Row(_) => None,
        };
        let mut wanted: Vec<(usize, usize)> = runs.iter().filter_map(|&run| number(run)).collect();
        if wanted.is_empty() {
            return Ok(Vec::new());
        }
        // In the order in which they are stored.
        wanted.sort_unstable();
        let Some(mut shelf) = self.proposals.lend_shelf() else { return Ok(Vec::new()) };
        let numbers: Vec<usize> = wanted.iter().map(|(number, _)| *number).collect();
        let mut proposal = std::mem::take(&mut self.spare);
        proposal.resize(self.proposal.len(), 0.0);
        let read = shelf.read(&numbers, &mut |place, input, error| {
            self.compute(input, error, &mut proposal)?;
            self.proposals.take_off(wanted[place].1, &proposal);
            Ok(())
        });
        self.proposals.give_back(shelf);
        self.spare = proposal;
        read?;
        let mut gone: Vec<usize> = wanted.into_iter().map(|(_, run)| run).collect();
        gone.retain(|&run| self.proposals.row(run).is_none());
        gone.sort_unstable();
        Ok(gone)
    }

    /// Returns true if the proposal is already stored under this disturbance.
    pub(super) fn knows(&mut self, error: &[f64], disturbance: &[f64]) -> Result<bool> {
        let width = disturbance.len();
        let alike: Vec<usize> = (0..self.len())
            .filter(|run| self.disturbances[run * width..][..width] == *disturbance)
            .collect();
        // On the shelf, a run with another error is another run.
        let sum = self.error_sum(error);
        let on_shelf = |run: &usize| match self.proposals.kept(*run) {
            Kept::Shelf(_, error_sum) => error_sum.to_bits() == sum.to_bits(),
            Kept::Row(_) => false,
        };
        let wanted: Vec<usize> = alike.iter().copied().filter(on_shelf).collect();
        self.fetch(&wanted)?;
        Ok(alike.into_iter().any(|run| self.proposals.row(run) == Some(&self.proposal[..])))
    }
}

#[cfg(test)]
mod tests {
    use super::super::proposals::Each;
    use super::super::{RelevanceWeights, RunShape};
    use super::*;
    use crate::learning::Law;
    use crate::learning::law::pd::{Pd, PdGains};
    use crate::learning::law::q_filter::QFilter;

    const N: usize = 5;

    /// Runs in memory; those without arrays have left.
    struct Runs(Vec<Option<(Vec<f64>, Vec<f64>)>>);

    impl Shelf for Runs {
        fn read(&mut self, runs: &[usize], each: &mut Each<'_>) -> Result {
            for (place, &run) in runs.iter().enumerate() {
                // Read once only.
                if let Some((input, error)) = self.0[run].take() {
                    each(place, &input, &error)?;
                }
            }
            Ok(())
        }
    }

    fn law(error_rate: f64, top: Option<usize>) -> Relevance {
        let shape =
            RunShape { n_samples: N, n_inputs: 1, n_outputs: 1, n_disturbances: 1, dt_s: 0.01 };
        let weights = RelevanceWeights { error_rate, ..Default::default() };
        let gains = PdGains { kp: 0.5, kd: 0.1, lead_samples: 1 };
        let core = Pd::new(gains, N, 1, QFilter::None).unwrap();
        Relevance::new(Box::new(core), shape, weights, top).unwrap()
    }

    fn run(number: usize) -> (Vec<f64>, Vec<f64>, f64) {
        let wave = |scale: f64| (0..N).map(|k| scale * (k * (number + 2)) as f64 % 1.3).collect();
        (wave(0.7), wave(0.11), 20.0 + (number * 7 % 5) as f64)
    }

    fn squares(error: &[f64]) -> f64 {
        error.iter().map(|e| e * e).sum()
    }

    /// Returns a law that remembers runs, and one that has them on a shelf without those gone.
    fn both(n_runs: usize, gone: &[usize], error_rate: f64, top: Option<usize>) -> [Relevance; 2] {
        let (mut eager, mut lazy) = (law(error_rate, top), law(error_rate, top));
        let (mut sums, mut disturbances, mut shelf) = (Vec::new(), Vec::new(), Vec::new());
        for number in 0..n_runs {
            let (input, error, disturbance) = run(number);
            sums.push(if lazy.needs_squares_only() {
                lazy.error_sum_of_squares(squares(&error))
            } else {
                lazy.error_sum(&error)
            });
            disturbances.push(disturbance);
            if gone.contains(&number) {
                shelf.push(None);
            } else {
                eager.remember(&input, &error, &[disturbance]).unwrap();
                shelf.push(Some((input, error)));
            }
        }
        lazy.remember_shelf(Box::new(Runs(shelf)), &sums, &disturbances).unwrap();
        [eager, lazy]
    }

    /// Compares the inputs of both laws over some runs, the first of which were made before.
    fn agree(mut laws: [Relevance; 2], n_replayed: usize) {
        let mut disturbance = run(0).2;
        for law in &mut laws {
            law.set_disturbance(&[disturbance]);
        }
        for number in 0..6 {
            let (input, error, _) = run(if number < n_replayed { number } else { number + 90 });
            disturbance = run(number + 1).2;
            let next: Vec<Vec<u64>> = laws
                .iter_mut()
                .map(|law| {
                    let mut next = vec![0.0; N];
                    law.set_disturbance(&[disturbance]);
                    law.update(&input, &error, &mut next).unwrap();
                    next.into_iter().map(f64::to_bits).collect()
                })
                .collect();
            assert_eq!(next[0], next[1], "run {number}");
        }
        let [eager, lazy] = laws;
        assert_eq!(eager.len(), lazy.len());
        assert_eq!(eager.relevant(&[21.0]).unwrap(), lazy.relevant(&[21.0]).unwrap());
    }

    #[test]
    fn runs_on_a_shelf_count_as_if_they_had_been_read_at_once() {
        for (error_rate, top) in [(0.0, None), (0.0, Some(3)), (2.0, None), (2.0, Some(700))] {
            agree(both(20, &[], error_rate, top), 0);
            agree(both(700, &[], error_rate, top), 4);
        }
    }

    #[test]
    fn runs_that_have_left_the_shelf_are_forgotten() {
        agree(both(20, &[0, 3, 4, 5, 17], 0.0, None), 0);
        let [mut eager, mut lazy] = both(3, &[0, 1, 2], 0.0, Some(2));
        let (input, error, _) = run(1);
        for law in [&mut eager, &mut lazy] {
            let mut next = vec![0.0; N];
            law.set_disturbance(&[20.0]);
            law.update(&input, &error, &mut next).unwrap();
            assert_eq!(next, law.proposal);
            assert!(law.is_empty());
        }
    }

    #[test]
    fn a_shelf_that_cannot_be_read_is_told_and_may_be_read_later() {
        struct Broken(bool);
        impl Shelf for Broken {
            fn read(&mut self, runs: &[usize], each: &mut Each<'_>) -> Result {
                if std::mem::take(&mut self.0) {
                    return Err(LearningError::Shelf { reason: "locked".to_owned() });
                }
                (0..runs.len()).try_for_each(|place| each(place, &[1.0; N], &[0.5; N]))
            }
        }
        let mut law = law(0.0, None);
        law.remember_shelf(Box::new(Broken(true)), &[1.0], &[20.0]).unwrap();
        assert!(law.remember_shelf(Box::new(Broken(false)), &[1.0], &[20.0]).is_err());
        law.set_disturbance(&[20.0]);
        let mut next = [0.0; N];
        let refused = law.update(&[0.0; N], &[1.0; N], &mut next).unwrap_err();
        assert!(refused.to_string().contains("locked"), "{refused}");
        law.update(&[0.0; N], &[1.0; N], &mut next).unwrap();
        law.reset();
        assert!(law.is_empty());
    }
}

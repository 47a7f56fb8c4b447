//! The most relevant runs out of many: a nearest-neighbour query (k-d tree).

use std::num::NonZero;

use ilc_numerics::{Neighbours, neighbours};

use super::weights::RelevanceWeights;

/// Largest number of disturbances.
pub(super) const DISTURBANCES_MAX: usize = 7;
/// Largest number of coordinates of a run: its error and its disturbance.
const COORDINATES_MAX: usize = 1 + DISTURBANCES_MAX;
/// Number of runs up to which a linear search is faster than a tree.
const FEW: usize = 512;
/// Margin within which the tree's rounding must not decide.
const ROUNDING: f64 = 1e-9;

/// Places of the runs, and the nearest of them.
pub(super) trait Index: Send + std::fmt::Debug {
    /// Adds a run.
    fn push(&mut self, weights: &RelevanceWeights, error_sum: f64, disturbance: &[f64]);
    /// Adds runs with as many disturbances each as there are coordinates for them.
    fn extend(&mut self, weights: &RelevanceWeights, error_sums: &[f64], disturbances: &[f64]);
    /// Reserves space for `n` runs in all.
    fn reserve(&mut self, n: usize);
    /// Writes the sums of all runs for a disturbance.
    fn sums(&self, weights: &RelevanceWeights, disturbance: &[f64], sums: &mut Vec<f64>);
    /// Writes indices and sums of the `top` most relevant runs, the most relevant one first; of
    /// equally relevant ones the older first.
    fn nearest(
        &self,
        weights: &RelevanceWeights,
        disturbance: &[f64],
        top: usize,
        found: &mut Vec<(usize, f64)>,
    );
    /// Keeps only these runs, given in ascending order.
    fn retain(&mut self, kept: &[usize]);
}

/// Returns an empty index for runs of `n_samples` under `n_disturbances`; `None` for too many
/// disturbances.
pub(super) fn index(n_samples: usize, n_disturbances: usize) -> Option<Box<dyn Index>> {
    Some(match n_disturbances + 1 {
        1 => Box::new(Grown::<1>::new(n_samples)),
        2 => Box::new(Grown::<2>::new(n_samples)),
        3 => Box::new(Grown::<3>::new(n_samples)),
        4 => Box::new(Grown::<4>::new(n_samples)),
        5 => Box::new(Grown::<5>::new(n_samples)),
        6 => Box::new(Grown::<6>::new(n_samples)),
        7 => Box::new(Grown::<7>::new(n_samples)),
        COORDINATES_MAX => Box::new(Grown::<COORDINATES_MAX>::new(n_samples)),
        _ => return None,
    })
}

/// A tree over the older runs, and the newer ones, which are searched linearly.
///
/// The tree is rebuilt after an insertion of a few times the square root of the number of runs.
struct Grown<const K: usize> {
    n_samples: usize,
    places: Vec<[f64; K]>,
    tree: Option<Box<dyn Neighbours>>,
    n_in_tree: usize,
}

impl<const K: usize> Grown<K> {
    fn new(n_samples: usize) -> Self {
        Self { n_samples, places: Vec::new(), tree: None, n_in_tree: 0 }
    }

    fn grow_tree(&mut self) {
        let n = self.places.len();
        let behind = n - self.n_in_tree;
        if behind > FEW && behind * behind > 16 * n {
            self.tree = neighbours(self.places.as_flattened(), K);
            self.n_in_tree = if self.tree.is_some() { n } else { 0 };
        }
    }
}

impl<const K: usize> std::fmt::Debug for Grown<K> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (n, n_in_tree) = (self.places.len(), self.n_in_tree);
        write!(f, "{n} runs in {K} dimensions, {n_in_tree} of them in a tree")
    }
}

/// Returns the squared distance, always computed in this way, so that equal runs compare equal.
fn distance<const K: usize>(a: &[f64; K], b: &[f64; K]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

impl<const K: usize> Index for Grown<K> {
    fn push(&mut self, weights: &RelevanceWeights, error_sum: f64, disturbance: &[f64]) {
        self.places.push(weights.place(error_sum, disturbance, self.n_samples));
        self.grow_tree();
    }

    fn extend(&mut self, weights: &RelevanceWeights, error_sums: &[f64], disturbances: &[f64]) {
        let width = K - 1;
        self.places.extend(error_sums.iter().enumerate().map(|(run, sum)| {
            weights.place::<K>(*sum, &disturbances[run * width..][..width], self.n_samples)
        }));
        self.grow_tree();
    }

    fn reserve(&mut self, n: usize) {
        self.places.reserve(n.saturating_sub(self.places.len()));
    }

    fn sums(&self, weights: &RelevanceWeights, disturbance: &[f64], sums: &mut Vec<f64>) {
        let here = weights.place::<K>(0.0, disturbance, self.n_samples);
        sums.clear();
        sums.extend(self.places.iter().map(|place| distance(place, &here)));
    }

    fn nearest(
        &self,
        weights: &RelevanceWeights,
        disturbance: &[f64],
        top: usize,
        found: &mut Vec<(usize, f64)>,
    ) {
        let here = weights.place::<K>(0.0, disturbance, self.n_samples);
        found.clear();
        let of = |number: usize| (number, distance(&self.places[number], &here));
        if let (Some(tree), Some(n)) = (&self.tree, NonZero::new(top.min(self.n_in_tree))) {
            // Any n runs bound the distance of the n-th nearest one. Everything within that bound
            // is compared again here, so that neither the tree's rounding nor its order of ties
            // decides.
            let bound = tree.squared_distance(&here, n) * (1.0 + ROUNDING) + f64::MIN_POSITIVE;
            tree.within(&here, bound, &mut |number| found.push(of(number)));
        }
        found.extend((self.n_in_tree..self.places.len()).map(of));
        let order =
            |a: &(usize, f64), b: &(usize, f64)| a.1.total_cmp(&b.1).then_with(|| a.0.cmp(&b.0));
        if (1..found.len()).contains(&top) {
            found.select_nth_unstable_by(top - 1, order);
        }
        found.truncate(top);
        found.sort_unstable_by(order);
    }

    fn retain(&mut self, kept: &[usize]) {
        for (to, &from) in kept.iter().enumerate() {
            self.places[to] = self.places[from];
        }
        self.places.truncate(kept.len());
        (self.tree, self.n_in_tree) = (None, 0);
        self.grow_tree();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Brute force: all sums, sorted, ties by index.
    fn brute(index: &dyn Index, weights: &RelevanceWeights, d: &[f64], top: usize) -> Vec<usize> {
        let mut sums = Vec::new();
        index.sums(weights, d, &mut sums);
        let mut numbers: Vec<usize> = (0..sums.len()).collect();
        numbers.sort_by(|&a, &b| sums[a].total_cmp(&sums[b]).then(a.cmp(&b)));
        numbers.truncate(top);
        numbers
    }

    fn agree(runs: &[(f64, Vec<f64>)], weights: RelevanceWeights, at: &[f64], top: usize) {
        let weights = weights.spread(at.len()).unwrap();
        let mut index = index(7, at.len()).unwrap();
        let mut found = Vec::new();
        for (n, (error_sum, disturbance)) in runs.iter().enumerate() {
            index.push(&weights, *error_sum, disturbance);
            if n % 301 == 0 || n + 1 == runs.len() {
                index.nearest(&weights, at, top, &mut found);
                let numbers: Vec<usize> = found.iter().map(|(number, _)| *number).collect();
                assert_eq!(numbers, brute(index.as_ref(), &weights, at, top));
            }
        }
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(40))]
        // Coarse values make ties, also at the boundary of the selection.
        #[test]
        fn the_tree_and_brute_force_find_the_same_runs(
            coarse in prop::bool::ANY,
            n_disturbances in 0_usize..=7,
            top in 1_usize..60,
            seed in prop::collection::vec((0.0..4.0_f64, prop::collection::vec(-3.0..3.0_f64, 7)), 600..2500),
            weight in 0.0..2.0_f64,
        ) {
            let rounded = |x: f64| if coarse { x.round() } else { x };
            let runs: Vec<(f64, Vec<f64>)> = seed
                .iter()
                .map(|(e, d)| (rounded(*e), d[..n_disturbances].iter().map(|&d| rounded(d)).collect()))
                .collect();
            let weights = RelevanceWeights { disturbance: vec![weight], ..Default::default() };
            let at = vec![0.5; n_disturbances];
            agree(&runs, weights, &at, top);
        }
    }

    #[test]
    fn runs_that_are_all_alike_are_taken_in_order() {
        let runs = vec![(1.0, vec![20.0]); 5000];
        agree(&runs, RelevanceWeights::default(), &[20.0], 30);
        let perfect = vec![(0.0, vec![20.0]); 2000];
        agree(&perfect, RelevanceWeights::default(), &[20.0], 30);
    }

    #[test]
    fn extreme_runs_break_nothing() {
        let runs: Vec<(f64, Vec<f64>)> = (0..2000)
            .map(|k| {
                (f64::MAX / f64::from(k + 1), vec![f64::MAX * if k % 2 == 0 { 1.0 } else { -1.0 }])
            })
            .chain((0..50).map(|k| (f64::from(k) * 1e-300, vec![0.0])))
            .collect();
        agree(&runs, RelevanceWeights::default(), &[0.0], 40);
        agree(&runs, RelevanceWeights::default(), &[f64::MAX], 40);
    }

    #[test]
    fn eight_disturbances_are_too_many() {
        assert!(index(5, 7).is_some() && index(5, 8).is_none());
    }
}

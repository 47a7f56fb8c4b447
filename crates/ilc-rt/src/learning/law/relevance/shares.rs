//! Total weights of runs under the disturbances of all: which runs to keep.
//!
//! A run's relevance `1 / (E_j + |d - d_j|^2 + epsilon)` is the inverse square of a distance, between
//! `(d, 0)` and `(d_j, sqrt(E_j + epsilon))`. So the sums over many runs are those of a potential, and
//! a group of runs far away counts by its weight, its centre and its second moments.
//!
//! Source: J. Barnes, P. Hut, "A hierarchical O(N log N) force-calculation algorithm", Nature 324,
//! 1986.

use super::weights::normalise;

/// Number of runs up to which all pairs are summed.
const FEW: usize = 2000;
/// Largest radius of a group that is summed as a whole, in units of its distance.
const OPENING: f64 = 0.35;
/// Points of a group that is not divided.
const LEAF: usize = 12;

/// Returns the total weight of each run under the disturbances of all: the sums of Eq. (4.13).
///
/// `disturbances` are the runs' own, already weighted, `width` numbers each. Up to 2,000 runs, or
/// without disturbances, the sums are exact; beyond, groups of runs are summed as a whole, which
/// changes a share by a few per mille, `O(n_runs log n_runs)`.
///
/// # Source
/// - \[dimarco2016\], Eq. (4.12), (4.13).
pub(crate) fn shares(
    error_sums: &[f64],
    disturbances: &[f64],
    width: usize,
    epsilon: f64,
) -> Vec<f64> {
    if width == 0 || error_sums.len() <= FEW {
        return exact(error_sums, disturbances, width, epsilon);
    }
    let place = |run: usize, height: f64| {
        disturbances[run * width..][..width].iter().copied().chain([height])
    };
    let runs = 0..error_sums.len();
    let heights = error_sums.iter().map(|sum| (sum + epsilon).sqrt());
    let above: Vec<f64> = heights.enumerate().flat_map(|(run, h)| place(run, h)).collect();
    let below: Vec<f64> = runs.clone().flat_map(|run| place(run, 0.0)).collect();
    let dimension = width + 1;
    let ones = vec![1.0; error_sums.len()];
    let totals = Groups::new(&above, &ones, dimension).potentials(&below);
    let parts: Vec<f64> = totals.iter().map(|total| 1.0 / total).collect();
    Groups::new(&below, &parts, dimension).potentials(&above)
}

/// Returns the exact sums, `O(n_runs^2)`.
fn exact(error_sums: &[f64], disturbances: &[f64], width: usize, epsilon: f64) -> Vec<f64> {
    let mut shares = vec![0.0; error_sums.len()];
    let mut sums = vec![0.0; error_sums.len()];
    // Without disturbances every pass is the same.
    let n_looks = if width == 0 { 1 } else { error_sums.len() };
    for look in 0..n_looks {
        let here = &disturbances[look * width..][..width];
        for (run, (sum, error_sum)) in sums.iter_mut().zip(error_sums).enumerate() {
            let there = &disturbances[run * width..][..width];
            *sum = error_sum + square(here, there);
        }
        normalise(&mut sums, epsilon);
        for (share, weight) in shares.iter_mut().zip(&sums) {
            *share += weight;
        }
    }
    shares
}

fn square(here: &[f64], there: &[f64]) -> f64 {
    here.iter().zip(there).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// A group of points, and its halves.
struct Group {
    /// Its points.
    points: std::ops::Range<usize>,
    weight: f64,
    /// Square of the distance from which it is summed as a whole.
    far: f64,
    /// The group after this one and its halves, in the order of a walk.
    after: usize,
}

/// Weighted points in nested groups, in the order of a walk from the whole to its parts.
struct Groups {
    dimension: usize,
    /// Points in the order of the groups, and their weights.
    points: Vec<f64>,
    weights: Vec<f64>,
    all: Vec<Group>,
    /// Centres of weight of the groups.
    centres: Vec<f64>,
    /// Second moments of the groups about their centres, `dimension` x `dimension`.
    moments: Vec<f64>,
}

impl Groups {
    fn new(points: &[f64], weights: &[f64], dimension: usize) -> Self {
        let mut order: Vec<usize> = (0..weights.len()).collect();
        let mut groups = Self {
            dimension,
            points: Vec::with_capacity(points.len()),
            weights: Vec::with_capacity(weights.len()),
            all: Vec::new(),
            centres: Vec::new(),
            moments: Vec::new(),
        };
        groups.divide(&mut order, points, weights);
        groups
    }

    /// Adds a group of these points, and its halves.
    fn divide(&mut self, order: &mut [usize], points: &[f64], weights: &[f64]) {
        let dimension = self.dimension;
        let point = |number: usize| &points[number * dimension..][..dimension];
        let weight: f64 = order.iter().map(|&number| weights[number]).sum();
        let mut centre = vec![0.0; dimension];
        let mut ends = vec![(f64::INFINITY, f64::NEG_INFINITY); dimension];
        for &number in order.iter() {
            for ((sum, (low, high)), x) in centre.iter_mut().zip(&mut ends).zip(point(number)) {
                *sum += weights[number] / weight * x;
                (*low, *high) = (low.min(*x), high.max(*x));
            }
        }
        let mut moments = vec![0.0; dimension * dimension];
        for &number in order.iter() {
            for (row, (a, at)) in point(number).iter().zip(&centre).enumerate() {
                for (column, (b, bt)) in point(number).iter().zip(&centre).enumerate() {
                    moments[row * dimension + column] += weights[number] * (a - at) * (b - bt);
                }
            }
        }
        let radius = order.iter().map(|&n| square(&centre, point(n))).fold(0.0, f64::max);
        let this = self.all.len();
        let start = self.weights.len();
        let far = radius / (OPENING * OPENING);
        self.all.push(Group { points: start..start + order.len(), weight, far, after: 0 });
        self.centres.extend_from_slice(&centre);
        self.moments.extend_from_slice(&moments);
        if order.len() <= LEAF {
            for &number in order.iter() {
                self.points.extend_from_slice(point(number));
                self.weights.push(weights[number]);
            }
        } else {
            let length = |axis: &usize| ends[*axis].1 - ends[*axis].0;
            let longest = (0..dimension).max_by(|a, b| length(a).total_cmp(&length(b)));
            let axis = longest.unwrap_or(0);
            let middle = order.len() / 2;
            order
                .select_nth_unstable_by(middle, |a, b| point(*a)[axis].total_cmp(&point(*b)[axis]));
            let (low, high) = order.split_at_mut(middle);
            self.divide(low, points, weights);
            self.divide(high, points, weights);
        }
        self.all[this].after = self.all.len();
    }

    /// Returns the sum of `weight / distance^2` over all points, at each of these places.
    fn potentials(&self, places: &[f64]) -> Vec<f64> {
        places.chunks_exact(self.dimension).map(|place| self.potential(place)).collect()
    }

    fn potential(&self, place: &[f64]) -> f64 {
        let dimension = self.dimension;
        let (mut sum, mut next) = (0.0, 0);
        while let Some(group) = self.all.get(next) {
            let centre = &self.centres[next * dimension..][..dimension];
            let apart = square(place, centre);
            if apart > group.far {
                let n_moments = dimension * dimension;
                let moments = &self.moments[next * n_moments..][..n_moments];
                sum += whole(group.weight, apart, place, centre, moments);
                next = group.after;
                continue;
            }
            next += 1;
            if next == group.after {
                for number in group.points.clone() {
                    let point = &self.points[number * dimension..][..dimension];
                    sum += self.weights[number] / square(place, point);
                }
            }
        }
        sum
    }
}

/// Returns the potential of a group from its moments up to the second, `r` from its centre.
///
/// `W / r^2 - tr M / r^4 + 4 r' M r / r^6`
fn whole(weight: f64, apart: f64, place: &[f64], centre: &[f64], moments: &[f64]) -> f64 {
    let (mut along, mut trace) = (0.0, 0.0);
    let rows = moments.chunks_exact(place.len());
    for (axis, (row, (x, c))) in rows.zip(place.iter().zip(centre)).enumerate() {
        let product: f64 =
            row.iter().zip(place.iter().zip(centre)).map(|(m, (x, c))| m * (x - c)).sum();
        along += (x - c) * product;
        trace += row[axis];
    }
    (weight + (4.0 * along / apart - trace) / apart) / apart
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of a fixed, uneven spread: clusters, ties and a few far away.
    fn runs(n: u32, width: usize) -> (Vec<f64>, Vec<f64>) {
        let wave = |k: u32, rate: f64| (f64::from(k) * rate).sin();
        let errors = (0..n).map(|k| (3.0 * wave(k, 1.7)).exp()).collect();
        let disturbances = (0..n).flat_map(|k| {
            (0..width).map(move |axis| {
                let rate = 0.013 + 0.371 * axis as f64;
                match k % 10 {
                    0 => 1.5,
                    1 => 8.0 * wave(k, rate),
                    _ => wave(k, rate).powi(3) + 2.0 * f64::from(k % 3),
                }
            })
        });
        (errors, disturbances.collect())
    }

    #[test]
    fn groups_change_a_share_by_per_milles() {
        for width in [1, 2, 3, 5] {
            let (errors, disturbances) = runs(2500, width);
            let exact = exact(&errors, &disturbances, width, 1e-6);
            let quick = shares(&errors, &disturbances, width, 1e-6);
            let apart = exact.iter().zip(&quick).map(|(a, b)| ((a - b) / a).abs());
            let (sum, largest) =
                apart.fold((0.0, 0.0_f64), |(sum, largest), x| (sum + x, largest.max(x)));
            let mean = sum / exact.len() as f64;
            assert!(mean < 5e-3 && largest < 0.05, "{width}: mean {mean}, largest {largest}");
            assert!((quick.iter().sum::<f64>() / 2500.0 - 1.0).abs() < 5e-3);
        }
    }

    #[test]
    fn runs_that_are_all_alike_have_equal_shares() {
        let shares = shares(&vec![1.0; 3000], &vec![0.5; 3000], 1, 1e-6);
        assert!(shares.iter().all(|share| (share - 1.0).abs() < 1e-9));
    }

    #[test]
    fn up_to_a_number_of_runs_the_sums_are_exact() {
        // Denominators 1 and 2 under the first, 2 and 1 under the second disturbance.
        let shares = shares(&[0.0, 0.0], &[0.0, 1.0], 1, 1.0);
        assert!(shares.iter().all(|share| (share - 1.0).abs() < 1e-15));
    }
}

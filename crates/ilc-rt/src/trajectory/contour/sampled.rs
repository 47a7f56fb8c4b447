//! The nearest point of a whole sampled path, by a spatial index (k-d tree).

use std::num::NonZero;

use ilc_numerics::{COORDINATES_MAX, Neighbours, neighbours};

use super::ContourError;

/// The place of a path that is nearest to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest<const N: usize> {
    /// Distance.
    pub distance_m: f64,
    /// The nearest point of the path.
    pub foot_m: [f64; N],
    /// Its position along the path: the sample before it plus the fraction of the step to the next.
    pub sample: f64,
}

/// The polyline through the samples of a path, with an index over its pieces.
///
/// Long steps are cut, so that no piece is longer than the mean step: then the midpoint of the
/// nearest piece is within half a mean step of the nearest midpoint, and a query examines only
/// those. The result is exact for the polyline.
///
/// # Real Time
/// Cold. `O(n log n)` to create; `O(log n)` per query near the path.
#[derive(Debug)]
pub struct SampledPath<const N: usize> {
    samples_m: Vec<[f64; N]>,
    /// The step that each piece belongs to.
    steps: Vec<usize>,
    index: Option<Box<dyn Neighbours>>,
    piece_max_m: f64,
}

impl<const N: usize> SampledPath<N> {
    /// Creates the index over the samples of a path, time first.
    ///
    /// # Errors
    /// - [`ContourError::NotFinite`] for a sample that is infinite or NaN.
    /// - [`ContourError::Empty`] without samples.
    pub fn new(samples_m: &[[f64; N]]) -> Result<Self, ContourError> {
        const { assert!(1 <= N && N <= COORDINATES_MAX, "coordinates of a point") };
        if samples_m.is_empty() {
            return Err(ContourError::Empty);
        }
        for (sample, point_m) in samples_m.iter().enumerate() {
            for (axis, value) in point_m.iter().enumerate() {
                if !value.is_finite() {
                    return Err(ContourError::NotFinite { sample, axis, value: *value });
                }
            }
        }
        let lengths_m: Vec<f64> =
            samples_m.windows(2).map(|pair| distance_m(&pair[0], &pair[1])).collect();
        let n_moving = lengths_m.iter().filter(|length| **length > 0.0).count();
        let piece_max_m = lengths_m.iter().sum::<f64>() / n_moving.max(1) as f64;
        let (mut middles, mut steps) = (Vec::<[f64; N]>::new(), Vec::new());
        for (step, length_m) in lengths_m.iter().enumerate() {
            if *length_m > 0.0 {
                let pieces = (length_m / piece_max_m).ceil().max(1.0);
                let (from, to) = (&samples_m[step], &samples_m[step + 1]);
                let mut piece = 0.5;
                while piece < pieces {
                    middles.push(between(from, to, piece / pieces));
                    steps.push(step);
                    piece += 1.0;
                }
            }
        }
        let index = if middles.is_empty() {
            None
        } else {
            Some(neighbours(middles.as_flattened(), N).ok_or(ContourError::Empty)?)
        };
        Ok(Self { samples_m: samples_m.to_vec(), steps, index, piece_max_m })
    }

    /// Returns the distance of each point to the whole path through the samples of a reference.
    ///
    /// # Shapes
    /// - `reference_m`, `actual_m`: rows of `N` coordinates; returns one distance per row of `actual_m`, NaN for one
    ///   that is not finite
    /// # Errors
    /// Those of [`SampledPath::new`].
    pub fn contour_error_m(
        reference_m: &[f64],
        actual_m: &[f64],
    ) -> Result<Vec<f64>, ContourError> {
        let path = Self::new(reference_m.as_chunks().0)?;
        let distance = |point| path.nearest(point).map_or(f64::NAN, |found| found.distance_m);
        Ok(actual_m.as_chunks().0.iter().map(distance).collect())
    }

    /// Returns the nearest point of the path; `None` for a point that is not finite.
    pub fn nearest(&self, point_m: &[f64; N]) -> Option<Nearest<N>> {
        if point_m.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let first = self.samples_m.first()?;
        let rest = Nearest { distance_m: distance_m(point_m, first), foot_m: *first, sample: 0.0 };
        let Some(index) = &self.index else { return Some(rest) };
        let middle = index.squared_distance(point_m, NonZero::<usize>::MIN).sqrt();
        // Slightly more than half a piece, so that rounding of a square root hides nothing.
        let reach_m = (middle + 0.5 * self.piece_max_m) * (1.0 + 1e-12);
        let mut best: Option<Nearest<N>> = None;
        index.within(point_m, reach_m * reach_m, &mut |piece| {
            let step = self.steps[piece];
            let found = self.on_step(point_m, step);
            let is_better = best.is_none_or(|best| {
                found.distance_m < best.distance_m
                    || (found.distance_m <= best.distance_m && found.sample < best.sample)
            });
            if is_better {
                best = Some(found);
            }
        });
        Some(best.unwrap_or(rest))
    }

    fn on_step(&self, point_m: &[f64; N], step: usize) -> Nearest<N> {
        let (from, to) = (&self.samples_m[step], &self.samples_m[step + 1]);
        let (mut length_squared, mut projection) = (0.0, 0.0);
        for axis in 0..N {
            let along = to[axis] - from[axis];
            length_squared += along * along;
            projection += (point_m[axis] - from[axis]) * along;
        }
        let share =
            if length_squared > 0.0 { (projection / length_squared).clamp(0.0, 1.0) } else { 0.0 };
        let foot_m = between(from, to, share);
        Nearest { distance_m: distance_m(point_m, &foot_m), foot_m, sample: step as f64 + share }
    }
}

fn between<const N: usize>(from: &[f64; N], to: &[f64; N], share: f64) -> [f64; N] {
    std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis]))
}

fn distance_m<const N: usize>(one: &[f64; N], other: &[f64; N]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    #[test]
    fn points_have_their_distances_to_the_whole_path() {
        let reference_m = [0.0, 0.0, 1.0, 0.0];
        let found =
            SampledPath::<2>::contour_error_m(&reference_m, &[0.5, 0.25, 1.0, -3.0, f64::NAN, 0.0]);
        let found = found.unwrap();
        assert_eq!(found[..2], [0.25, 3.0]);
        assert!(found[2].is_nan() && found.len() == 3);
        assert!(SampledPath::<2>::contour_error_m(&[], &[0.0, 0.0]).is_err());
    }

    fn exhaustive<const N: usize>(path: &SampledPath<N>, point_m: &[f64; N]) -> f64 {
        (0..path.samples_m.len() - 1)
            .map(|step| path.on_step(point_m, step).distance_m)
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_point_beside_a_line_is_hand_computed() {
        let path = SampledPath::new(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]).unwrap();
        let found = path.nearest(&[1.25, -0.5]).unwrap();
        assert!((found.distance_m - 0.5).abs() < 1e-15 && (found.sample - 1.25).abs() < 1e-15);
        assert!((found.foot_m[0] - 1.25).abs() < 1e-15);
        let beyond = path.nearest(&[5.0, 4.0]).unwrap();
        assert!((beyond.distance_m - 5.0).abs() < 1e-15);
        assert_eq!(path.nearest(&[f64::NAN, 0.0]), None);
    }

    #[test]
    fn the_index_finds_what_trying_everything_finds() {
        let mut random = Random(4);
        for case in 0..60 {
            let n = 2 + case * 7;
            let scale = random.log(1e-3, 1e3);
            let mut at = [0.0; 3];
            let samples: Vec<[f64; 3]> = (0..n)
                .map(|_| {
                    // Uneven steps and rests.
                    let step =
                        if random.unit() < 0.2 { 0.0 } else { scale * random.log(1e-3, 1.0) };
                    at = at.map(|value| value + step * random.signed());
                    at
                })
                .collect();
            let path = SampledPath::new(&samples).unwrap();
            for _ in 0..50 {
                let point = samples[case % n].map(|value| value + scale * random.signed());
                let found = path.nearest(&point).unwrap();
                let wanted = exhaustive(&path, &point);
                assert!((found.distance_m - wanted).abs() <= 1e-12 * wanted.max(scale * 1e-3));
            }
        }
    }

    #[test]
    fn a_path_that_goes_the_same_way_many_times_is_indexed() {
        let there_and_back =
            |k: u32| [f64::from(if k % 200 < 100 { k % 200 } else { 199 - k % 200 }), 0.0];
        let samples: Vec<[f64; 2]> = (0..20_000).map(there_and_back).collect();
        let path = SampledPath::new(&samples).unwrap();
        let found = path.nearest(&[50.25, 2.0]).unwrap();
        assert!((found.distance_m - 2.0).abs() < 1e-15 && (found.sample - 50.25).abs() < 1e-9);
    }

    #[test]
    fn a_path_at_rest_and_wrong_samples() {
        let rest = SampledPath::new(&[[1.0, 2.0]; 5]).unwrap();
        assert!((rest.nearest(&[4.0, 6.0]).unwrap().distance_m - 5.0).abs() < 1e-15);
        assert!(SampledPath::<2>::new(&[]).is_err());
        assert!(SampledPath::new(&[[1.0, f64::INFINITY]]).is_err());
    }
}

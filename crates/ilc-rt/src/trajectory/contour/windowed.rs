//! Contour error near a point's own time: distance of the measured points from the reference path
//! within a time window. Cold.

use crate::interpolate::MAX_AXES;

/// Distance of each measured point to the path near its own time.
///
/// The path is the polyline through the reference samples from `window` before to `window` after
/// the sample of the same time; the distance is exact (point to segment), for 1 to [`MAX_AXES`]
/// axes. Repeated points while the path rests count as points.
///
/// # Shapes
/// - `reference_m`, `actual_m`: `n_samples * n_axes`, time first; a trailing part of a sample is
///   ignored, and measured samples after the end of the reference belong to its last sample
/// - returns one distance for each measured sample; NaN for one that is not finite, or without a
///   reference; nothing for another number of axes
/// # Real Time
/// Cold. About `O(n_samples log window)`: if the path is farther away than the best distance so
/// far, the search skips ahead by as many samples as the path needs to come nearer.
pub fn contour_error_m(
    reference_m: &[f64],
    actual_m: &[f64],
    n_axes: usize,
    window: usize,
) -> Vec<f64> {
    // A width known at compile time makes the inner loop several times as fast.
    match n_axes {
        1 => distances_m::<1>(reference_m, actual_m, window),
        2 => distances_m::<2>(reference_m, actual_m, window),
        3 => distances_m::<3>(reference_m, actual_m, window),
        4 => distances_m::<4>(reference_m, actual_m, window),
        5 => distances_m::<5>(reference_m, actual_m, window),
        6 => distances_m::<6>(reference_m, actual_m, window),
        7..=MAX_AXES => {
            let pad = |values: &[f64]| -> Vec<f64> {
                let row = |row: &[f64]| {
                    let mut wide = [0.0; MAX_AXES];
                    wide[..n_axes].copy_from_slice(row);
                    wide
                };
                values.chunks_exact(n_axes).flat_map(row).collect()
            };
            distances_m::<MAX_AXES>(&pad(reference_m), &pad(actual_m), window)
        }
        _ => Vec::new(),
    }
}

fn distances_m<const N: usize>(reference_m: &[f64], actual_m: &[f64], window: usize) -> Vec<f64> {
    let path = Path::new(reference_m.as_chunks::<N>().0);
    let nearest = |(k, point_m)| path.distance_m(point_m, k, window);
    actual_m.as_chunks::<N>().0.iter().enumerate().map(nearest).collect()
}

/// The polyline through the reference samples.
struct Path<'a, const N: usize> {
    samples_m: &'a [[f64; N]],
    /// Longest step from one sample to the next: the path cannot approach faster.
    step_max_m: f64,
}

impl<'a, const N: usize> Path<'a, N> {
    fn new(samples_m: &'a [[f64; N]]) -> Self {
        let step_max_m =
            samples_m.windows(2).map(|pair| distance_m(&pair[0], &pair[1])).fold(0.0, f64::max);
        Self { samples_m, step_max_m }
    }

    fn to_sample_m(&self, point_m: &[f64; N], k: usize) -> f64 {
        distance_m(point_m, &self.samples_m[k])
    }

    /// Returns the distance to the segment between samples `k` and `k + 1`.
    fn to_segment_m(&self, point_m: &[f64; N], k: usize) -> f64 {
        let (from, to) = (&self.samples_m[k], &self.samples_m[k + 1]);
        let (mut length_squared, mut projection) = (0.0, 0.0);
        for axis in 0..N {
            let step = to[axis] - from[axis];
            length_squared += step * step;
            projection += (point_m[axis] - from[axis]) * step;
        }
        let share =
            if length_squared > 0.0 { (projection / length_squared).clamp(0.0, 1.0) } else { 0.0 };
        distance_m(
            point_m,
            &std::array::from_fn(|axis| from[axis] + share * (to[axis] - from[axis])),
        )
    }

    /// Returns the distance to the part of the path within `window` samples of sample `k`.
    fn distance_m(&self, point_m: &[f64; N], k: usize, window: usize) -> f64 {
        if self.samples_m.is_empty() || point_m.iter().any(|p| !p.is_finite()) {
            return f64::NAN;
        }
        let end = self.samples_m.len() - 1;
        let k = k.min(end);
        let first = k.saturating_sub(window);
        let last = k.saturating_add(window).min(end);
        let mut best_m = self.to_sample_m(point_m, k);
        let mut at = k;
        while at < last {
            let n_far = self.samples_to_skip(point_m, at, best_m);
            if n_far == 0 {
                best_m = best_m.min(self.to_segment_m(point_m, at));
            }
            at = at.saturating_add(n_far.max(1));
        }
        let mut at = k;
        while at > first {
            let n_far = self.samples_to_skip(point_m, at, best_m);
            if n_far == 0 {
                best_m = best_m.min(self.to_segment_m(point_m, at - 1));
            }
            at = at.saturating_sub(n_far.max(1));
        }
        best_m
    }

    /// Returns the number of samples after `k` at which the path can be at `best_m` at the
    /// earliest.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates: a negative number or NaN gives 0, infinity the end"
    )]
    fn samples_to_skip(&self, point_m: &[f64; N], k: usize, best_m: f64) -> usize {
        ((self.to_sample_m(point_m, k) - best_m) / self.step_max_m) as usize
    }
}

fn distance_m<const N: usize>(one: &[f64; N], other: &[f64; N]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[cfg(test)]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    reason = "small positive counts; skipping must change nothing at all"
)]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    fn line(n_samples: u32) -> Vec<f64> {
        (0..n_samples).flat_map(|k| [f64::from(k) * 0.01, 0.0]).collect()
    }

    /// Examines every segment of the window, without skipping.
    fn exhaustive(reference_m: &[f64], actual_m: &[f64], window: usize) -> Vec<f64> {
        let path = Path::<2>::new(reference_m.as_chunks().0);
        let distance = |(k, point): (usize, &[f64; 2])| {
            let mut best = path.to_sample_m(point, k);
            for at in k.saturating_sub(window)..(k + window).min(path.samples_m.len() - 1) {
                best = best.min(path.to_segment_m(point, at));
            }
            best
        };
        actual_m.as_chunks().0.iter().enumerate().map(distance).collect()
    }

    /// A contour that rests, follows a square with a diagonal, and rests again.
    fn contour() -> Vec<f64> {
        let corners: [[f64; 2]; 6] =
            [[0.08, 0.0], [0.08, 0.04], [0.06, 0.06], [0.0, 0.06], [0.0, 0.0], [0.08, 0.0]];
        let mut points = vec![corners[0]; 50];
        for pair in corners.windows(2) {
            let (dx, dy) = (pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]);
            let steps = (dx.hypot(dy) / 0.0002).round();
            for step in 1..=(steps as u32) {
                let share = f64::from(step) / steps;
                points.push([pair[0][0] + share * dx, pair[0][1] + share * dy]);
            }
        }
        points.extend([corners[5]; 110]);
        points.concat()
    }

    #[test]
    fn a_late_point_on_the_line_has_no_contour_error() {
        let reference = line(100);
        let late: Vec<f64> =
            (0..100).flat_map(|k| [(f64::from(k) - 7.3).max(0.0) * 0.01, 0.002]).collect();
        for (k, error) in contour_error_m(&reference, &late, 2, 10).iter().enumerate() {
            assert!((error - 0.002).abs() < 1e-15, "sample {k}: {error}");
        }
    }

    #[test]
    fn a_point_beyond_the_window_is_measured_to_its_edge() {
        let reference = line(100);
        let mut actual = reference.clone();
        actual[2 * 50] = 0.5 - 0.08;
        let errors = contour_error_m(&reference, &actual, 2, 5);
        assert!((errors[50] - 0.03).abs() < 1e-15, "sample 45 is the nearest allowed");
    }

    #[test]
    fn a_corner_is_measured_to_the_nearer_leg() {
        let reference = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0];
        let inside = [0.0, 0.0, 0.7, 0.2, 1.0, 1.0];
        assert!((contour_error_m(&reference, &inside, 2, 2)[1] - 0.2).abs() < 1e-15);
        let outside = [0.0, 0.0, 1.3, -0.4, 1.0, 1.0];
        assert!((contour_error_m(&reference, &outside, 2, 2)[1] - 0.5).abs() < 1e-15);
    }

    #[test]
    fn a_circle_is_measured_along_its_radius_up_to_the_chord() {
        let n = 1000;
        let angle = |k: f64| std::f64::consts::TAU * k / f64::from(n);
        let reference: Vec<f64> =
            (0..n).flat_map(|k| [angle(k.into()).cos(), angle(k.into()).sin(), 0.3]).collect();
        let actual: Vec<f64> = (0..n)
            .flat_map(|k| {
                let late = angle(f64::from(k) - 12.4);
                [1.01 * late.cos(), 1.01 * late.sin(), 0.3]
            })
            .collect();
        let chord = 1.0 - (0.5 * angle(1.0)).cos();
        for (k, error) in contour_error_m(&reference, &actual, 3, 40).iter().enumerate().skip(13) {
            assert!(*error >= 0.01 - 1e-12 && *error <= 0.01 + chord + 1e-12, "{k}: {error}");
        }
    }

    #[test]
    fn axes_that_do_not_move_add_nothing() {
        let reference = contour();
        let mut random = Random(4);
        let actual: Vec<f64> = reference.iter().map(|r| r + 3e-4 * random.signed()).collect();
        let expected = contour_error_m(&reference, &actual, 2, 50);
        for n_axes in 3..=MAX_AXES {
            let among = |values: &[f64]| -> Vec<f64> {
                let row = |pair: &[f64]| {
                    let mut row = vec![0.25; n_axes];
                    (row[0], row[n_axes - 1]) = (pair[0], pair[1]);
                    row
                };
                values.chunks_exact(2).flat_map(row).collect()
            };
            let found = contour_error_m(&among(&reference), &among(&actual), n_axes, 50);
            let apart = found.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(found.len() == expected.len() && apart < 1e-15, "{n_axes} axes: {apart}");
        }
    }

    #[test]
    fn skipping_changes_nothing() {
        let reference = contour();
        let mut random = Random(9);
        for scale in [1e-6, 3e-4, 1e-2, 1.0] {
            let actual: Vec<f64> = reference.iter().map(|r| r + scale * random.signed()).collect();
            for window in [0, 1, 17, 200, 10_000] {
                assert_eq!(
                    contour_error_m(&reference, &actual, 2, window),
                    exhaustive(&reference, &actual, window),
                    "scale {scale} window {window}"
                );
            }
        }
    }

    #[test]
    fn a_path_that_only_rests_is_a_point() {
        let errors = contour_error_m(&[1.0, 2.0, 1.0, 2.0], &[4.0, 6.0, 1.0, 2.0, 1.0, 3.0], 2, 9);
        assert_eq!(errors, [5.0, 0.0, 1.0]);
    }

    #[test]
    fn what_cannot_be_measured_is_nan() {
        let errors = contour_error_m(&line(3), &[f64::NAN, 0.0, 0.01, 0.0], 2, 9);
        assert!(errors[0].is_nan() && errors[1] == 0.0);
        assert!(contour_error_m(&[], &[0.0, 0.0], 2, 9)[0].is_nan());
        assert!(contour_error_m(&line(3), &[0.0], 0, 9).is_empty());
        assert!(contour_error_m(&line(13), &[0.0; 26], MAX_AXES + 1, 9).is_empty());
    }
}

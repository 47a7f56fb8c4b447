//! Tangent of a sampled path, also where it rests.
//!
//! `contour` and contour weights of learning may import it.

/// A step counts as rest below this share of the longest step ...
const REST: f64 = 1e-9;
/// ... or below this share of the largest coordinate: rounding of the coordinates.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Two steps count as a reversal if their sum is below this share of their lengths.
const REVERSAL: f64 = 1e-6;

/// Returns the unit tangent of a path at each sample; `None` if the path never moves.
///
/// `t[k] = (r[k+1] - r[k-1]) / |r[k+1] - r[k-1]|`; at the ends of the run and where the path
/// reverses, the remaining or arriving step. Where the path rests the tangent is undefined: the one
/// nearest in time is used, the earlier of two equally near ones.
///
/// # Shapes
/// - `reference`: `n_samples` x `n_axes`, time first; the result alike
/// # Units
/// - `reference` in the same unit for all axes, e.g. metres; the result is dimensionless
/// # Real Time
/// Cold; `O(n_samples)`.
/// # Source
/// - \[barton2010\], Eq. (4.3): theta is the angle of this tangent.
pub fn path_tangents(reference: &[f64], n_axes: usize) -> Option<Vec<f64>> {
    let n_samples = reference.len() / n_axes;
    let point = |k: usize| &reference[k * n_axes..(k + 1) * n_axes];
    let step = |from: usize, to: usize| -> Vec<f64> {
        point(from).iter().zip(point(to)).map(|(from, to)| to - from).collect()
    };
    let longest = (1..n_samples).map(|k| length(&step(k - 1, k))).fold(0.0, f64::max);
    let largest = reference.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
    let rest = (REST * longest).max(ROUNDING * largest);
    let direction = |k: usize| -> Option<Vec<f64>> {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(n_samples - 1));
        let (arriving, leaving) = (step(before, k), step(k, after));
        let mut across = step(before, after);
        if length(&across) <= REVERSAL * (length(&arriving) + length(&leaving)) {
            across = arriving;
        }
        let norm = length(&across);
        (norm > rest).then(|| across.iter().map(|value| value / norm).collect())
    };
    let known: Vec<Option<Vec<f64>>> = (0..n_samples).map(direction).collect();
    hold_nearest(&known)
}

/// Fills each gap with the entry nearest in time.
fn hold_nearest(known: &[Option<Vec<f64>>]) -> Option<Vec<f64>> {
    let places: Vec<usize> =
        known.iter().enumerate().filter_map(|(k, entry)| entry.as_ref().map(|_| k)).collect();
    let mut filled = Vec::new();
    let mut next = 0;
    for k in 0..known.len() {
        while next < places.len() && places[next] < k {
            next += 1;
        }
        let after = places.get(next);
        let before = next.checked_sub(1).map(|place| &places[place]);
        let nearest = match (before, after) {
            (Some(before), Some(after)) if k - before <= after - k => before,
            (Some(before), None) => before,
            (_, Some(after)) => after,
            (None, None) => return None,
        };
        filled.extend(known[*nearest].as_ref()?);
    }
    Some(filled)
}

fn length(step: &[f64]) -> f64 {
    // Scaled, so that the squares of very short and very long steps neither underflow nor overflow.
    let scale = step.iter().fold(0.0, |scale: f64, value| scale.max(value.abs()));
    if scale > 0.0 {
        scale * step.iter().map(|value| (value / scale).powi(2)).sum::<f64>().sqrt()
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn close(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 1e-14, "{found:?} is not {expected:?}");
        }
    }

    #[test]
    fn a_diagonal_has_one_tangent_also_while_it_rests() {
        let path = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.1, 1.1, 1.3, 1.3, 1.3, 1.3, 1.3, 1.3];
        let half = 0.5_f64.sqrt();
        close(&path_tangents(&path, 2).unwrap(), &[half; 14]);
    }

    #[test]
    fn a_rest_between_two_moves_belongs_to_the_nearer_one() {
        // Along x, rests at samples 2 to 6, then along y.
        let x = [0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0];
        let y = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0];
        let path: Vec<f64> = x.iter().zip(&y).flat_map(|(x, y)| [*x, *y]).collect();
        let found = path_tangents(&path, 2).unwrap();
        // Samples 2 and 6 still have a step; 4 lies halfway and takes the earlier tangent.
        let along_x = [1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let expected: Vec<f64> = along_x.iter().flat_map(|x| [*x, 1.0 - x]).collect();
        close(&found, &expected);
    }

    #[test]
    fn a_reversal_keeps_the_line_it_is_on() {
        let path = [0.0, 0.0, 1.0, 2.0, 2.0, 4.0, 1.0, 2.0 + 1e-9];
        let found = path_tangents(&path, 2).unwrap();
        let (c, s) = (1.0 / 5.0_f64.sqrt(), 2.0 / 5.0_f64.sqrt());
        close(&found[4..6], &[c, s]);
    }

    #[test]
    fn rounding_at_rest_is_no_motion() {
        let noise = 2.0_f64.powi(-52);
        let path = [1.0, 0.0, 1.0 + noise, 0.0, 1.0, noise, 1.0, 0.5, 1.0, 1.0];
        close(&path_tangents(&path, 2).unwrap()[..4], &[0.0, 1.0, 0.0, 1.0]);
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

        #[test]
        fn every_tangent_has_unit_length(
            steps in prop::collection::vec((0..3_u8, -1.0..1.0_f64, -1.0..1.0_f64), 2..40),
        ) {
            // A third of the samples rest.
            let mut path = vec![0.3, -0.2];
            for (rest, x, y) in steps {
                let (last_x, last_y) = (path[path.len() - 2], path[path.len() - 1]);
                let move_on = f64::from(u8::from(rest > 0));
                path.extend([last_x + move_on * x, last_y + move_on * y]);
            }
            if let Some(found) = path_tangents(&path, 2) {
                prop_assert_eq!(found.len(), path.len());
                for pair in found.chunks(2) {
                    prop_assert!((pair[0].hypot(pair[1]) - 1.0).abs() < 1e-14);
                }
            }
        }
    }
}

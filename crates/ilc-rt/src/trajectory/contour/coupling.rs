//! Directions along and across a path: tangents and coupling gains from the reference.

use super::tangent::path_tangents;

/// Returns the unit tangent of the reference at each sample; zeros if it never moves.
///
/// That of [`path_tangents`], one array per sample.
pub fn tangents<const N: usize>(reference_m: &[[f64; N]]) -> Vec<[f64; N]> {
    match path_tangents(reference_m.as_flattened(), N) {
        Some(tangents) => tangents.as_chunks().0.to_vec(),
        None => vec![[0.0; N]; reference_m.len()],
    }
}

/// Returns the linearised coupling gains of two axes at each sample.
///
/// `epsilon = c_1 e_1 + c_2 e_2`, `c_1 = -sin theta`, `c_2 = cos theta`; positive where the tool is to the
/// right of the path.
///
/// # Shapes
/// - `reference_m`: `n_samples`; one pair per sample, zeros if the reference never moves
/// # Source
/// - \[barton2010\], Eq. (4.1) to (4.3)
pub fn coupling_gains(reference_m: &[[f64; 2]]) -> Vec<[f64; 2]> {
    tangents(reference_m).iter().map(|tangent| [-tangent[1], tangent[0]]).collect()
}

/// Returns at each sample the projection of an error onto the normal of the path.
///
/// `epsilon = (I - t t') e`; for two axes this is `c c'` of [`coupling_gains`].
///
/// # Shapes
/// - `reference_m`: `n_samples`; one symmetric `N x N` matrix per sample, row-major
/// # Source
/// - \[barton2010\], Eq. (4.2), for any number of axes
pub fn across<const N: usize>(reference_m: &[[f64; N]]) -> Vec<[[f64; N]; N]> {
    tangents(reference_m)
        .iter()
        .map(|tangent| {
            std::array::from_fn(|row| {
                std::array::from_fn(|col| {
                    f64::from(u8::from(row == col)) - tangent[row] * tangent[col]
                })
            })
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "directions along an axis are exact")]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    #[test]
    fn a_line_at_45_degrees_is_hand_computed() {
        let reference: Vec<[f64; 2]> = (0..5).map(|k| [f64::from(k), f64::from(k)]).collect();
        let half = 0.5_f64.sqrt();
        for gains in coupling_gains(&reference) {
            assert!((gains[0] + half).abs() < 1e-15 && (gains[1] - half).abs() < 1e-15);
        }
        let across = across(&reference);
        assert!((across[2][0][0] - 0.5).abs() < 1e-15 && (across[2][0][1] + 0.5).abs() < 1e-15);
    }

    #[test]
    fn at_rest_the_nearest_direction_holds() {
        let mut reference = vec![[0.0, 0.0]; 4];
        reference.extend([[1.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0, 1.0]]);
        let tangents = tangents(&reference);
        assert_eq!(tangents[0], [1.0, 0.0]);
        assert_eq!(tangents[6], [1.0, 0.0]);
        assert_eq!(tangents[8], [0.0, 1.0]);
        assert_eq!(super::tangents(&[[1.0, 1.0]; 3]), [[0.0, 0.0]; 3]);
        assert!(super::tangents::<2>(&[]).is_empty());
    }

    #[test]
    fn across_is_a_projection_that_the_path_itself_has_no_part_in() {
        let mut random = Random(3);
        let reference: Vec<[f64; 3]> =
            (0..200).map(|_| std::array::from_fn(|_| random.signed())).collect();
        for (tangent, across) in tangents(&reference).iter().zip(across(&reference)) {
            for row in across {
                let along: f64 = row.iter().zip(tangent).map(|(a, b)| a * b).sum();
                assert!(along.abs() < 1e-14);
            }
            let trace: f64 = (0..3).map(|axis| across[axis][axis]).sum();
            assert!((trace - 2.0).abs() < 1e-14);
        }
    }
}

//! Tangents of a contour's reference.

use crate::learning::error::check;
use crate::learning::{LearningError, Result};
use crate::trajectory::path_tangents;

/// Returns the unit tangent of a path at each sample.
///
/// That of [`path_tangents`]; a path that never moves is refused, as it has no tangent.
///
/// # Shapes
/// - `reference`: `n_samples` x `n_axes`, time first; the result alike
/// # Units
/// - `reference` in the same unit for all axes, e.g. metres; the result is dimensionless
/// # Errors
/// - [`LearningError::Length`] unless `reference` holds whole samples of at least 2 axes.
/// - [`LearningError::NotFinite`] for a coordinate that is infinite or NaN.
/// - [`LearningError::Weight`] if the path never moves.
/// # Source
/// - \[barton2010\], Eq. (4.3): theta is the angle of this tangent.
pub fn tangents(reference: &[f64], n_axes: usize) -> Result<Vec<f64>> {
    let found = reference.len();
    if n_axes < 2 || found == 0 || !found.is_multiple_of(n_axes) {
        let (n_samples, n_channels) = ((found / n_axes.max(2)).max(1), n_axes.max(2));
        return Err(LearningError::Length { what: "reference", found, n_samples, n_channels });
    }
    check("reference", reference, found / n_axes, n_axes)?;

    path_tangents(reference, n_axes).ok_or_else(|| LearningError::Weight {
        what: "reference",
        sample: 0,
        reason: "the path never moves; a contour needs a path of at least two points".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_without_motion_or_sense_is_refused() {
        let told = |path: &[f64], n| tangents(path, n).unwrap_err().to_string();
        assert!(told(&[1.0, 2.0, 1.0, 2.0], 2).contains("never moves"));
        assert!(told(&[1.0, 2.0], 2).contains("never moves"));
        assert!(told(&[1.0, 2.0, 3.0], 2).contains("reference holds 3"));
        assert!(told(&[], 2).contains("reference holds 0"));
        assert!(told(&[1.0, 2.0], 1).contains("reference holds 2"));
        assert!(told(&[1.0, 2.0, f64::NAN, 2.0], 2).contains("NaN"));
    }
}

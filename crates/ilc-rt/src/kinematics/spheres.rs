//! Intersection of three spheres of equal radius.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use nalgebra::Vector3;

/// The centres count as collinear if the sine of the angle at a corner is smaller.
const COLLINEAR: f64 = 1e-9;

/// Reason for three spheres not meeting in one point above their centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NoPoint {
    /// The centres lie on one line.
    Collinear,
    /// The centres are too far apart.
    Apart,
}

/// Returns the upper of the two points at distance `radius` from three centres.
///
/// It lies above the circumcentre of the triangle of centres, at the height that the radius leaves:
/// `p = c + n sqrt(radius^2 - |c - c_0|^2)` with
/// `c - c_0 = (|u|^2 (v x n) + |v|^2 (n x u)) / (2 |n|^2)`, `n = u x v`. There is no cancellation of
/// large numbers, so the result is as accurate as the triangle is well shaped. "Upper" is the side
/// from which the centres run counter-clockwise.
pub(super) fn upper_meeting_point(
    centres: &[Vector3<f64>; 3],
    radius: f64,
) -> Result<Vector3<f64>, NoPoint> {
    let (u, v) = (centres[1] - centres[0], centres[2] - centres[0]);
    let n = u.cross(&v);
    let area = n.norm();
    if area <= COLLINEAR * u.norm() * v.norm() {
        return Err(NoPoint::Collinear);
    }
    let n = n / area;
    let out = (v.cross(&n) * u.norm_squared() + n.cross(&u) * v.norm_squared()) / (2.0 * area);
    let height_squared = radius * radius - out.norm_squared();
    if height_squared < 0.0 {
        return Err(NoPoint::Apart);
    }
    Ok(centres[0] + out + n * height_squared.sqrt())
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "tests are cold")]
mod tests {
    use super::*;

    #[test]
    fn a_pyramid_over_a_right_triangle() {
        let centres =
            [Vector3::new(0.0, 0.0, 1.0), Vector3::new(6.0, 0.0, 1.0), Vector3::new(0.0, 8.0, 1.0)];
        let top = upper_meeting_point(&centres, 13.0).unwrap();
        // The circumcentre of a right triangle bisects its hypotenuse: (3, 4), radius 5, height 12.
        assert!((top - Vector3::new(3.0, 4.0, 13.0)).norm() < 1e-14);
        assert_eq!(upper_meeting_point(&centres, 4.9), Err(NoPoint::Apart));
    }

    #[test]
    fn centres_in_a_line_are_told() {
        let centres = [Vector3::zeros(), Vector3::x(), Vector3::x() * 2.0];
        assert_eq!(upper_meeting_point(&centres, 5.0), Err(NoPoint::Collinear));
    }
}

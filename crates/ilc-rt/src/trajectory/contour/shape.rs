//! Distance to exact lines and arcs.

use super::ContourError;

/// A straight piece of a contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Start.
    pub from_m: [f64; 3],
    /// End.
    pub to_m: [f64; 3],
}

/// A circular piece of a contour, in any plane.
///
/// `p(angle) = centre + radius (cos angle, sin angle)` in the plane of `first` and `second`, for
/// angles from 0 to `sweep_rad`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    centre_m: [f64; 3],
    radius_m: f64,
    first: [f64; 3],
    second: [f64; 3],
    sweep_rad: f64,
}

impl Arc {
    /// Creates the arc that begins at `from_m` and turns by `sweep_rad` around an axis through a
    /// centre.
    ///
    /// # Errors
    /// - [`ContourError::Arc`] for a radius or an axis of length 0, an axis that is not
    ///   perpendicular to the radius, a sweep of 0 or more than a full turn, or a non-finite value.
    pub fn new(
        from_m: [f64; 3],
        centre_m: [f64; 3],
        axis: [f64; 3],
        sweep_rad: f64,
    ) -> Result<Self, ContourError> {
        let refused = |reason| Err(ContourError::Arc { reason });
        let all = from_m.iter().chain(&centre_m).chain(&axis).chain([&sweep_rad]);
        if all.into_iter().any(|value| !value.is_finite()) {
            return refused("every number must be finite");
        }
        let out = minus(from_m, centre_m);
        let (radius_m, axis_length) = (norm(out), norm(axis));
        if radius_m <= 0.0 || axis_length <= 0.0 {
            return refused("radius and axis must be longer than 0");
        }
        let (first, axis) = (scaled(out, 1.0 / radius_m), scaled(axis, 1.0 / axis_length));
        if dot(first, axis).abs() > 1e-9 {
            return refused("the axis must be perpendicular to the radius at the start");
        }
        if sweep_rad == 0.0 || sweep_rad.abs() > std::f64::consts::TAU * (1.0 + 1e-12) {
            return refused("the sweep must be between -360 and 360 degrees and not 0");
        }
        let second = scaled(cross(axis, first), sweep_rad.signum());
        Ok(Self { centre_m, radius_m, first, second, sweep_rad: sweep_rad.abs() })
    }
}

/// One piece of a programmed contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Straight.
    Line(Line),
    /// Circular.
    Arc(Arc),
}

impl Shape {
    /// Returns the distance of a point to the nearest point of the piece, including its ends.
    ///
    /// # Units
    /// - metres
    pub fn distance_m(&self, point_m: [f64; 3]) -> f64 {
        match self {
            Self::Line(Line { from_m, to_m }) => {
                let along = minus(*to_m, *from_m);
                let length_squared = dot(along, along);
                let out = minus(point_m, *from_m);
                let share = if length_squared > 0.0 {
                    (dot(out, along) / length_squared).clamp(0.0, 1.0)
                } else {
                    0.0
                };
                norm(minus(out, scaled(along, share)))
            }
            Self::Arc(arc) => arc_distance_m(arc, point_m),
        }
    }
}

/// Returns the distance of a point to the nearest of several pieces; infinite without pieces.
pub(crate) fn nearest_shape_m(shapes: &[Shape], point_m: [f64; 3]) -> f64 {
    shapes.iter().map(|shape| shape.distance_m(point_m)).fold(f64::INFINITY, f64::min)
}

impl Shape {
    /// Returns the exact contour error of each point: its distance to the nearest of several pieces.
    ///
    /// # Shapes
    /// - one distance per point; infinite without pieces, NaN for a non-finite point
    pub fn contour_error_m(shapes: &[Self], points_m: &[[f64; 3]]) -> Vec<f64> {
        points_m
            .iter()
            .map(|point_m| {
                if point_m.iter().all(|value| value.is_finite()) {
                    nearest_shape_m(shapes, *point_m)
                } else {
                    f64::NAN
                }
            })
            .collect()
    }
}

fn arc_distance_m(arc: &Arc, point_m: [f64; 3]) -> f64 {
    let out = minus(point_m, arc.centre_m);
    let (x, y) = (dot(out, arc.first), dot(out, arc.second));
    let height = dot(out, cross(arc.first, arc.second));
    let in_plane = x.hypot(y);
    let mut angle = y.atan2(x);
    if angle < 0.0 {
        angle += std::f64::consts::TAU;
    }
    // For a point on the axis, every point of the circle is equally near.
    if angle <= arc.sweep_rad || in_plane <= 0.0 {
        return (in_plane - arc.radius_m).hypot(height);
    }
    let end = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        (x - arc.radius_m * cos).hypot(y - arc.radius_m * sin).hypot(height)
    };
    end(0.0).min(end(arc.sweep_rad))
}

fn minus(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| one[axis] - other[axis])
}

fn scaled(one: [f64; 3], by: f64) -> [f64; 3] {
    one.map(|value| value * by)
}

fn dot(one: [f64; 3], other: [f64; 3]) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

fn norm(one: [f64; 3]) -> f64 {
    dot(one, one).sqrt()
}

fn cross(one: [f64; 3], other: [f64; 3]) -> [f64; 3] {
    [
        one[1] * other[2] - one[2] * other[1],
        one[2] * other[0] - one[0] * other[2],
        one[0] * other[1] - one[1] * other[0],
    ]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    use super::*;
    use crate::interpolate::random::Random;

    const Z: [f64; 3] = [0.0, 0.0, 1.0];

    #[test]
    fn a_quarter_circle_is_hand_computed() {
        let arc = Shape::Arc(Arc::new([2.0, 0.0, 0.0], [0.0; 3], Z, FRAC_PI_2).unwrap());
        for (point, wanted) in [
            ([3.0, 0.0, 0.0], 1.0),
            ([0.6, 0.8, 0.0], 1.0),
            ([0.0, 2.0, 3.0], 3.0),
            ([0.0, -1.0, 0.0], 5.0_f64.sqrt()),
            ([-1.0, 0.0, 0.0], 5.0_f64.sqrt()),
            ([0.0, 0.0, 0.0], 2.0),
        ] {
            assert!((arc.distance_m(point) - wanted).abs() < 1e-15, "{point:?}");
        }
        let back = Shape::Arc(Arc::new([2.0, 0.0, 0.0], [0.0; 3], Z, -FRAC_PI_2).unwrap());
        assert!((back.distance_m([0.0, -1.0, 0.0]) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn arcs_agree_with_their_finely_sampled_selves() {
        let mut random = Random(12);
        for _ in 0..50 {
            let axis: [f64; 3] = std::array::from_fn(|_| random.signed());
            let any: [f64; 3] = std::array::from_fn(|_| random.signed());
            let out = cross(axis, any);
            let centre: [f64; 3] = std::array::from_fn(|_| random.signed());
            let from: [f64; 3] = std::array::from_fn(|i| centre[i] + out[i]);
            let arc = Arc::new(from, centre, axis, TAU * random.signed()).unwrap();
            let point: [f64; 3] = std::array::from_fn(|_| 2.0 * random.signed());
            let sampled = (0..=20_000)
                .map(|k| {
                    let (sin, cos) = (arc.sweep_rad * f64::from(k) / 20_000.0).sin_cos();
                    let on: [f64; 3] = std::array::from_fn(|i| {
                        arc.centre_m[i] + arc.radius_m * (cos * arc.first[i] + sin * arc.second[i])
                    });
                    norm(minus(point, on))
                })
                .fold(f64::INFINITY, f64::min);
            let exact = Shape::Arc(arc).distance_m(point);
            assert!(exact <= sampled + 1e-12 && sampled - exact < 1e-6, "{exact} {sampled}");
        }
    }

    #[test]
    fn the_nearest_of_several_pieces_counts() {
        let line = Shape::Line(Line { from_m: [0.0; 3], to_m: [1.0, 0.0, 0.0] });
        let arc = Shape::Arc(Arc::new([1.0, 0.0, 0.0], [1.0, 1.0, 0.0], Z, PI).unwrap());
        let errors = Shape::contour_error_m(
            &[line, arc],
            &[[0.5, -0.2, 0.0], [2.5, 1.0, 0.0], [f64::NAN, 0.0, 0.0]],
        );
        assert!((errors[0] - 0.2).abs() < 1e-15 && (errors[1] - 0.5).abs() < 1e-15);
        assert!(errors[2].is_nan());
    }

    #[test]
    fn wrong_arcs_are_refused() {
        for (from, centre, axis, sweep, word) in [
            ([0.0; 3], [0.0; 3], Z, 1.0, "radius"),
            ([1.0, 0.0, 0.0], [0.0; 3], [0.0; 3], 1.0, "axis"),
            ([1.0, 0.0, 1.0], [0.0; 3], Z, 1.0, "perpendicular"),
            ([1.0, 0.0, 0.0], [0.0; 3], Z, 0.0, "sweep"),
            ([1.0, 0.0, 0.0], [0.0; 3], Z, 7.0, "sweep"),
            ([f64::NAN, 0.0, 0.0], [0.0; 3], Z, 1.0, "finite"),
        ] {
            let told = Arc::new(from, centre, axis, sweep).unwrap_err().to_string();
            assert!(told.contains(word), "{told}");
        }
    }
}

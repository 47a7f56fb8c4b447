//! Tangent, curvature and its derivative along the path, from derivatives by any parameter.

use super::Derivatives;
use crate::interpolate::MAX_AXES;

/// Derivatives of the point by the arc length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) point_m: [f64; MAX_AXES],
    /// Unit tangent.
    pub(super) tangent: [f64; MAX_AXES],
    /// Curvature vector, 1/m.
    pub(super) bend: [f64; MAX_AXES],
    /// Its derivative, 1/m².
    pub(super) twist: [f64; MAX_AXES],
}

/// Returns the inner product of two vectors.
pub(super) fn dot(a: &[f64; MAX_AXES], b: &[f64; MAX_AXES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the length of a vector.
pub(super) fn norm(a: &[f64; MAX_AXES]) -> f64 {
    dot(a, a).sqrt()
}

impl Frame {
    /// Interpolates the frame between two points.
    pub(super) fn between(frames: &[Self], at: f64) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "places on the curve"
        )]
        let i = (at.max(0.0) as usize).min(frames.len().saturating_sub(2));
        let (a, b, share) = (&frames[i], &frames[i + 1], (at - i as f64).clamp(0.0, 1.0));
        let mix = |of: fn(&Frame) -> &[f64; MAX_AXES]| -> [f64; MAX_AXES] {
            std::array::from_fn(|axis| of(a)[axis] + share * (of(b)[axis] - of(a)[axis]))
        };
        Self {
            point_m: mix(|frame| &frame.point_m),
            tangent: mix(|frame| &frame.tangent),
            bend: mix(|frame| &frame.bend),
            twist: mix(|frame| &frame.twist),
        }
    }

    /// Creates the frame: `T = r'/q`, `K = (r'' - T (T·r''))/q²` and `dK/ds`, with `q = |r'|`.
    pub(super) fn new([point_m, first, second, third]: Derivatives) -> Self {
        let q = norm(&first);
        let tangent = first.map(|value| value / q);
        let stretch = dot(&tangent, &second);
        let bend: [f64; MAX_AXES] =
            std::array::from_fn(|i| (second[i] - tangent[i] * stretch) / (q * q));
        // By the parameter: T' = K q, and (T·r'')' = T'·r'' + T·r'''.
        let turn = bend.map(|value| value * q);
        let stretch_rate = dot(&turn, &second) + dot(&tangent, &third);
        let twist = std::array::from_fn(|i| {
            let rate = third[i] - turn[i] * stretch - tangent[i] * stretch_rate;
            (rate / (q * q) - 2.0 * bend[i] * stretch / q) / q
        });
        Self { point_m, tangent, bend, twist }
    }

    /// Returns velocity, acceleration and jerk of an axis at speed `v`, acceleration `a` and jerk
    /// `j` along the path: `T v`, `T a + K v²`, `T j + 3 K v a + K' v³`.
    pub(super) fn axis(&self, axis: usize, v: f64, a: f64, j: f64) -> [f64; 3] {
        let (t, k, w) = (self.tangent[axis], self.bend[axis], self.twist[axis]);
        [t * v, t * a + k * v * v, t * j + 3.0 * k * v * a + w * v * v * v]
    }
}

/// Pads the axes of a planar shape.
pub(super) fn flat(values: [[f64; 2]; 4]) -> Derivatives {
    values.map(|[x, y]| {
        let mut point = [0.0; MAX_AXES];
        (point[0], point[1]) = (x, y);
        point
    })
}

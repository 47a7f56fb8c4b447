//! Tangent, curvature and its change along the path, from derivatives by any parameter.

use super::Derivatives;
use crate::interpolate::MAX_AXES;

/// Derivatives of the point by the distance along the curve.
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

/// The inner product of two vectors of the tick.
pub(super) fn dot(a: &[f64; MAX_AXES], b: &[f64; MAX_AXES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Length of a vector of the tick.
pub(super) fn norm(a: &[f64; MAX_AXES]) -> f64 {
    dot(a, a).sqrt()
}

impl Frame {
    /// `T = r'/q`, `K = (r'' - T (T·r''))/q²` and `dK/ds`, with `q = |r'|`.
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

    /// Velocity, acceleration and jerk of an axis at speed `v`, acceleration `a` and jerk `j` along
    /// the path: `T v`, `T a + K v²`, `T j + 3 K v a + K' v³`.
    pub(super) fn axis(&self, axis: usize, v: f64, a: f64, j: f64) -> [f64; 3] {
        let (t, k, w) = (self.tangent[axis], self.bend[axis], self.twist[axis]);
        [t * v, t * a + k * v * v, t * j + 3.0 * k * v * a + w * v * v * v]
    }
}

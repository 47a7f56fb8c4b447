//! A circular arc, or a helix, and what the axes' limits leave for a move along it.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::f64::consts::TAU;

use super::MAX_AXES;
use super::limits::{AxisLimits, PathLimits};

/// Share of the acceleration limit that the bend of an arc may take.
const BEND_SHARE: f64 = 0.7;
/// Shares of the jerk limit that turning at constant speed, and speeding up while turning, may take:
/// with both used up, `√(1 - 0.6²) - 0.5 = 0.3` of it is left for the jerk along the arc.
const TURN_SHARE: f64 = 0.5;
const SPEED_UP_SHARE: f64 = 0.6;

/// An arc in the plane of two axes; the others go along in proportion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arc {
    pub(super) from_m: [f64; MAX_AXES],
    pub(super) to_m: [f64; MAX_AXES],
    plane: [usize; 2],
    center_m: [f64; 2],
    radius_m: f64,
    from_rad: f64,
    /// Signed: anticlockwise is positive.
    sweep_rad: f64,
    pub(super) length_m: f64,
    /// Share of the length that is in the plane.
    share: f64,
}

impl Arc {
    /// The arc around a centre; `None` if radius or length is 0, or the ends are not equally far
    /// from the centre (to a thousandth, or 10 µm).
    ///
    /// A centre that is a little off is moved onto the ends' bisector, so that the arc ends where it
    /// is told to. An arc that ends where it starts is a full circle.
    pub(super) fn new(
        from_m: [f64; MAX_AXES],
        to_m: [f64; MAX_AXES],
        plane: [usize; 2],
        center_m: [f64; 2],
        clockwise: bool,
    ) -> Option<Self> {
        let [p, q] = plane;
        let start = [from_m[p] - center_m[0], from_m[q] - center_m[1]];
        let end = [to_m[p] - center_m[0], to_m[q] - center_m[1]];
        let (near, far) = (start[0].hypot(start[1]), end[0].hypot(end[1]));
        let usable = near.is_finite() && far.is_finite() && near > 0.0;
        if !usable || (near - far).abs() > 1e-5_f64.max(1e-3 * near) {
            return None;
        }
        let chord = [to_m[p] - from_m[p], to_m[q] - from_m[q]];
        let gap = chord[0].hypot(chord[1]);
        let full = gap <= 1e-12 * near;
        let mut center = center_m;
        if !full {
            let unit = chord.map(|share| share / gap);
            // How far the centre is from the bisector, along the chord.
            let off = 0.5 * gap + (start[0] * unit[0] + start[1] * unit[1]);
            center = [center[0] + off * unit[0], center[1] + off * unit[1]];
        }
        let angle = |at: [f64; MAX_AXES]| (at[q] - center[1]).atan2(at[p] - center[0]);
        let (from_rad, to_rad) = (angle(from_m), angle(to_m));
        let mut sweep_rad = to_rad - from_rad;
        if full {
            sweep_rad = if clockwise { -TAU } else { TAU };
        } else if clockwise && sweep_rad >= 0.0 {
            sweep_rad -= TAU;
        } else if !clockwise && sweep_rad <= 0.0 {
            sweep_rad += TAU;
        }
        let radius_m = (from_m[p] - center[0]).hypot(from_m[q] - center[1]);
        let flat_m = radius_m * sweep_rad.abs();
        let others: f64 = (0..MAX_AXES)
            .filter(|axis| !plane.contains(axis))
            .map(|axis| (to_m[axis] - from_m[axis]).powi(2))
            .sum();
        let length_m = flat_m.hypot(others.sqrt());
        (length_m.is_finite() && flat_m > 0.0).then(|| Self {
            from_m,
            to_m,
            plane,
            center_m: center,
            radius_m,
            from_rad,
            sweep_rad,
            length_m,
            share: flat_m / length_m,
        })
    }

    /// The point at `s_m` from the start; exactly the start and the end there.
    pub(super) fn point_m(&self, s_m: f64) -> [f64; MAX_AXES] {
        if s_m >= self.length_m {
            return self.to_m;
        }
        if s_m <= 0.0 {
            return self.from_m;
        }
        let part = s_m / self.length_m;
        let mut point_m = self.from_m;
        for (axis, coordinate) in point_m.iter_mut().enumerate() {
            *coordinate += part * (self.to_m[axis] - self.from_m[axis]);
        }
        let (sin, cos) = (self.from_rad + part * self.sweep_rad).sin_cos();
        point_m[self.plane[0]] = self.center_m[0] + self.radius_m * cos;
        point_m[self.plane[1]] = self.center_m[1] + self.radius_m * sin;
        point_m
    }

    /// The unit tangent at `s_m` from the start, times `scale`.
    pub(super) fn along(&self, s_m: f64, scale: f64) -> [f64; MAX_AXES] {
        let part = (s_m / self.length_m).clamp(0.0, 1.0);
        let mut tangent = [0.0; MAX_AXES];
        for (axis, share) in tangent.iter_mut().enumerate() {
            *share = scale * (self.to_m[axis] - self.from_m[axis]) / self.length_m;
        }
        let (sin, cos) = (self.from_rad + part * self.sweep_rad).sin_cos();
        let flat = scale * self.share * self.sweep_rad.signum();
        tangent[self.plane[0]] = -flat * sin;
        tangent[self.plane[1]] = flat * cos;
        tangent
    }

    /// What the axes leave for a jerk-limited move along the arc.
    ///
    /// With the share `c` in the plane and radius `r`: acceleration `c a` along and `c² v²/r` across,
    /// jerk `c j - c³ v³/r²` along and `3 c² v a/r` across; each pair stays within its limit in
    /// whichever direction the axes lie.
    pub(super) fn limits(&self, limits: &[AxisLimits], feed_m_s: f64) -> PathLimits {
        let outside = self.outside();
        let mut path = PathLimits::along(&outside, limits, feed_m_s);
        let [mut v_max, mut a_max, mut j_max] = [f64::INFINITY; 3];
        for limit in self.plane.iter().filter_map(|&axis| limits.get(axis)) {
            v_max = v_max.min(limit.velocity_max_m_s);
            a_max = a_max.min(limit.acceleration_max_m_s2);
            j_max = j_max.min(limit.jerk_max_m_s3);
        }
        let (c, r) = (self.share, self.radius_m);
        let lower = |so_far: f64, bound: f64| if bound < so_far { bound } else { so_far };
        let bend = (BEND_SHARE * a_max * r).sqrt() / c;
        let turn = (TURN_SHARE * j_max * r * r).cbrt() / c;
        path.velocity_m_s = lower(lower(lower(path.velocity_m_s, v_max / c), bend), turn);
        let v = path.velocity_m_s;
        let across = c * c * v * v / r;
        let along = (a_max * a_max - across * across).sqrt() / c;
        let speed_up = SPEED_UP_SHARE * j_max * r / (3.0 * c * c * v);
        path.acceleration_m_s2 = lower(lower(path.acceleration_m_s2, along), speed_up);
        let across = 3.0 * c * c * v * path.acceleration_m_s2 / r;
        let rest = (j_max * j_max - across * across).sqrt() - (c * v).powi(3) / (r * r);
        path.jerk_m_s3 = lower(path.jerk_m_s3, rest / c);
        path
    }

    /// The direction of the axes that are not in the plane.
    fn outside(&self) -> [f64; MAX_AXES] {
        let mut direction = [0.0; MAX_AXES];
        for (axis, share) in direction.iter_mut().enumerate() {
            if !self.plane.contains(&axis) {
                *share = (self.to_m[axis] - self.from_m[axis]) / self.length_m;
            }
        }
        direction
    }
}

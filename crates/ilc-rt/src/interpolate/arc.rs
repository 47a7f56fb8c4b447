//! Circular arcs and helices, and the path limits that follow from the axes' limits.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::MAX_AXES;
use super::limits::{AxisLimits, PathLimits};

/// Share of the acceleration limit available to the centripetal acceleration.
const BEND_SHARE: f64 = 0.7;
/// Shares of the jerk limit for turning at constant speed, and for accelerating while turning: with
/// both used up, `√(1 - 0.6²) - 0.5 = 0.3` is left for the jerk along the arc.
const TURN_SHARE: f64 = 0.5;
const SPEED_UP_SHARE: f64 = 0.6;

/// Largest difference of the radii at start and end: this much, or this share of the radius; never
/// more than half of the smaller one.
const GAP_M: f64 = 1e-5;
const GAP_SHARE: f64 = 1e-3;
/// Start and end closer than this, seen from the centre, coincide: the arc is a full circle.
const FULL_M: f64 = 1e-11;

/// An arc in the plane of two axes; the other axes move in proportion (helix).
///
/// The programmed centre is kept. If the ends are not equally far from it, as with rounded
/// decimals, the radius changes in proportion to the angle: no point of the arc is farther from
/// either circle than the circles are from each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Arc {
    pub(crate) from_m: [f64; MAX_AXES],
    pub(crate) to_m: [f64; MAX_AXES],
    plane: [usize; 2],
    center_m: [f64; 2],
    /// Radius at the start.
    radius_m: f64,
    /// Change of the radius from start to end.
    growth_m: f64,
    from_rad: f64,
    /// Signed: counter-clockwise is positive.
    sweep_rad: f64,
    pub(crate) length_m: f64,
    /// Largest in-plane share of the length.
    share: f64,
}

/// Returns true if the radii at start and end agree within rounding of the program.
pub(crate) fn ends_agree(start_radius_m: f64, end_radius_m: f64) -> bool {
    let gap_m = (start_radius_m - end_radius_m).abs();
    let allowed_m =
        GAP_M.max(GAP_SHARE * start_radius_m).min(0.5 * start_radius_m.min(end_radius_m));
    // Differences of decimals are rounded, too.
    start_radius_m > 0.0 && end_radius_m > 0.0 && gap_m <= allowed_m * (1.0 + 1e-9)
}

impl Arc {
    /// Returns the arc around a centre; `None` if a radius is 0, or the radii at start and end
    /// disagree (by more than a thousandth, or 10 µm).
    ///
    /// An arc that ends at its start is a full circle; otherwise the direction alone decides the
    /// sweep, however near the ends are.
    pub(crate) fn new(
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
        if !(near.is_finite() && far.is_finite() && ends_agree(near, far)) {
            return None;
        }
        let from_rad = start[1].atan2(start[0]);
        // From both products: a difference of angles near a full turn would lose its last digits.
        let turned_rad =
            (start[0] * end[1] - start[1] * end[0]).atan2(start[0] * end[0] + start[1] * end[1]);
        let direction = if clockwise { -1.0 } else { 1.0 };
        let full = turned_rad.abs() * near <= FULL_M;
        let sweep_rad = if full || turned_rad * direction < 0.0 {
            turned_rad + direction * TAU
        } else {
            turned_rad
        };
        let growth_m = far - near;
        let flat_m = sweep_rad.abs() * near.max(far).hypot(growth_m / sweep_rad);
        let others: f64 = (0..MAX_AXES)
            .filter(|axis| !plane.contains(axis))
            .map(|axis| (to_m[axis] - from_m[axis]).powi(2))
            .sum();
        let length_m = flat_m.hypot(others.sqrt());
        (length_m.is_finite() && flat_m > 0.0).then(|| Self {
            from_m,
            to_m,
            plane,
            center_m,
            radius_m: near,
            growth_m,
            from_rad,
            sweep_rad,
            length_m,
            share: flat_m / length_m,
        })
    }

    /// Returns the point at `s_m` from the start; exact at both ends.
    pub(crate) fn point_m(&self, s_m: f64) -> [f64; MAX_AXES] {
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
        let radius_m = self.radius_m + part * self.growth_m;
        point_m[self.plane[0]] = self.center_m[0] + radius_m * cos;
        point_m[self.plane[1]] = self.center_m[1] + radius_m * sin;
        point_m
    }

    /// Returns the tangent at `s_m` from the start times `scale`; its length is 1 where the radius
    /// is largest.
    pub(crate) fn along(&self, s_m: f64, scale: f64) -> [f64; MAX_AXES] {
        let part = (s_m / self.length_m).clamp(0.0, 1.0);
        let mut tangent = [0.0; MAX_AXES];
        for (axis, share) in tangent.iter_mut().enumerate() {
            *share = scale * (self.to_m[axis] - self.from_m[axis]) / self.length_m;
        }
        let (sin, cos) = (self.from_rad + part * self.sweep_rad).sin_cos();
        let across = (self.radius_m + part * self.growth_m) * self.sweep_rad;
        tangent[self.plane[0]] = scale * (self.growth_m * cos - across * sin) / self.length_m;
        tangent[self.plane[1]] = scale * (self.growth_m * sin + across * cos) / self.length_m;
        tangent
    }

    /// Returns the largest share of the path speed that an axis takes anywhere on the arc.
    pub(crate) fn share(&self, axis: usize) -> f64 {
        if !self.plane.contains(&axis) {
            return (self.to_m[axis] - self.from_m[axis]).abs() / self.length_m;
        }
        // The tangent is parallel to an axis where the radius is normal to it, twice a turn.
        let first = if self.plane[1] == axis { 0.0 } else { FRAC_PI_2 };
        let to_rad = self.from_rad + self.sweep_rad;
        let (low, high) = (self.from_rad.min(to_rad), self.from_rad.max(to_rad));
        if first + ((low - first) / PI).ceil() * PI <= high {
            return self.share;
        }
        let [begin, end] = [0.0, self.length_m].map(|s_m| self.along(s_m, 1.0)[axis].abs());
        begin.max(end)
    }

    /// Returns the path limits of a jerk-limited move along the arc.
    ///
    /// With respect to the distance, the in-plane derivatives of the point are at most `c`, `k` and
    /// `w`: for a circle of radius `r` the share `c`, `c²/r` and `c³/r²`, the second normal to the
    /// others. The acceleration then has the parts `c a` along and `k v²` across, the jerk `c j + w
    /// v³` along and `3 k v a` across; their sum stays within each limit for any direction of the
    /// axes. Where the radius grows, the two are not orthogonal, and `lean` is the cosine.
    pub(crate) fn limits(&self, limits: &[AxisLimits], feed_m_s: f64) -> PathLimits {
        let outside = self.outside();
        let mut path = PathLimits::along(&outside, limits, feed_m_s);
        let [mut v_max, mut a_max, mut j_max] = [f64::INFINITY; 3];
        for limit in self.plane.iter().filter_map(|&axis| limits.get(axis)) {
            v_max = v_max.min(limit.velocity_max_m_s);
            a_max = a_max.min(limit.acceleration_max_m_s2);
            j_max = j_max.min(limit.jerk_max_m_s3);
        }
        let turn = self.sweep_rad.abs() / self.length_m;
        let (first, last) = (self.radius_m, self.radius_m + self.growth_m);
        let (largest, slope) = (first.max(last), self.growth_m / self.sweep_rad);
        let c = self.share;
        let k = turn.powi(2) * largest.hypot(2.0 * slope);
        let w = turn.powi(3) * largest.hypot(3.0 * slope);
        let lean = (slope.abs() / first.min(last)).min(0.5);
        // The longest vector whose sum with an orthogonal one of length `across` stays within
        // `limit`.
        let rest = |limit: f64, across: f64| {
            (limit * limit - across * across * (1.0 - lean * lean)).sqrt() - lean * across
        };
        let lower = |so_far: f64, bound: f64| if bound < so_far { bound } else { so_far };
        let bend = (BEND_SHARE * a_max / k).sqrt();
        let twist = (TURN_SHARE * j_max / w).cbrt();
        path.velocity_m_s = lower(lower(lower(path.velocity_m_s, v_max / c), bend), twist);
        let v = path.velocity_m_s;
        let along = rest(a_max, k * v * v) / c;
        let speed_up = SPEED_UP_SHARE * j_max / (3.0 * k * v);
        path.acceleration_m_s2 = lower(lower(path.acceleration_m_s2, along), speed_up);
        let across = 3.0 * k * v * path.acceleration_m_s2;
        path.jerk_m_s3 = lower(path.jerk_m_s3, (rest(j_max, across) - w * v.powi(3)) / c);
        path
    }

    /// The direction of the out-of-plane axes.
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

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests {
    use super::*;
    use crate::interpolate::random::Random;

    fn at(x: f64, y: f64) -> [f64; MAX_AXES] {
        let mut point = [0.0; MAX_AXES];
        (point[0], point[1]) = (x, y);
        point
    }

    /// Largest distance of the arc from the circle through its start, and its length as a polyline.
    fn walked(arc: &Arc, center: [f64; 2], radius: f64) -> (f64, f64) {
        let n = 20_000;
        let mut before = arc.point_m(0.0);
        let (mut off, mut length) = (0.0_f64, 0.0);
        for k in 1..=n {
            let here = arc.point_m(arc.length_m * f64::from(k) / f64::from(n));
            off = off.max(((here[0] - center[0]).hypot(here[1] - center[1]) - radius).abs());
            length += (here[0] - before[0]).hypot(here[1] - before[1]);
            before = here;
        }
        (off, length)
    }

    #[test]
    fn ends_that_are_near_each_other_leave_the_centre_where_it_is() {
        for (from, to, center, clockwise, length) in [
            ([0.01, 0.0], [9.999e-3, -1e-6], [0.0, 0.0], false, 0.062_831),
            ([0.01, 0.0], [10.001e-3, -1e-4], [0.0, 0.0], false, 0.062_731),
            ([0.0, 0.0], [1e-6, -1e-6], [0.005, 0.0], true, 0.031_415),
        ] {
            let [from, to] = [from, to].map(|[x, y]: [f64; 2]| at(x, y));
            let arc = Arc::new(from, to, [0, 1], center, clockwise).unwrap();
            let radius = (from[0] - center[0]).hypot(from[1] - center[1]);
            let (off, found) = walked(&arc, center, radius);
            // The radii at the ends differ by up to 1.5 um.
            assert!(off < 1.51e-6, "{to:?}: {off}");
            assert!((found - length).abs() < 1e-5, "{to:?}: {found}");
        }
    }

    #[test]
    fn no_point_is_farther_off_than_the_ends_are_whatever_their_distance() {
        let mut random = Random(51);
        for round in 0..1_500 {
            let radius = random.log(1e-3, 1.0);
            let center = [random.signed(), random.signed()];
            let begin = std::f64::consts::PI * random.signed();
            let clockwise = round % 2 == 0;
            // From almost nothing to almost a full turn, mostly near either.
            let small = random.log(1e-9 / radius, 3.0);
            let sweep = if round % 4 < 2 { small } else { TAU - small };
            let rounded = |value: f64| (value * 1e6).round() / 1e6;
            let point = |angle: f64, radius: f64| {
                at(center[0] + radius * angle.cos(), center[1] + radius * angle.sin())
            };
            let from = point(begin, radius);
            let signed = if clockwise { -sweep } else { sweep };
            let mut to = point(begin + signed, radius);
            if round % 3 == 0 {
                // Rounded to a micrometre, as in most programs.
                (to[0], to[1]) = (rounded(to[0]), rounded(to[1]));
            }
            let arc = Arc::new(from, to, [0, 1], center, clockwise).unwrap();
            let end = (to[0] - center[0]).hypot(to[1] - center[1]);
            let (off, length) = walked(&arc, center, radius);
            assert!(off <= (end - radius).abs() + 1e-14, "{off} {arc:?}");
            if round % 3 != 0 {
                assert!((length - radius * sweep).abs() < 1e-6 * radius * sweep + 1e-12, "{arc:?}");
            }
            assert_eq!(arc.point_m(arc.length_m), to);
        }
    }

    #[test]
    fn an_arc_that_ends_where_it_starts_is_a_full_circle_also_with_a_rounded_end() {
        let center = [0.1, 0.2];
        let from = at(0.11, 0.2);
        for to in [from, at(0.11 + 1e-17, 0.2 - 1e-17), at(0.110_001, 0.2), at(0.109_999, 0.2)] {
            for clockwise in [false, true] {
                let arc = Arc::new(from, to, [0, 1], center, clockwise).unwrap();
                assert!((arc.length_m - 0.01 * TAU).abs() < 1e-5, "{arc:?}");
                assert_eq!(arc.sweep_rad > 0.0, !clockwise);
            }
        }
        // For an end a nanometre away, the direction decides.
        let arc =
            |y: f64| Arc::new(from, at(0.11, 0.2 + y), [0, 1], center, false).unwrap().length_m;
        assert!((arc(1e-9) - 1e-9).abs() < 1e-13 && (arc(-1e-9) - 0.01 * TAU).abs() < 1e-8);
    }

    #[test]
    fn the_tangent_is_the_slope_of_the_points() {
        let (from, to) = (at(0.01, 0.0), at(0.0, 0.010_009));
        let arc = Arc::new(from, to, [0, 1], [0.0, 0.0], false).unwrap();
        for k in 1..50 {
            let s = arc.length_m * f64::from(k) / 50.0;
            let (before, after) = (arc.point_m(s - 1e-8), arc.point_m(s + 1e-8));
            for (axis, slope) in arc.along(s, 1.0).into_iter().enumerate() {
                assert!(((after[axis] - before[axis]) / 2e-8 - slope).abs() < 1e-7, "{arc:?}");
            }
        }
    }

    #[test]
    fn ends_that_decimals_do_not_explain_are_refused() {
        assert!(ends_agree(0.01, 0.01 + 1e-5) && ends_agree(1.0, 1.001));
        assert!(!ends_agree(0.01, 0.010_011) && !ends_agree(1.0, 1.0011));
        assert!(!ends_agree(1e-6, 8e-6), "a multiple of the radius");
        assert!(!ends_agree(0.0, 0.0) && !ends_agree(1e-6, 0.0) && !ends_agree(f64::NAN, 1.0));
    }
}

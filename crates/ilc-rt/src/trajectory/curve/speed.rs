//! Speed allowed by the limits along a curve.

use super::frame::{Frame, norm};
use crate::interpolate::AxisLimits;

/// Shares of the acceleration for the curvature and for speeding up, of the jerk for each of its
/// three parts.
const SHARE: f64 = 0.7;
const JERK_SHARE: f64 = 0.4;
/// Share of the feed below which coming to rest in a bend is faster than passing through it.
const CREEP_SHARE: f64 = 0.05;

/// Limits of a run along a curve.
#[derive(Clone, Debug, PartialEq)]
pub struct RunLimits {
    /// Programmed feed: never exceeded along the path.
    pub feed_m_s: f64,
    /// Highest centripetal acceleration, `v² κ`; infinite for the limits of the axes alone.
    pub curvature_acceleration_max_m_s2: f64,
    /// Limits of the axes.
    pub axes: Vec<AxisLimits>,
}

impl RunLimits {
    /// Radius of a bend that no axis passes faster than at a small share of the feed.
    pub(super) fn creep_radius_m(&self) -> f64 {
        let v = CREEP_SHARE * self.feed_m_s;
        let tightest = |axis: &AxisLimits| {
            let by_jerk = (v.powi(3) / (JERK_SHARE * axis.jerk_max_m_s3)).sqrt();
            by_jerk.max(v * v / (SHARE * axis.acceleration_max_m_s2))
        };
        self.axes.iter().map(tightest).fold(0.0, f64::max)
    }

    /// Returns the acceleration and the jerk along the path that every axis allows, each its share.
    pub(super) fn along(&self) -> (f64, f64) {
        let lowest =
            |of: fn(&AxisLimits) -> f64| self.axes.iter().map(of).fold(f64::INFINITY, f64::min);
        let jerk = JERK_SHARE * lowest(|axis| axis.jerk_max_m_s3);
        let acceleration = SHARE * lowest(|axis| axis.acceleration_max_m_s2);
        // Not more than the jerk limit can use within a change of speed by the feed.
        (acceleration.min((jerk * self.feed_m_s).sqrt()), jerk)
    }

    /// Returns the speed limit at one point.
    pub(super) fn speed_m_s(&self, here: &Frame) -> f64 {
        let mut speed = self.feed_m_s;
        let mut lower = |bound: f64| {
            // Not `f64::min`, which would drop a NaN, and with it the refusal.
            if bound < speed || bound.is_nan() {
                speed = bound;
            }
        };
        lower((self.curvature_acceleration_max_m_s2 / norm(&here.bend)).sqrt());
        for (axis, limit) in self.axes.iter().enumerate() {
            let jerk = JERK_SHARE * limit.jerk_max_m_s3;
            lower(limit.velocity_max_m_s / here.tangent[axis].abs());
            lower((SHARE * limit.acceleration_max_m_s2 / here.bend[axis].abs()).sqrt());
            lower((jerk / here.twist[axis].abs()).cbrt());
        }
        speed
    }
}

/// Speed of a run at each point after starting at rest in a turn, or before stopping in one: it is
/// low there anyway, so the tight bend slows down nothing else.
pub(super) fn launch_speeds(
    turns: [bool; 2],
    n_places: usize,
    step_m: f64,
    acceleration: f64,
    jerk: f64,
) -> Vec<f64> {
    (0..n_places)
        .map(|i| {
            let from = if turns[0] { i as f64 * step_m } else { f64::INFINITY };
            let to = if turns[1] { (n_places - 1 - i) as f64 * step_m } else { f64::INFINITY };
            let gone_m = from.min(to);
            let by_jerk = 0.5 * jerk.cbrt() * (6.0 * gone_m).powf(2.0 / 3.0);
            by_jerk.min((2.0 * acceleration * gone_m).sqrt())
        })
        .collect()
}

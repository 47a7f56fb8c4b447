//! The last gate before the bus: what leaves it is within the limits of its axis, whatever the sum of
//! program and learned input asks for.
//!
//! A command that keeps the limits passes bit for bit. One that does not is followed as closely as the
//! axis' own acceleration allows, and met again without a step. Limits of position are kept by braking
//! ahead of them; an axis that stands outside is never pulled in by them, it is only kept from going
//! farther out.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use crate::trajectory::AxisLimits;

/// How much faster than the axis' own limit a command may change while it keeps all other limits.
///
/// The program keeps the acceleration limit. What is learned on top of it makes up for the lag of the
/// drive, and so changes faster than the axis will ever move: that shall pass.
const LEARNED_SHARE: f64 = 50.0;

/// What a gate has to keep.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) limits: AxisLimits,
    pub(super) position_min_m: f64,
    pub(super) position_max_m: f64,
    pub(super) dt_s: f64,
}

impl Bounds {
    /// Highest velocity from which an axis still comes to rest within `distance_m`, a cycle of moving
    /// on included: `v T/2 + v^2/2a = d`.
    fn braking_m_s(&self, distance_m: f64, acceleration_m_s2: f64) -> f64 {
        let half_s = 0.5 * self.dt_s;
        let root = half_s * half_s + 2.0 * distance_m.max(0.0) / acceleration_m_s2;
        (acceleration_m_s2 * (root.sqrt() - half_s)).max(0.0)
    }
}

/// The gate of an axis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gate {
    /// What was asked for last, inside the limits.
    asked_m: f64,
    /// Whether the command is not yet what is asked for.
    behind: bool,
}

impl Gate {
    /// Begins at a command that has been given.
    pub(super) fn begin(&mut self, command_m: f64) {
        *self = Self { asked_m: command_m, behind: false };
    }

    /// The position to command where `wanted_m` is asked for; `last` are the two commands before,
    /// newest first. What is not a number stays so.
    pub(super) fn position_m(&mut self, wanted_m: f64, last: [f64; 2], bounds: &Bounds) -> f64 {
        if !wanted_m.is_finite() {
            return wanted_m;
        }
        let (dt_s, own) = (bounds.dt_s, bounds.limits.acceleration_max_m_s2);
        let at_m = last[0];
        let before_m_s = (last[0] - last[1]) / dt_s;
        let low_m = bounds.position_min_m.min(at_m);
        let high_m = bounds.position_max_m.max(at_m);
        let inside_m = wanted_m.max(low_m).min(high_m);
        let cut = inside_m.to_bits() != wanted_m.to_bits();
        let asked_m_s = (inside_m - self.asked_m) / dt_s;
        self.asked_m = inside_m;

        let top_m_s = bounds.limits.velocity_max_m_s;
        let up_m_s = top_m_s.min(bounds.braking_m_s(high_m - at_m, own));
        let down_m_s = -top_m_s.min(bounds.braking_m_s(at_m - low_m, own));
        let wanted_m_s = (inside_m - at_m) / dt_s;
        let reach = if self.behind || cut { own } else { LEARNED_SHARE * own } * dt_s;
        // A count of rounding must not hold a command back that keeps the limits.
        let slack = 1e-9 * top_m_s;
        let free = wanted_m_s <= up_m_s + slack
            && wanted_m_s >= down_m_s - slack
            && (wanted_m_s - before_m_s).abs() <= reach + slack;
        if free {
            self.behind = cut;
            return inside_m;
        }
        self.behind = true;
        // Half of the acceleration closes the gap; the other half is for what is asked to accelerate.
        let gap_m = inside_m - at_m - asked_m_s * dt_s;
        let closing_m_s = bounds.braking_m_s(gap_m.abs(), 0.5 * own).copysign(gap_m);
        let next_m_s = (asked_m_s + closing_m_s)
            .min(before_m_s + own * dt_s)
            .max(before_m_s - own * dt_s)
            .min(up_m_s.max(before_m_s - own * dt_s))
            .max(down_m_s.min(before_m_s + own * dt_s))
            .min(top_m_s)
            .max(-top_m_s);
        (at_m + next_m_s * dt_s).max(low_m).min(high_m)
    }

    /// The velocity to command where `wanted_m_s` is asked for of an axis that is at `at_m`.
    pub(super) fn velocity_m_s(wanted_m_s: f64, last_m_s: f64, at_m: f64, bounds: &Bounds) -> f64 {
        if !wanted_m_s.is_finite() {
            return wanted_m_s;
        }
        let (top_m_s, own) = (bounds.limits.velocity_max_m_s, bounds.limits.acceleration_max_m_s2);
        let up_m_s = top_m_s.min(bounds.braking_m_s(bounds.position_max_m - at_m, own));
        let down_m_s = -top_m_s.min(bounds.braking_m_s(at_m - bounds.position_min_m, own));
        let reach = LEARNED_SHARE * own * bounds.dt_s;
        wanted_m_s.min(up_m_s).max(down_m_s).min(last_m_s + reach).max(last_m_s - reach)
    }
}

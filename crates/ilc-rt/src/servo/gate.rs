//! The last gate before the bus: its output is within the limits of the axis for any sum of program
//! and learned input.
//!
//! Limits are those of position, velocity, acceleration and jerk; of a force those of its rate and size as well. A
//! command within the limits passes bit for bit. Another one is followed as closely as the axis'
//! own acceleration allows, and caught up with without a step. Position limits are kept by braking
//! ahead of them; an axis outside is never pulled in by them, only kept from going farther out.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::spec::{ForceSpec, LEARNED_JERK};
use crate::interpolate::AxisLimits;

/// Multiple of the acceleration limit of the axis by which a command may change while it keeps all
/// other limits.
///
/// The program respects the acceleration limit. The learned input on top of it compensates for the
/// lag of the drive, and so changes faster than the axis will ever move: that has to pass.
const LEARNED_SHARE: f64 = 4.0;

/// Share of the velocity limit from which on a force brakes. A velocity loop overshoots a little
/// when the program runs at the limit.
const OVERSPEED: f64 = 1.1;
/// Cycles in which a force takes a velocity back that is too high; the measurement is one cycle old,
/// and the force acts one later.
const BRAKE_CYCLES: f64 = 5.0;

/// Limits that a gate keeps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) limits: AxisLimits,
    pub(super) position_min_m: f64,
    pub(super) position_max_m: f64,
    pub(super) dt_s: f64,
}

impl Bounds {
    /// Returns the highest velocity at a distance from a position limit: that of braking, with the time that the
    /// deceleration needs by the jerk limit.
    fn approach_m_s(&self, distance_m: f64, acceleration_m_s2: f64) -> f64 {
        let turning_s = 2.0 * acceleration_m_s2 / (LEARNED_JERK * self.limits.jerk_max_m_s3);
        self.delayed_m_s(distance_m, acceleration_m_s2, 0.5 * self.dt_s + turning_s)
    }

    /// Returns the highest velocity from which an axis still comes to rest within `distance_m`,
    /// including one cycle of delay: `v T/2 + v^2/2a = d`.
    fn braking_m_s(&self, distance_m: f64, acceleration_m_s2: f64) -> f64 {
        self.delayed_m_s(distance_m, acceleration_m_s2, 0.5 * self.dt_s)
    }

    fn delayed_m_s(&self, distance_m: f64, acceleration_m_s2: f64, half_s: f64) -> f64 {
        let distance_m = distance_m.max(0.0);
        let root = half_s * half_s + 2.0 * distance_m / acceleration_m_s2;
        (acceleration_m_s2 * (root.sqrt() - half_s)).max(0.0).min(distance_m / self.dt_s)
    }
}

/// The gate of an axis.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gate {
    /// Last requested position.
    asked_m: f64,
    /// True if the command differs from the requested one.
    behind: bool,
}

impl Gate {
    /// Starts at the current command.
    pub(super) fn begin(&mut self, command_m: f64) {
        *self = Self { asked_m: command_m, behind: false };
    }

    /// Returns the position command for the request `wanted_m`; `last` are the three previous
    /// commands, newest first. NaN passes through.
    pub(super) fn position_m(&mut self, wanted_m: f64, last: [f64; 3], bounds: &Bounds) -> f64 {
        if !wanted_m.is_finite() {
            return wanted_m;
        }
        let (dt_s, own) = (bounds.dt_s, bounds.limits.acceleration_max_m_s2);
        let at_m = last[0];
        let before_m_s = (last[0] - last[1]) / dt_s;
        // The velocity with the acceleration of before, and how far the jerk limit lets it be left.
        let steady_m_s = 2.0 * before_m_s - (last[1] - last[2]) / dt_s;
        let own_bend_m_s = LEARNED_JERK * bounds.limits.jerk_max_m_s3 * dt_s * dt_s;
        let low_m = bounds.position_min_m.min(at_m);
        let high_m = bounds.position_max_m.max(at_m);
        let inside_m = wanted_m.max(low_m).min(high_m);
        let cut = inside_m.to_bits() != wanted_m.to_bits();
        let asked_m_s = if cut { 0.0 } else { (wanted_m - self.asked_m) / dt_s };
        self.asked_m = wanted_m;

        let top_m_s = bounds.limits.velocity_max_m_s;
        let up_m_s = top_m_s.min(bounds.approach_m_s(high_m - at_m, own));
        let down_m_s = -top_m_s.min(bounds.approach_m_s(at_m - low_m, own));
        let wanted_m_s = (inside_m - at_m) / dt_s;
        let catching_up = self.behind || cut;
        let bend_m_s = if catching_up { own_bend_m_s } else { LEARNED_SHARE * own_bend_m_s };
        let reach = if catching_up { own } else { LEARNED_SHARE * own } * dt_s;
        // Rounding by a count must not restrict a command that is within the limits.
        let slack = 1e-9 * top_m_s;
        let free = wanted_m_s <= up_m_s + slack
            && wanted_m_s >= down_m_s - slack
            && (wanted_m_s - before_m_s).abs() <= reach + slack
            && (wanted_m_s - steady_m_s).abs() <= bend_m_s + slack
            // It must be caught up with at its own velocity, or the next cycle would step.
            && (!catching_up || (wanted_m_s - asked_m_s).abs() <= reach + slack);
        if free {
            self.behind = cut;
            return inside_m;
        }
        self.behind = true;
        // Half of the acceleration closes the gap; the other half is for the acceleration of the
        // request.
        let gap_m = inside_m - at_m - asked_m_s * dt_s;
        let closing_m_s = bounds.braking_m_s(gap_m.abs(), 0.5 * own).copysign(gap_m);
        let next_m_s = (asked_m_s + closing_m_s)
            .min(before_m_s + own * dt_s)
            .max(before_m_s - own * dt_s)
            .min(up_m_s.max(before_m_s - own * dt_s))
            .max(down_m_s.min(before_m_s + own * dt_s))
            .min(steady_m_s + own_bend_m_s)
            .max(steady_m_s - own_bend_m_s)
            .min(top_m_s)
            .max(-top_m_s);
        (at_m + next_m_s * dt_s).max(low_m).min(high_m)
    }

    /// Returns the velocity command for the request `wanted_m_s` of an axis at `at_m`.
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

    /// Returns the force for the request `wanted_n`, of an axis at the position and with the velocity
    /// of `motion`; NaN passes through.
    ///
    /// An axis that is too fast, in itself or for its distance to a position limit, is not driven on
    /// but braked. The force changes no faster than the jerk limit moves the mass, with the same share
    /// for the learned input as a velocity.
    pub(super) fn force_n(
        wanted_n: f64,
        last_n: f64,
        [at_m, velocity_m_s]: [f64; 2],
        force: &ForceSpec,
        bounds: &Bounds,
    ) -> f64 {
        if !wanted_n.is_finite() {
            return wanted_n;
        }
        let (limits, own) = (&bounds.limits, bounds.limits.acceleration_max_m_s2);
        let top_m_s = OVERSPEED * limits.velocity_max_m_s;
        let up_m_s = top_m_s.min(bounds.braking_m_s(bounds.position_max_m - at_m, own));
        let down_m_s = -top_m_s.min(bounds.braking_m_s(at_m - bounds.position_min_m, own));
        let per_m_s = force.mass_kg / (BRAKE_CYCLES * bounds.dt_s);
        let reach = LEARNED_SHARE * force.mass_kg * limits.jerk_max_m_s3 * bounds.dt_s;
        wanted_n
            .min(per_m_s * (up_m_s - velocity_m_s))
            .max(per_m_s * (down_m_s - velocity_m_s))
            .min(last_n + reach)
            .max(last_n - reach)
            .min(force.max_n)
            .max(-force.max_n)
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    reason = "tests are cold"
)]
mod promises;

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    const BOUNDS: Bounds = Bounds {
        limits: AxisLimits {
            velocity_max_m_s: 0.5,
            acceleration_max_m_s2: 8.0,
            jerk_max_m_s3: 1000.0,
        },
        position_min_m: -0.02,
        position_max_m: 0.08,
        dt_s: 0.002,
    };

    /// Returns the commands for the request `wanted_m`, from rest at `start_m`.
    fn commands(start_m: f64, n: usize, wanted_m: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut gate = Gate::default();
        gate.begin(start_m);
        let mut out = vec![start_m; 3];
        for k in 0..n {
            let last = [out[k + 2], out[k + 1], out[k]];
            out.push(gate.position_m(wanted_m(k as f64 * BOUNDS.dt_s), last, &BOUNDS));
        }
        out
    }

    fn largest_acceleration(commands: &[f64]) -> f64 {
        let second = |w: &[f64]| (w[2] - 2.0 * w[1] + w[0]).abs() / (BOUNDS.dt_s * BOUNDS.dt_s);
        commands.windows(3).map(second).fold(0.0, f64::max)
    }

    #[test]
    fn what_keeps_the_limits_passes_bit_for_bit() {
        let wanted = |t: f64| 0.03 + 0.02 * (1.0 - (TAU * 2.0 * t).cos());
        for (k, command) in commands(0.03, 2000, wanted)[3..].iter().enumerate() {
            assert_eq!(command.to_bits(), wanted(k as f64 * BOUNDS.dt_s).to_bits());
        }
    }

    #[test]
    fn a_limit_is_kept_by_braking_ahead_of_it_and_left_without_a_step() {
        for (amplitude_m, frequency_hz) in [(0.03, 0.5), (0.1, 1.0), (0.2, 2.0), (0.0215, 3.0)] {
            let wanted = |t: f64| 0.06 + amplitude_m * t.min(1.0) * (TAU * frequency_hz * t).sin();
            let out = commands(0.06, 5000, wanted);
            assert!(out.iter().all(|m| (-0.02..=0.08).contains(m)));
            let max = largest_acceleration(&out);
            assert!(max <= 1.15 * 8.0, "{amplitude_m} {frequency_hz}: {max} m/s2");
        }
    }

    #[test]
    fn a_step_becomes_a_move_that_does_not_overshoot() {
        let out = commands(0.0, 400, |t| if t < 0.005 { 0.0 } else { 0.05 });
        assert!(largest_acceleration(&out) <= 8.0 + 1e-6);
        assert!(out.iter().all(|m| *m <= 0.05));
        assert_eq!(out[402].to_bits(), 0.05_f64.to_bits());
    }

    #[test]
    fn what_stands_outside_is_not_pulled_in_and_goes_no_farther() {
        for (start_m, farther_m) in [(0.15, 0.2), (-0.3, -0.5)] {
            assert!(commands(start_m, 50, |_| start_m).iter().all(|m| *m == start_m));
            assert!(commands(start_m, 50, |_| farther_m).iter().all(|m| *m == start_m));
            let back = commands(start_m, 900, |t| start_m * (1.0 - 0.1 * t * t));
            assert!(largest_acceleration(&back) <= 8.0 && back[902] != start_m);
        }
    }

    #[test]
    fn a_velocity_is_bounded_and_does_not_carry_the_axis_beyond_its_limits() {
        let top = |wanted, last, at| Gate::velocity_m_s(wanted, last, at, &BOUNDS);
        assert_eq!(top(0.3, 0.29, 0.0).to_bits(), 0.3_f64.to_bits());
        assert!((top(9.0, 0.49, 0.0) - 0.5).abs() < 1e-12);
        assert!((top(0.5, 0.0, 0.0) - LEARNED_SHARE * 8.0 * 0.002).abs() < 1e-12);
        assert!(top(0.1, 0.1, 0.08) < 0.1 - 0.05 && top(0.01, 0.0, 0.081) == 0.0);
        assert!(top(-0.01, 0.0, 0.081) == -0.01, "back is free");
        let (mut at, mut last) = (0.0, 0.0);
        for _ in 0..2000 {
            last = top(0.5, last, at);
            at += last * BOUNDS.dt_s;
        }
        assert!(at <= 0.08 + 1e-9 && at > 0.0799, "{at}");
    }

    const FORCE: ForceSpec = ForceSpec {
        rated_n: 100.0,
        max_n: 200.0,
        mass_kg: 20.0,
        coulomb_n: 0.0,
        integral_time_s: 0.0,
    };

    #[test]
    fn a_force_within_the_limits_passes_and_a_wild_one_is_bounded() {
        let force =
            |wanted, last, motion: [f64; 2]| Gate::force_n(wanted, last, motion, &FORCE, &BOUNDS);
        assert_eq!(force(37.5, 30.0, [0.03, 0.1]).to_bits(), 37.5_f64.to_bits());
        assert_eq!(force(9e9, 190.0, [0.03, 0.0]), 200.0);
        // The jerk limit: 4 * 20 kg * 1000 m/s3 * 2 ms.
        let soft = Bounds { limits: AxisLimits { jerk_max_m_s3: 10.0, ..BOUNDS.limits }, ..BOUNDS };
        assert!((Gate::force_n(90.0, 0.0, [0.03, 0.0], &FORCE, &soft) - 1.6).abs() < 1e-12);
        assert!(force(50.0, 0.0, [0.03, 0.6]) < 0.0, "too fast: braked");
        assert!(force(50.0, 0.0, [0.0799, 0.2]) < 0.0, "too fast for the limit ahead: braked");
        assert_eq!(force(50.0, 0.0, [0.081, 0.0]), 0.0);
        assert_eq!(force(-50.0, 0.0, [0.081, 0.0]), -50.0, "back is free");
    }

    #[test]
    fn what_is_no_number_stays_so() {
        let mut gate = Gate::default();
        assert!(gate.position_m(f64::NAN, [0.0; 3], &BOUNDS).is_nan());
        assert!(Gate::velocity_m_s(f64::NAN, 0.0, 0.0, &BOUNDS).is_nan());
        assert!(Gate::force_n(f64::NAN, 0.0, [0.0; 2], &FORCE, &BOUNDS).is_nan());
    }
}

//! The seven-phase jerk-limited profile (S-curve) from rest to rest, in closed form.
//!
//! Jerk is `+J 0 -J 0 -J 0 +J`: up to the acceleration limit, up to the velocity limit, cruise, and
//! the mirror image. A short move omits the phases that do not fit.

use super::error::MoveError;
use super::limits::{PathLimits, is_positive};
use super::quantity::Quantity;

/// Motion along the path at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathState {
    /// Distance from the start.
    pub s_m: f64,
    /// Speed.
    pub v_m_s: f64,
    /// Acceleration.
    pub a_m_s2: f64,
    /// Jerk; at a switching time, that of the phase that ends.
    pub j_m_s3: f64,
}

/// A time-optimal move from rest to rest under limits of velocity, acceleration and jerk.
///
/// The first half is computed from the start and the second as its mirror image from the end, so
/// the move ends exactly at its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JerkLimited {
    length_m: f64,
    jerk_m_s3: f64,
    jerk_time_s: f64,
    hold_time_s: f64,
    cruise_time_s: f64,
    peak_acceleration_m_s2: f64,
    peak_velocity_m_s: f64,
}

impl JerkLimited {
    /// Plans a move of `length_m`.
    ///
    /// With `T_j = a/j` (or `√(v/j)` if `v j < a²`) and `T_a = v/a + a/j` (or `2 T_j`), the velocity
    /// limit is reached if `v T_a <= length`; else the acceleration limit is if
    /// `2 a³/j² <= length`, with the peak `v'` from `v'²/a + v' a/j = length`; else
    /// `T_j = ∛(length / 2j)`.
    ///
    /// # Real Time
    /// Does not allocate; computes a few roots.
    /// # Errors
    /// [`MoveError::Length`] or [`MoveError::Limit`] for a value that is not finite and positive,
    /// [`MoveError::Duration`] if the duration overflows.
    pub fn plan(
        length_m: f64,
        velocity_m_s: f64,
        acceleration_m_s2: f64,
        jerk_m_s3: f64,
    ) -> Result<Self, MoveError> {
        let (v, a, j) = (velocity_m_s, acceleration_m_s2, jerk_m_s3);
        if !is_positive(length_m) {
            return Err(MoveError::Length { length: length_m });
        }
        for (quantity, value) in
            [(Quantity::Velocity, v), (Quantity::Acceleration, a), (Quantity::Jerk, j)]
        {
            if !is_positive(value) {
                return Err(MoveError::Limit { quantity, value });
            }
        }
        let (full_jerk_s, full_hold_s) =
            if v * j >= a * a { (a / j, (v / a - a / j).max(0.0)) } else { ((v / j).sqrt(), 0.0) };
        let full_rise_m = v * (2.0 * full_jerk_s + full_hold_s);
        let (jerk_time_s, hold_time_s, cruise_time_s, peak_velocity_m_s);
        if full_rise_m <= length_m {
            (jerk_time_s, hold_time_s) = (full_jerk_s, full_hold_s);
            (cruise_time_s, peak_velocity_m_s) = ((length_m - full_rise_m) / v, v);
        } else if 2.0 * a * (a / j).powi(2) <= length_m {
            let ramp_s = a / j;
            let peak = 2.0 * length_m / (ramp_s + (ramp_s * ramp_s + 4.0 * length_m / a).sqrt());
            (jerk_time_s, hold_time_s) = (ramp_s, (peak / a - ramp_s).max(0.0));
            (cruise_time_s, peak_velocity_m_s) = (0.0, peak);
        } else {
            let ramp_s = (0.5 * length_m / j).cbrt();
            (jerk_time_s, hold_time_s) = (ramp_s, 0.0);
            (cruise_time_s, peak_velocity_m_s) = (0.0, j * ramp_s * ramp_s);
        }
        let plan = Self {
            length_m,
            jerk_m_s3,
            jerk_time_s,
            hold_time_s,
            cruise_time_s,
            peak_acceleration_m_s2: j * jerk_time_s,
            peak_velocity_m_s,
        };
        let duration_s = plan.duration_s();
        if is_positive(duration_s) && is_positive(jerk_time_s) && is_positive(peak_velocity_m_s) {
            Ok(plan)
        } else {
            Err(MoveError::Duration { length: length_m, duration_s })
        }
    }

    /// Plans a move of `length_m` under limits along its path.
    ///
    /// # Errors
    /// As [`JerkLimited::plan`].
    pub fn along(length_m: f64, limits: &PathLimits) -> Result<Self, MoveError> {
        Self::plan(length_m, limits.velocity_m_s, limits.acceleration_m_s2, limits.jerk_m_s3)
    }

    /// Returns the duration of the move.
    pub fn duration_s(&self) -> f64 {
        2.0 * self.rise_time_s() + self.cruise_time_s
    }

    /// State at a time from the start; at rest before it and, exactly at the end, after the move.
    ///
    /// # Real Time
    /// Does not allocate; no roots, no dependence on previous calls.
    pub fn at(&self, t_s: f64) -> PathState {
        let duration_s = self.duration_s();
        let half_m = 0.5 * self.length_m;
        if t_s >= duration_s {
            PathState { s_m: self.length_m, v_m_s: 0.0, a_m_s2: 0.0, j_m_s3: 0.0 }
        } else if t_s <= 0.5 * duration_s {
            let rise = self.rise(t_s);
            PathState { s_m: rise.s_m.min(half_m), ..rise }
        } else if t_s.is_nan() {
            self.rise(0.0)
        } else {
            let mirror = self.rise(duration_s - t_s);
            PathState {
                s_m: self.length_m - mirror.s_m.min(half_m),
                v_m_s: mirror.v_m_s,
                a_m_s2: -mirror.a_m_s2,
                j_m_s3: mirror.j_m_s3,
            }
        }
    }

    fn rise_time_s(&self) -> f64 {
        2.0 * self.jerk_time_s + self.hold_time_s
    }

    /// Returns the state in the first three phases and the cruise.
    fn rise(&self, t_s: f64) -> PathState {
        let (j, a, v) = (self.jerk_m_s3, self.peak_acceleration_m_s2, self.peak_velocity_m_s);
        let rise_s = self.rise_time_s();
        let rise_m = 0.5 * v * rise_s;
        if t_s <= 0.0 {
            PathState { s_m: 0.0, v_m_s: 0.0, a_m_s2: 0.0, j_m_s3: 0.0 }
        } else if t_s <= self.jerk_time_s {
            let t = t_s;
            PathState { s_m: j * t * t * t / 6.0, v_m_s: 0.5 * j * t * t, a_m_s2: j * t, j_m_s3: j }
        } else if t_s <= self.jerk_time_s + self.hold_time_s {
            let t = t_s - self.jerk_time_s;
            let (v_1, s_1) =
                (0.5 * a * self.jerk_time_s, a * self.jerk_time_s * self.jerk_time_s / 6.0);
            PathState {
                s_m: s_1 + t * (v_1 + 0.5 * a * t),
                v_m_s: v_1 + a * t,
                a_m_s2: a,
                j_m_s3: 0.0,
            }
        } else if t_s <= rise_s {
            let left = rise_s - t_s;
            PathState {
                s_m: rise_m - left * (v - j * left * left / 6.0),
                v_m_s: v - 0.5 * j * left * left,
                a_m_s2: j * left,
                j_m_s3: -j,
            }
        } else {
            PathState { s_m: rise_m + v * (t_s - rise_s), v_m_s: v, a_m_s2: 0.0, j_m_s3: 0.0 }
        }
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

    /// Durations of the seven phases.
    fn phases_s(plan: &JerkLimited) -> [f64; 7] {
        let (j, h, c) = (plan.jerk_time_s, plan.hold_time_s, plan.cruise_time_s);
        [j, h, j, c, j, h, j]
    }

    #[test]
    fn hand_computed_move_reaches_every_limit() {
        // v = 1, a = 2, j = 8: T_j = 0.25, hold 0.25, rise 0.75 s and 0.375 m; cruise 1.25 s.
        let plan = JerkLimited::plan(2.0, 1.0, 2.0, 8.0).unwrap();
        for (found, wanted) in
            phases_s(&plan).iter().zip([0.25, 0.25, 0.25, 1.25, 0.25, 0.25, 0.25])
        {
            assert!((found - wanted).abs() < 1e-15);
        }
        let state = plan.at(0.5);
        assert!((state.v_m_s - 0.75).abs() < 1e-15, "0.25 from the ramp and 0.5 from the hold");
        assert!((state.s_m - (0.125 / 6.0 + 0.0625 + 0.0625)).abs() < 1e-15);
        assert!((plan.at(0.75).s_m - 0.375).abs() < 1e-15);
    }

    #[test]
    fn short_moves_drop_phases() {
        // 2 a^3/j^2 = 0.25 m: at that length the hold vanishes and T_j = a/j.
        let acceleration_only = JerkLimited::plan(0.25, 10.0, 2.0, 8.0).unwrap();
        assert!((acceleration_only.duration_s() - 1.0).abs() < 1e-12);
        let jerk_only = JerkLimited::plan(0.25 / 8.0, 10.0, 2.0, 8.0).unwrap();
        assert!(
            (jerk_only.duration_s() - 0.5).abs() < 1e-15,
            "an eighth of the way in half the time"
        );
        assert!(phases_s(&jerk_only)[1].abs() < 1e-15);
        assert!((jerk_only.peak_acceleration_m_s2 - 1.0).abs() < 1e-15);
    }

    #[test]
    fn random_moves_hold_every_limit() {
        let mut random = Random(7);
        for _ in 0..200_000 {
            let [length, v, a, j] = [
                random.log(1e-7, 10.0),
                random.log(1e-4, 10.0),
                random.log(1e-3, 100.0),
                random.log(1e-2, 1e5),
            ];
            let plan = JerkLimited::plan(length, v, a, j).unwrap();
            let duration = plan.duration_s();
            let bound = 1.0 + 1e-9;
            assert!(plan.peak_velocity_m_s <= v * bound, "{plan:?}");
            assert!(plan.peak_acceleration_m_s2 <= a * bound, "{plan:?}");
            let sum: f64 = phases_s(&plan).iter().sum();
            assert!((sum / duration - 1.0).abs() < 1e-12, "{plan:?}");
            assert!(phases_s(&plan).iter().all(|phase| *phase >= 0.0), "{plan:?}");
            // Time-optimal: a phase below its limit leaves no phase that waits.
            let [ramp, hold, _, cruise, ..] = phases_s(&plan);
            if cruise > 1e-9 * duration {
                assert!(plan.peak_velocity_m_s >= v * (1.0 - 1e-9), "{plan:?}");
            }
            if hold > 1e-9 * ramp {
                assert!(plan.peak_acceleration_m_s2 >= a * (1.0 - 1e-9), "{plan:?}");
            }
            let lower = (length / v).max(2.0 * (length / a).sqrt()).max((32.0 * length / j).cbrt());
            assert!(duration >= lower * (1.0 - 1e-9), "{plan:?}");
            assert_eq!(plan.at(duration).s_m.to_bits(), length.to_bits());
            assert_eq!(plan.at(2.0 * duration).s_m.to_bits(), length.to_bits());
            let mut before = 0.0;
            for step in 0..=12 {
                let t = duration * (f64::from(step) + random.unit()) / 13.0;
                let state = plan.at(t);
                assert!(state.s_m >= before - 1e-14 * length, "{plan:?} at {t}");
                assert!(state.s_m <= length, "{plan:?} at {t}");
                assert!(state.v_m_s >= -1e-12 * v && state.v_m_s <= v * bound, "{plan:?} at {t}");
                assert!(state.a_m_s2.abs() <= a * bound && state.j_m_s3.abs() <= j * bound);
                before = state.s_m;
            }
        }
    }

    #[test]
    fn position_velocity_and_acceleration_belong_together() {
        let mut random = Random(11);
        for _ in 0..2_000 {
            let plan = JerkLimited::plan(
                random.log(1e-3, 1.0),
                random.log(1e-2, 1.0),
                random.log(0.1, 10.0),
                random.log(1.0, 1e3),
            )
            .unwrap();
            let t = plan.duration_s() * random.unit();
            let h = 1e-4 * phases_s(&plan)[0];
            let (low, mid, high) = (plan.at(t - h), plan.at(t), plan.at(t + h));
            let peak_v = plan.peak_velocity_m_s;
            let slope = (high.s_m - low.s_m) / (2.0 * h);
            assert!((slope - mid.v_m_s).abs() < 1e-3 * peak_v, "{plan:?} at {t}");
            let bend = (high.v_m_s - low.v_m_s) / (2.0 * h);
            assert!(
                (bend - mid.a_m_s2).abs() < 1e-3 * plan.peak_acceleration_m_s2,
                "{plan:?} at {t}"
            );
        }
    }

    #[test]
    fn bad_values_are_refused_one_at_a_time() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            for place in 0..4 {
                let mut values = [1.0; 4];
                values[place] = bad;
                let [length, v, a, j] = values;
                assert!(JerkLimited::plan(length, v, a, j).is_err(), "{values:?}");
            }
        }
        assert!(matches!(
            JerkLimited::plan(1e300, 1e-300, 1.0, 1.0),
            Err(MoveError::Duration { .. })
        ));
    }
}

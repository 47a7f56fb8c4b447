//! Controlled stop: brings every axis to rest from any state of motion, within its limits.

use super::MAX_AXES;
use super::limits::AxisLimits;
use super::setpoint::Setpoint;

/// Time-optimal deceleration of one axis to rest: jerk to a peak, hold, jerk back.
#[derive(Clone, Copy, Debug)]
struct AxisStop {
    /// Duration and jerk of each phase.
    phases: [(f64, f64); 3],
    position_m: f64,
    velocity_m_s: f64,
    acceleration_m_s2: f64,
    /// Rest position.
    rest_m: f64,
}

impl AxisStop {
    /// Plans the stop. `v_0` is the velocity that would remain if the acceleration were ramped down
    /// at once, `v + a|a|/2j`; the deceleration opposes it, up to the peak `p = √(j(|v| + a²/2j))`
    /// or the limit.
    fn plan(
        position_m: f64,
        velocity_m_s: f64,
        acceleration_m_s2: f64,
        limits: &AxisLimits,
    ) -> Self {
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        let usable = |limit: f64| if limit.is_finite() && limit > 0.0 { limit } else { 1e9 };
        let (most, jerk) = (usable(limits.acceleration_max_m_s2), usable(limits.jerk_max_m_s3));
        let velocity = finite(velocity_m_s);
        let acceleration = finite(acceleration_m_s2).clamp(-most, most);
        let remaining = velocity + acceleration * acceleration.abs() / (2.0 * jerk);
        let sign = if remaining < 0.0 { -1.0 } else { 1.0 };
        let (v, a) = (sign * velocity, sign * acceleration);
        let reserve = (v + a * a / (2.0 * jerk)).max(0.0);
        let peak = (jerk * reserve).sqrt();
        let (peak, hold_s) =
            if peak <= most { (peak, 0.0) } else { (most, (reserve - most * most / jerk) / most) };
        let mut stop = Self {
            phases: [
                (((a + peak) / jerk).max(0.0), -sign * jerk),
                (hold_s, 0.0),
                (peak / jerk, sign * jerk),
            ],
            position_m,
            velocity_m_s: velocity,
            acceleration_m_s2: acceleration,
            rest_m: position_m,
        };
        stop.rest_m = stop.walk(stop.duration_s()).0;
        stop
    }

    fn duration_s(&self) -> f64 {
        self.phases.iter().map(|phase| phase.0).sum()
    }

    /// Returns position and velocity at a time; exactly at rest at the end.
    fn at(&self, t_s: f64) -> (f64, f64) {
        if t_s < self.duration_s() { self.walk(t_s) } else { (self.rest_m, 0.0) }
    }

    fn walk(&self, t_s: f64) -> (f64, f64) {
        let (mut p, mut v, mut a) = (self.position_m, self.velocity_m_s, self.acceleration_m_s2);
        let mut left_s = t_s;
        for (duration_s, jerk) in self.phases {
            let t = left_s.min(duration_s);
            p += t * (v + t * (a / 2.0 + t * jerk / 6.0));
            v += t * (a + t * jerk / 2.0);
            a += t * jerk;
            left_s -= t;
        }
        (p, v)
    }
}

/// Brings every axis to rest, each as fast as its own limits allow.
///
/// An axis reverses only if it must: when it decelerates so hard that the jerk limit prevents it
/// from easing off before the velocity crosses 0.
#[derive(Clone, Copy, Debug)]
pub struct ControlledStop {
    axes: [Option<AxisStop>; MAX_AXES],
    time_s: f64,
    duration_s: f64,
}

impl ControlledStop {
    /// Plans the stop; entries beyond `n_axes` are ignored. Never fails, as there is no better
    /// fallback: an acceleration beyond the limit is cut to the limit, a NaN one counts as 0, and
    /// an unusable limit as unlimited.
    ///
    /// # Real Time
    /// Hot: does not allocate; one root per axis.
    pub fn new(
        position_m: &[f64; MAX_AXES],
        velocity_m_s: &[f64; MAX_AXES],
        acceleration_m_s2: &[f64; MAX_AXES],
        n_axes: usize,
        limits: &[AxisLimits; MAX_AXES],
    ) -> Self {
        let mut stop = Self { axes: [None; MAX_AXES], time_s: 0.0, duration_s: 0.0 };
        for axis in 0..n_axes.min(MAX_AXES) {
            let planned = AxisStop::plan(
                position_m[axis],
                velocity_m_s[axis],
                acceleration_m_s2[axis],
                &limits[axis],
            );
            stop.duration_s = stop.duration_s.max(planned.duration_s());
            stop.axes[axis] = Some(planned);
        }
        stop
    }

    /// Returns the time until the last axis is at rest.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Returns the set point one `dt_s` later; marked `done` once all axes are at rest, and
    /// repeated.
    ///
    /// # Real Time
    /// Hot, allocates nothing.
    pub fn next(&mut self, dt_s: f64) -> Setpoint {
        self.time_s += dt_s;
        let mut setpoint = Setpoint::at_rest([0.0; MAX_AXES]);
        for (axis, planned) in self.axes.iter().enumerate() {
            if let Some(planned) = planned {
                (setpoint.position_m[axis], setpoint.velocity_m_s[axis]) = planned.at(self.time_s);
            }
        }
        setpoint.done = self.time_s >= self.duration_s;
        setpoint
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

    fn limits(acceleration: f64, jerk: f64) -> AxisLimits {
        AxisLimits {
            velocity_max_m_s: 1.0,
            acceleration_max_m_s2: acceleration,
            jerk_max_m_s3: jerk,
        }
    }

    fn only(value: f64) -> [f64; MAX_AXES] {
        let mut all = [0.0; MAX_AXES];
        all[0] = value;
        all
    }

    #[test]
    fn hand_computed_stop() {
        // 1 m/s at 2 m/s2 and 8 m/s3: the mirror image of the rise in the profile, 0.75 s, 0.375 m.
        let mut stop = ControlledStop::new(
            &only(3.0),
            &only(1.0),
            &only(0.0),
            1,
            &[limits(2.0, 8.0); MAX_AXES],
        );
        assert!((stop.duration_s() - 0.75).abs() < 1e-15);
        let middle = stop.next(0.375);
        assert!((middle.velocity_m_s[0] - 0.5).abs() < 1e-15 && !middle.done);
        let rest = stop.next(0.375);
        assert!((rest.position_m[0] - 3.375).abs() < 1e-15);
        assert!(rest.done);
    }

    #[test]
    fn random_states_come_to_rest_within_limits_and_without_turning_back() {
        let mut random = Random(5);
        for _ in 0..20_000 {
            let (most, jerk) = (random.log(0.1, 50.0), random.log(1.0, 1e5));
            let v_0 = random.signed() * random.log(1e-4, 2.0);
            let a_0 = if random.unit() < 0.3 { 0.0 } else { random.signed() * most };
            let mut stop = ControlledStop::new(
                &only(0.1),
                &only(v_0),
                &only(a_0),
                1,
                &[limits(most, jerk); MAX_AXES],
            );
            let duration = stop.duration_s();
            let n_ticks = 200;
            let dt = duration / f64::from(n_ticks) * 1.000_000_1;
            // Easing off at once leaves this velocity; the stop may reverse only if it must.
            let eased = v_0 + a_0 * a_0.abs() / (2.0 * jerk);
            let peak = v_0.abs() + a_0 * a_0 / (2.0 * jerk);
            let (mut p, mut v, mut a) = (0.1, v_0, a_0);
            for tick in 1..=n_ticks {
                let now = stop.next(dt);
                let (p_now, v_now) = (now.position_m[0], now.velocity_m_s[0]);
                let a_now = (v_now - v) / dt;
                let rounding = 1e-13 * peak / dt;
                assert!(a_now.abs() <= most * (1.0 + 1e-9) + rounding, "{stop:?}");
                assert!(
                    ((a_now - a) / dt).abs() <= jerk * (1.0 + 1e-6) + 2.0 * rounding / dt,
                    "tick {tick} {stop:?}"
                );
                assert!(((p_now - p) / dt).abs() <= peak * (1.0 + 1e-9) + 1e-15 / dt, "{stop:?}");
                if v_0 * eased >= 0.0 {
                    assert!(v_now * v_0 >= -1e-13 * peak * peak, "turned back: {stop:?}");
                }
                (p, v, a) = (p_now, v_now, a_now);
                assert_eq!(now.done, tick == n_ticks);
            }
            assert_eq!(v, 0.0);
            // The analytic end is continuous.
            let axis = stop.axes[0].unwrap();
            assert!(axis.walk(duration).1.abs() <= 1e-12 * peak.max(1e-3), "{stop:?}");
        }
    }

    #[test]
    fn all_axes_rest_and_the_slowest_says_when() {
        let mut velocities = [0.0; MAX_AXES];
        (velocities[0], velocities[1]) = (0.5, -0.2);
        let mut stop = ControlledStop::new(
            &[1.0; MAX_AXES],
            &velocities,
            &[0.0; MAX_AXES],
            3,
            &[limits(2.0, 50.0); MAX_AXES],
        );
        let mut last = stop.next(0.001);
        for _ in 0..10_000 {
            if last.done {
                break;
            }
            last = stop.next(0.001);
        }
        assert!(last.done);
        assert_eq!(last.velocity_m_s, [0.0; MAX_AXES]);
        assert!(last.position_m[0] > 1.0 && last.position_m[1] < 1.0);
        assert_eq!(last.position_m[2].to_bits(), 1.0_f64.to_bits());
    }

    #[test]
    fn nonsense_stops_too() {
        let mut stop = ControlledStop::new(
            &only(0.2),
            &only(f64::NAN),
            &only(f64::INFINITY),
            1,
            &[limits(f64::NAN, 0.0); MAX_AXES],
        );
        let mut last = stop.next(0.01);
        for _ in 0..1000 {
            last = stop.next(0.01);
        }
        assert!(last.done && last.position_m[0].is_finite());
    }
}

//! Every motion against a bisection of its cruising velocity, at all scales.

use super::*;
use crate::interpolate::random::Random;

/// Limits, a start within them and able to stay within them, and a target.
#[derive(Debug)]
struct Case {
    start: AxisState,
    limits: AxisLimits,
    cruise_max_m_s: f64,
    target_m: f64,
}

impl Case {
    /// Draws a case at a random scale of length and time; `far` avoids targets near a direct stop.
    fn random(random: &mut Random, far: bool) -> Self {
        let (scale_m, scale_s) = (random.log(1e-9, 1e9), random.log(1e-6, 1e6));
        let speed = scale_m / scale_s;
        let (velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3) = (
            random.log(0.05, 5.0) * speed,
            random.log(0.01, 100.0) * speed / scale_s,
            random.log(0.01, 1e4) * speed / (scale_s * scale_s),
        );
        let limits = AxisLimits { velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3 };
        let kind = random.unit();
        let (mut v, mut a) = (0.0, 0.0);
        if kind > 0.1 {
            v = if kind > 0.9 { random.signed().signum() } else { random.signed() };
            v *= velocity_max_m_s;
        }
        if kind > 0.5 {
            a = random.signed() * acceleration_max_m_s2;
            // From some accelerations easing off would not stay within the velocity limit.
            if (v + a * a.abs() / (2.0 * jerk_max_m_s3)).abs() > velocity_max_m_s {
                a = 0.0;
            }
        }
        let start = AxisState { p: 0.0, v, a, j: 0.0 };
        let mut case = Self { start, limits, cruise_max_m_s: velocity_max_m_s, target_m: 0.0 };
        let stop_m = end(&case.with(0.0, 0.0)).p;
        let far_m = random.signed() * random.log(1e-9, 10.0) * scale_m;
        case.target_m = match random.unit() {
            _ if far => far_m,
            share if share < 0.05 => stop_m,
            share if share < 0.4 => stop_m * (1.0 + random.signed() * random.log(1e-12, 1.0)),
            share if share < 0.45 => 0.0,
            _ => far_m,
        };
        if random.unit() < 0.5 {
            case.cruise_max_m_s *= random.log(1e-3, 1.0);
        }
        case
    }

    fn fastest(&self) -> ToRest {
        ToRest::fastest(self.start, self.target_m, &self.limits, self.cruise_max_m_s)
    }

    /// The motion with a cruise.
    fn with(&self, cruise: f64, cruise_s: f64) -> ToRest {
        let [a, b, c] = ramp(self.start.v, self.start.a, cruise, &self.limits);
        let [d, e, f] = ramp(cruise, 0.0, 0.0, &self.limits);
        let phases = [a, b, c, (cruise_s, 0.0), d, e, f];
        let way = Approach::new(self.start, self.target_m, &self.limits);
        ToRest { start: self.start, way, phases, ramps: way.ramps(cruise), target_m: self.target_m }
    }

    /// The distance that the ramps to a cruise and from it leave.
    fn left(&self, cruise: f64) -> f64 {
        self.target_m - end(&self.with(cruise, 0.0)).p
    }

    /// The motion with a cruise that lasts for what the ramps leave.
    fn at(&self, cruise: f64) -> ToRest {
        let left = self.left(cruise);
        self.with(cruise, if cruise == 0.0 { 0.0 } else { (left / cruise).max(0.0) })
    }

    /// The fastest motion by bisection, as if the distance always grew with the cruise.
    fn bisected(&self) -> ToRest {
        let most = self.cruise_max_m_s;
        if self.left(most) >= 0.0 {
            return self.at(most);
        }
        if self.left(-most) <= 0.0 {
            return self.at(-most);
        }
        let (mut below, mut above) = (-most, most);
        for _ in 0..200 {
            let middle = 0.5 * (below + above);
            if self.left(middle) >= 0.0 { below = middle } else { above = middle }
        }
        self.at(if above > 0.0 { below.max(0.0) } else { above })
    }

    /// A slower motion by bisection.
    fn bisected_slower(&self, fastest: f64, duration_s: f64) -> ToRest {
        let (mut slow, mut fast) = (0.0, fastest);
        for _ in 0..200 {
            let middle = 0.5 * (slow + fast);
            if self.at(middle).duration_s() > duration_s { slow = middle } else { fast = middle }
        }
        self.at(fast)
    }

    /// The cruise of a motion with its sign.
    fn signed(&self, motion: &ToRest) -> f64 {
        motion.ramps.cruise.copysign(self.left(0.0))
    }

    /// The way that a motion takes, there and back: rounding is a share of it.
    fn way_m(&self, motion: &ToRest) -> f64 {
        let (mut state, mut way_m) = (motion.start, self.target_m.abs());
        let duration_s = motion.duration_s();
        for (t, j) in motion.phases {
            way_m += duration_s * (state.v.abs() + duration_s * state.a.abs());
            state = state.after(t, j);
        }
        way_m
    }

    /// Asserts that the phases end at rest at the target, and that each of them holds the limits.
    fn assert_arrives(&self, motion: &ToRest) {
        let AxisLimits { velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3 } = self.limits;
        let mut state = motion.start;
        for (t, j) in motion.phases {
            assert!(t >= 0.0 && j.abs() <= jerk_max_m_s3, "{self:?} {motion:?}");
            // Where the acceleration changes its sign, and at the end.
            let turn_s = (-state.a / j).clamp(0.0, t);
            for state in
                [state.after(if turn_s.is_nan() { 0.0 } else { turn_s }, j), state.after(t, j)]
            {
                assert!(state.v.abs() <= velocity_max_m_s * (1.0 + 1e-9), "{self:?} {motion:?}");
                assert!(
                    state.a.abs() <= acceleration_max_m_s2 * (1.0 + 1e-9),
                    "{self:?} {motion:?}"
                );
            }
            state = state.after(t, j);
        }
        let gap_m = (state.p - self.target_m).abs();
        assert!(gap_m <= 1e-14 * self.way_m(motion), "{gap_m} {self:?} {motion:?}");
        let change_m_s = acceleration_max_m_s2 * motion.duration_s();
        assert!(state.v.abs() <= 1e-14 * (velocity_max_m_s + change_m_s), "{self:?} {motion:?}");
        assert!(state.a.abs() <= 1e-13 * acceleration_max_m_s2, "{self:?} {motion:?}");
    }
}

/// A ramp to a velocity: three phases of duration and jerk.
fn ramp(v: f64, a: f64, to: f64, limits: &AxisLimits) -> [(f64, f64); 3] {
    let (most, jerk) = (limits.acceleration_max_m_s2, limits.jerk_max_m_s3);
    let missing = to - v - a * a.abs() / (2.0 * jerk);
    let sign = if missing < 0.0 { -1.0 } else { 1.0 };
    let (gap, a) = (sign * (to - v), sign * a);
    let reserve = (gap + a * a / (2.0 * jerk)).max(0.0);
    let peak = (jerk * reserve).sqrt();
    let (peak, hold_s) =
        if peak <= most { (peak, 0.0) } else { (most, (reserve - most * most / jerk) / most) };
    [(((peak - a) / jerk).max(0.0), sign * jerk), (hold_s, 0.0), (peak / jerk, -sign * jerk)]
}

/// State at the end of the phases.
fn end(motion: &ToRest) -> AxisState {
    motion.phases.iter().fold(motion.start, |state, &(t, j)| state.after(t, j))
}

#[test]
fn every_motion_arrives_within_the_limits_and_none_by_bisection_is_faster() {
    let (mut random, mut n_faster) = (Random(106), 0);
    for _ in 0..60_000 {
        let case = Case::random(&mut random, false);
        let motion = case.fastest();
        case.assert_arrives(&motion);
        let bisected_s = case.bisected().duration_s();
        n_faster += i32::from(motion.duration_s() < bisected_s * (1.0 - 1e-9));
        if motion.duration_s() <= bisected_s * (1.0 + 1e-12) {
            continue;
        }
        // Next to a direct stop or to the present velocity, rounding of the way decides.
        let rounding_m = 1e-15 * case.way_m(&motion);
        let near_s = [-rounding_m, rounding_m].map(|shift_m| {
            Case { target_m: case.target_m + shift_m, ..case }.bisected().duration_s()
        });
        let allowed_s = near_s[0].max(near_s[1]) + rounding_m / motion.ramps.cruise;
        assert!(motion.duration_s() <= allowed_s * (1.0 + 1e-12), "{near_s:?} {case:?} {motion:?}");
    }
    assert!(n_faster > 5_000, "several roots must occur: {n_faster}");
}

#[test]
fn a_slower_motion_arrives_in_time_and_early_only_if_there_is_none() {
    let (mut random, mut n_early) = (Random(107), 0);
    for _ in 0..60_000 {
        let case = Case::random(&mut random, false);
        let fastest = case.fastest();
        let duration_s = fastest.duration_s() * (1.0 + random.log(1e-9, 10.0));
        let motion = fastest.slowed(duration_s);
        case.assert_arrives(&motion);
        assert!(motion.duration_s() <= duration_s * (1.0 + 1e-14), "{case:?} {motion:?}");
        if fastest.ramps.cruise == 0.0 || motion.duration_s() >= duration_s * (1.0 - 1e-9) {
            continue;
        }
        n_early += 1;
        let later = (1..400)
            .map(|k| case.signed(&fastest) * 10.0_f64.powf(-f64::from(k) / 20.0))
            .find(|cruise| {
                let found = case.at(*cruise);
                let left = case.left(*cruise) * cruise.signum();
                left > 1e-14 * case.way_m(&found)
                    && found.duration_s() < duration_s
                    && found.duration_s() > motion.duration_s() * (1.0 + 1e-9)
            });
        assert!(later.is_none(), "{:?} {case:?} {fastest:?} {motion:?}", later.map(|c| case.at(c)));
    }
    assert!(n_early > 5_000, "cruises that go too far must occur: {n_early}");
}

#[test]
fn where_there_is_one_root_it_is_that_of_the_bisection() {
    let (mut random, mut n_same, mut n_compared) = (Random(108), 0, 0);
    for _ in 0..60_000 {
        let mut case = Case::random(&mut random, true);
        // From a start in motion away from the target the distance grows with the cruise.
        if case.left(0.0) * case.start.v > 0.0 {
            (case.start.v, case.start.a) = (-case.start.v, -case.start.a);
        }
        let AxisState { v, a, .. } = case.start;
        let eased = v + a * a.abs() / (2.0 * case.limits.jerk_max_m_s3);
        if case.left(0.0) * eased > 0.0 {
            continue;
        }
        let (motion, bisected) = (case.fastest(), case.bisected());
        n_compared += 1;
        n_same += i32::from(case.signed(&motion) == bisected.ramps.cruise);
        let assert_same = |motion: &ToRest, bisected: &ToRest| {
            let cruises = case.signed(motion) / bisected.ramps.cruise;
            let durations = motion.duration_s() / bisected.duration_s();
            assert!((cruises - 1.0).abs() < 1e-10, "{cruises} {case:?} {motion:?} {bisected:?}");
            assert!(
                (durations - 1.0).abs() < 1e-12,
                "{durations} {case:?} {motion:?} {bisected:?}"
            );
        };
        assert_same(&motion, &bisected);
        let duration_s = motion.duration_s() * (1.0 + random.log(1e-9, 10.0));
        let slower = motion.slowed(duration_s);
        assert_same(&slower, &case.bisected_slower(bisected.ramps.cruise, duration_s));
    }
    assert!(n_compared > 50_000 && 2 * n_same > n_compared, "{n_same} of {n_compared}");
}

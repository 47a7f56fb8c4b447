//! The cruising velocity of an axis that goes from any state of motion to rest at a target: the
//! fastest one, and the one that arrives at a given time.
//!
//! With the peaks `p` and `q` of acceleration in the ramps to the cruising velocity `c` and from it
//! to rest, and the sign `s` of the first, the derivatives of the distance `d` of both ramps and of
//! their duration `T` are `d' = s c/p + c/q + (p + q)/2J` and `T' = s/p + 1/q`. Newton's method
//! finds `c`, and the two neighbouring numbers between which the axis would go too far.

use super::axis_state::AxisState;
use crate::interpolate::AxisLimits;

/// Most evaluations of one search; a dozen is usual.
const STEPS: usize = 200;
/// Evaluations by Newton's method alone; later every other one halves the interval.
const NEWTON_STEPS: usize = 16;

/// The way to the target, in the sense in which the cruising velocity is not negative.
#[derive(Clone, Copy, Debug)]
pub(super) struct Approach {
    /// Sense: 1, or -1 if a direct stop would go beyond the target.
    sense: f64,
    velocity: f64,
    acceleration: f64,
    /// Change of velocity while the acceleration is ramped down, without sign.
    easing: f64,
    /// Velocity that remains after it.
    eased: f64,
    distance: f64,
    acceleration_max: f64,
    /// Change of velocity of a ramp that just reaches it.
    unheld: f64,
    jerk: f64,
    /// Distance beyond a direct stop.
    beyond_stop: f64,
}

/// The two ramps: one to the cruising velocity, one from it to rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ramps {
    /// Cruising velocity, without sign.
    pub(super) cruise: f64,
    first: Ramp,
    last: Ramp,
    /// Derivative of the last ramp's distance.
    last_slope: f64,
    distance: f64,
}

/// Three phases: the acceleration rises to its peak, is held, and falls to 0.
#[derive(Clone, Copy, Debug)]
struct Ramp {
    /// Sign of the jerk of the first phase.
    sign: f64,
    /// Peak acceleration, without sign.
    peak: f64,
    rise_s: f64,
    hold_s: f64,
    ease_s: f64,
}

/// An end of an interval of cruising velocities, with its ramps if they have been computed.
#[derive(Clone, Copy)]
struct Tried {
    cruise: f64,
    ramps: Option<Ramps>,
}

impl Tried {
    fn new(cruise: f64) -> Self {
        Self { cruise, ramps: None }
    }
}

impl From<Ramps> for Tried {
    fn from(ramps: Ramps) -> Self {
        Self { cruise: ramps.cruise, ramps: Some(ramps) }
    }
}

impl Ramp {
    fn duration_s(&self) -> f64 {
        self.rise_s + self.hold_s + self.ease_s
    }

    /// Returns duration and jerk of each phase.
    fn phases(&self, jerk: f64) -> [(f64, f64); 3] {
        let jerk = self.sign * jerk;
        [(self.rise_s, jerk), (self.hold_s, 0.0), (self.ease_s, -jerk)]
    }
}

impl Approach {
    /// Takes the sense of the motion from a direct stop.
    pub(super) fn new(start: AxisState, target_m: f64, limits: &AxisLimits) -> Self {
        let (most, jerk) = (limits.acceleration_max_m_s2, limits.jerk_max_m_s3);
        let mut way = Self {
            sense: 1.0,
            velocity: start.v,
            acceleration: start.a,
            easing: start.a * start.a / (2.0 * jerk),
            eased: start.v + start.a * start.a.abs() / (2.0 * jerk),
            distance: target_m - start.p,
            acceleration_max: most,
            unheld: most * most / jerk,
            jerk,
            beyond_stop: 0.0,
        };
        way.beyond_stop = way.distance - way.ramps(0.0).distance;
        if way.beyond_stop >= 0.0 {
            return way;
        }
        Self {
            sense: -1.0,
            velocity: -way.velocity,
            acceleration: -way.acceleration,
            eased: -way.eased,
            distance: -way.distance,
            beyond_stop: -way.beyond_stop,
            ..way
        }
    }

    /// Returns the ramps of the fastest motion; those of a direct stop cruise at 0.
    pub(super) fn fastest(&self, cruise_max_m_s: f64) -> Ramps {
        if self.beyond_stop == 0.0 {
            return self.ramps(0.0);
        }
        let reaches = |cruise: f64| self.left(&self.ramps(cruise)) >= 0.0;
        let quickest = self.ramps(cruise_max_m_s);
        if self.left(&quickest) >= 0.0 {
            quickest
        } else if self.eased > 0.0 && (cruise_max_m_s <= self.eased || !reaches(self.eased)) {
            // Below the present velocity the distance rises with that of the cruise, then falls.
            let above = self.eased.min(cruise_max_m_s);
            self.reaching(0.0, above, 0.5 * above)
        } else {
            let below = self.eased.max(0.0);
            self.reaching(below, cruise_max_m_s, self.rising(below, cruise_max_m_s))
        }
    }

    /// Returns the ramps of the slowest cruise, not faster than the fastest one, that arrives no
    /// later than `duration_s`.
    pub(super) fn slower(&self, fastest: &Ramps, duration_s: f64) -> Ramps {
        let arrives = |ramps: &Ramps| {
            let (left, cruise_s) = (self.left(ramps), duration_s - ramps.duration_s());
            // `c (T - duration)`, T with the cruise; its derivative is finite everywhere.
            let late = left - ramps.cruise * cruise_s;
            let slope = -(ramps.first.peak + ramps.last.peak) / (2.0 * self.jerk) - cruise_s;
            (late <= 0.0 && left >= 0.0, ramps.cruise - late / slope)
        };
        let within = |fast: &Ramps| {
            let ends = [Tried::from(*fast), Tried::new(0.0)];
            self.narrowed(ends, arrives(fast).1, 8.0 * f64::EPSILON, arrives)
        };
        let [found, lower] = within(fastest);
        let found = self.known(found);
        if self.eased <= 0.0 {
            return found;
        }
        let lower = self.known(lower);
        if self.left(&lower) >= 0.0 {
            return found;
        }
        // Slightly slower cruises go too far; those below another root do not.
        let slow = self.reaching(0.0, lower.cruise, 0.5 * lower.cruise);
        if arrives(&slow).0 { self.known(within(&slow)[0]) } else { found }
    }

    /// Returns duration and jerk of the seven phases: the cruise lasts for what the ramps leave.
    pub(super) fn phases(&self, ramps: &Ramps) -> [(f64, f64); 7] {
        let Ramps { cruise, .. } = *ramps;
        let cruise_s = if cruise == 0.0 { 0.0 } else { (self.left(ramps) / cruise).max(0.0) };
        let [a, b, c] = ramps.first.phases(self.sense * self.jerk);
        let [d, e, f] = ramps.last.phases(self.sense * self.jerk);
        [a, b, c, (cruise_s, 0.0), d, e, f]
    }

    /// Returns the distance that the ramps leave, negative if they go too far.
    fn left(&self, ramps: &Ramps) -> f64 {
        self.distance - ramps.distance
    }

    /// Returns the ramps next to the root in an interval of velocities at whose lower end they do not
    /// go too far, and do at its upper one.
    fn reaching(&self, below: f64, above: f64, guess: f64) -> Ramps {
        let [found, _] = self.narrowed([below, above].map(Tried::new), guess, 0.0, |ramps| {
            let (Ramp { sign, peak, .. }, cruise) = (ramps.first, ramps.cruise);
            let slope = sign * cruise / peak + peak / (2.0 * self.jerk) + ramps.last_slope;
            let left = self.left(ramps);
            (left >= 0.0, cruise + left / slope)
        });
        self.known(found)
    }

    /// Narrows an interval of velocities to a share of its ends, for 0 until they are neighbouring
    /// numbers, and returns first the end at which the test is true.
    ///
    /// The test also returns Newton's next value; near the root that value is moved across it, so
    /// that both ends close in. A value outside the interval is replaced by its middle.
    fn narrowed(
        &self,
        [mut inside, mut outside]: [Tried; 2],
        guess: f64,
        share: f64,
        test: impl Fn(&Ramps) -> (bool, f64),
    ) -> [Tried; 2] {
        let mut next = guess;
        for step in 0..STEPS {
            let (at, other) = (inside.cruise, outside.cruise);
            let is_between = |next: f64| at.min(other) < next && next < at.max(other);
            if !is_between(next) || (step > NEWTON_STEPS && step % 2 == 0) {
                next = 0.5 * (at + other);
            }
            if !is_between(next) || (at - other).abs() <= share * at.abs() {
                break;
            }
            let ramps = self.ramps(next);
            let (is_inside, newton) = test(&ramps);
            let (end, other) = if is_inside { (&mut inside, other) } else { (&mut outside, at) };
            *end = Tried::from(ramps);
            next = newton + (2.0 * f64::EPSILON * newton.abs()).copysign(other - newton);
        }
        [inside, outside]
    }

    /// Returns the ramps of an end.
    fn known(&self, Tried { cruise, ramps }: Tried) -> Ramps {
        ramps.unwrap_or_else(|| self.ramps(cruise))
    }

    /// Approaches the root above the eased velocity, where the first ramp accelerates.
    ///
    /// The distance over the peak acceleration of the first ramp, continued in a straight line
    /// where the limit cuts it, is rising and convex: Newton's method falls towards the root.
    fn rising(&self, below: f64, above: f64) -> f64 {
        let (most, jerk) = (self.acceleration_max, self.jerk);
        let from = self.velocity - self.easing;
        let peak = |cruise: f64| {
            let squared = jerk * (cruise - from).max(0.0);
            if squared <= most * most { squared.sqrt() } else { 0.5 * (most + squared / most) }
        };
        let cruise = |peak: f64| {
            let squared = if peak <= most { peak * peak } else { most * (2.0 * peak - most) };
            from + squared / jerk
        };
        let next = |at: f64| {
            let cruise = cruise(at);
            let ramps = self.ramps(cruise.max(below));
            let peak = ramps.first.peak;
            let slope = 2.0 * cruise + peak * peak / jerk + 2.0 * peak * ramps.last_slope;
            at + self.left(&ramps) / slope * jerk
        };
        // From the left the first step goes beyond the root, unless to infinity.
        let mut at = next(peak(below)).min(peak(above));
        for _ in 0..STEPS {
            let lower = next(at);
            if lower >= at || lower.is_nan() {
                break;
            }
            at = lower;
        }
        cruise(at)
    }

    /// Returns the ramps to a cruising velocity and from it to rest.
    pub(super) fn ramps(&self, cruise: f64) -> Ramps {
        let jerk = self.jerk;
        let sign = if cruise < self.eased { -1.0 } else { 1.0 };
        let (v, a, c) = (sign * self.velocity, sign * self.acceleration, sign * cruise);
        let first = self.ramp(sign, (c - v + self.easing).max(0.0), a);
        let last = self.ramp(-1.0, cruise, 0.0);
        let Ramp { peak, rise_s, hold_s, ease_s, .. } = first;
        let there = rise_s * (v + rise_s * (0.5 * a + rise_s * jerk / 6.0))
            + hold_s * (c - 0.5 * peak * (ease_s + hold_s))
            + ease_s * (c - ease_s * peak / 6.0);
        let last_slope = if last.hold_s > 0.0 { cruise / last.peak } else { last.ease_s };
        Ramps {
            cruise,
            first,
            last,
            last_slope: last_slope + 0.5 * last.ease_s,
            distance: sign * there + 0.5 * cruise * last.duration_s(),
        }
    }

    /// Returns a ramp from an acceleration; `reserve` is its change of velocity from the time at
    /// which the acceleration was 0, or would have been.
    fn ramp(&self, sign: f64, reserve: f64, acceleration: f64) -> Ramp {
        let (most, jerk) = (self.acceleration_max, self.jerk);
        let peak = (jerk * reserve).sqrt();
        let (peak, hold_s) =
            if peak <= most { (peak, 0.0) } else { (most, (reserve - self.unheld) / most) };
        // Rounding must not leave an acceleration at the end of the ramp.
        let peak = peak.max(acceleration);
        let ease_s = peak / jerk;
        let rise_s = if acceleration == 0.0 { ease_s } else { (peak - acceleration) / jerk };
        Ramp { sign, peak, rise_s, hold_s, ease_s }
    }
}

impl Ramps {
    fn duration_s(&self) -> f64 {
        self.first.duration_s() + self.last.duration_s()
    }
}

//! Tick of a blended path: the polyline at its feed, through two cascaded moving averages.
//!
//! The first average turns a step of velocity into a ramp (limited acceleration), the second rounds
//! the ramp's ends (limited jerk: an S-curve). Positions are summed as integers of 2⁻⁵⁰ m, so the
//! running sums are exact however long the run is: no drift, and the end is the programmed end.

use super::MAX_AXES;
use super::element::{Element, Leg};
use super::setpoint::Setpoint;

/// Fixed-point units per metre; 2⁵⁰, so that 4096 m fit 63 bits.
const UNITS_PER_M: f64 = 1_125_899_906_842_624.0;

/// A leg at constant speed with its time span.
#[derive(Clone, Debug)]
struct TimedLeg {
    element: Element,
    feed_m_s: f64,
    start_s: f64,
    end_s: f64,
}

/// Moving sum of one axis.
#[derive(Clone, Debug)]
struct MovingSum {
    ring: Box<[i128]>,
    at: usize,
    sum: i128,
}

impl MovingSum {
    fn filled(ticks: usize, value: i128) -> Self {
        let ring: Box<[i128]> = std::iter::repeat_n(value, ticks.max(1)).collect();
        let mut filter = Self { ring, at: 0, sum: 0 };
        filter.fill(value);
        filter
    }

    fn fill(&mut self, value: i128) {
        self.ring.fill(value);
        self.at = 0;
        self.sum = value * self.ring.len() as i128;
    }

    fn next(&mut self, value: i128) -> i128 {
        self.sum += value - self.ring[self.at];
        self.ring[self.at] = value;
        self.at += 1;
        if self.at == self.ring.len() {
            self.at = 0;
        }
        self.sum
    }
}

/// The polyline, the filters of each axis, and three neighbouring set points.
#[derive(Clone, Debug)]
pub(crate) struct Blend {
    legs: Box<[TimedLeg]>,
    current: usize,
    filters: Box<[(MovingSum, MovingSum)]>,
    units_per_m: f64,
    cycle_s: f64,
    /// Set points of the previous, this and the next tick: their slope is the velocity.
    around_m: [[f64; MAX_AXES]; 3],
    ticks_ahead: u64,
}

impl Blend {
    /// Schedules the legs from `start_s` on, and sizes the filters. Cold.
    pub(crate) fn plan(
        legs: &[Leg],
        n_axes: usize,
        mut start_s: f64,
        cycle_s: f64,
        (window, rounding): (usize, usize),
    ) -> Self {
        let mut timed = |&Leg { element, feed_m_s, dwell_s }: &Leg| {
            let end_s = start_s + element.length_m() / feed_m_s;
            let leg = TimedLeg { element, feed_m_s, start_s, end_s };
            start_s = end_s + dwell_s;
            leg
        };
        let legs = legs.iter().map(&mut timed).collect();
        let pair = (MovingSum::filled(window, 0), MovingSum::filled(rounding, 0));
        let mut plan = Self {
            legs,
            current: 0,
            filters: std::iter::repeat_n(pair, n_axes).collect(),
            units_per_m: UNITS_PER_M * window.max(1) as f64 * rounding.max(1) as f64,
            cycle_s,
            around_m: [[0.0; MAX_AXES]; 3],
            ticks_ahead: 0,
        };
        plan.restart();
        plan
    }

    /// Returns the end time of the unfiltered polyline.
    pub(crate) fn end_s(&self) -> f64 {
        self.legs.last().map_or(0.0, |last| last.end_s)
    }

    /// Returns the delay of filters and slope in ticks: that long after `end_s`, the path is at
    /// rest.
    pub(crate) fn ticks_late(&self) -> usize {
        self.filters.first().map_or(0, |(first, second)| first.ring.len() + second.ring.len())
    }

    /// Restarts at the beginning, at rest.
    pub(crate) fn restart(&mut self) {
        self.current = 0;
        self.ticks_ahead = 0;
        let start_m = self.legs.first().map_or([0.0; MAX_AXES], |leg| leg.element.start_m());
        let window = self.filters.first().map_or(1, |(window, _)| window.ring.len()) as i128;
        for ((averaged, rounded), position_m) in self.filters.iter_mut().zip(start_m) {
            averaged.fill(units(position_m));
            rounded.fill(units(position_m) * window);
        }
        self.around_m = [self.read_out(); 3];
        self.look_ahead();
    }

    /// Returns the set point of this tick, and advances the look-ahead by one tick.
    pub(crate) fn next(&mut self) -> Setpoint {
        let [before_m, now_m, after_m] = self.around_m;
        let mut setpoint = Setpoint::at_rest(now_m);
        for (axis, velocity_m_s) in setpoint.velocity_m_s.iter_mut().enumerate() {
            *velocity_m_s = (after_m[axis] - before_m[axis]) / (2.0 * self.cycle_s);
        }
        self.look_ahead();
        setpoint
    }

    /// Shifts the neighbours by one tick and filters the next set point (look-ahead).
    fn look_ahead(&mut self) {
        if self.ticks_ahead > 0 {
            self.around_m[0] = self.around_m[1];
            self.around_m[1] = self.around_m[2];
        }
        // Delayed by one tick, so that the slope at the first tick is 0.
        let raw_m = self.polyline_m(self.ticks_ahead as f64 * self.cycle_s);
        self.ticks_ahead += 1;
        for ((averaged, rounded), position_m) in self.filters.iter_mut().zip(raw_m) {
            rounded.next(averaged.next(units(position_m)));
        }
        self.around_m[2] = self.read_out();
    }

    /// Returns the sums of the second filters in metres.
    fn read_out(&self) -> [f64; MAX_AXES] {
        let mut position_m = [0.0; MAX_AXES];
        for (position_m, (_, rounded)) in position_m.iter_mut().zip(&self.filters) {
            *position_m = rounded.sum as f64 / self.units_per_m;
        }
        position_m
    }

    /// Returns the unfiltered polyline at a time not earlier than that of the previous call.
    fn polyline_m(&mut self, t_s: f64) -> [f64; MAX_AXES] {
        while self.current + 1 < self.legs.len() && t_s >= self.legs[self.current].end_s {
            self.current += 1;
        }
        let Some(leg) = self.legs.get(self.current) else { return [0.0; MAX_AXES] };
        if t_s >= leg.end_s {
            leg.element.end_m()
        } else {
            leg.element.point_m(leg.feed_m_s * (t_s - leg.start_s).max(0.0))
        }
    }
}

/// Converts a position to fixed-point units.
#[expect(
    clippy::cast_possible_truncation,
    reason = "planning holds positions within 4096 m, which is 2^62 units"
)]
fn units(position_m: f64) -> i128 {
    i128::from((position_m * UNITS_PER_M).round() as i64)
}

//! Profile position: set-points, their hand-shake, and their queue of one.

use super::drive::DriveNode;
use super::profile::{Goal, ProfileLaw};

/// Bit 5 of the controlword: change at once, without waiting for the present set-point.
const IMMEDIATE: u16 = 1 << 5;
/// Bit 6 of the controlword: the target is a distance.
const RELATIVE: u16 = 1 << 6;
/// Bit 9 of the controlword: change on set-point, i.e. pass the present one without a stop.
const BLEND: u16 = 1 << 9;

/// Share of the speed from which the next set-point can be reached: the present one is passed up to a step late.
const BLEND_SHARE: f64 = 0.95;

/// A target with the limits that were set when it was taken over.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SetPoint {
    position_m: f64,
    law: ProfileLaw,
    /// The set-point before it is passed on the way.
    is_blended: bool,
}

/// The set-points of a drive.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Positioning {
    active: Option<SetPoint>,
    queued: Option<SetPoint>,
    is_acknowledged: bool,
    is_limited: bool,
}

impl Positioning {
    /// Returns bit 12 of the statusword: a set-point was taken, or there is no room for one.
    pub(super) fn is_acknowledged(&self) -> bool {
        self.is_acknowledged
    }

    /// Returns whether the last target was beyond a limit.
    pub(super) fn is_limited(&self) -> bool {
        self.is_limited
    }

    /// Returns whether a set-point waits for the end of another.
    pub(super) fn has_queued(&self) -> bool {
        self.queued.is_some()
    }

    /// Returns the goal on the way from a position to the active set-point: rest there, or the velocity of its
    /// profile if the next one is beyond it and can still be reached without overshoot.
    fn goal(&self, active: &SetPoint, from_m: f64) -> Goal {
        let position_m = active.position_m;
        let next = self.queued.filter(|next| next.is_blended);
        let way_m = next.map_or(0.0, |next| next.position_m - position_m);
        match next {
            Some(next) if way_m * (position_m - from_m) > 0.0 => {
                let brakeable_m_s = (2.0 * next.law.deceleration_m_s2 * way_m.abs()).sqrt();
                let speed_m_s = active.law.velocity_m_s.min(BLEND_SHARE * brakeable_m_s);
                Goal::Through { position_m, velocity_m_s: speed_m_s.copysign(way_m) }
            }
            _ => Goal::Place { position_m },
        }
    }

    /// Ends the acknowledgement, once the controller has ended its request and there is room.
    pub(super) fn end_acknowledgement(&mut self, is_requested: bool) {
        if !is_requested && self.queued.is_none() {
            self.is_acknowledged = false;
        }
    }
}

impl DriveNode {
    /// Takes over a new set-point, on the rising edge of bit 4; without room it is not acknowledged.
    pub(super) fn take_set_point(&mut self, controlword: u16) {
        if self.positioning.has_queued() {
            return;
        }
        let target = self.number(self.slots.target_position);
        let asked_m = if controlword & RELATIVE == 0 {
            self.units.place_m(target)
        } else {
            let from_m = self.positioning.active.map(|active| active.position_m);
            let from_m = from_m.or(self.motion.demand_m()).unwrap_or(self.measured.position_m);
            from_m + self.units.distance_m(target)
        };
        let limits = self.units.limits();
        let position_m = asked_m.min(limits.position_max_m).max(limits.position_min_m);
        let is_blended = controlword & BLEND != 0;
        let set_point = SetPoint { position_m, law: *self.units.profile(), is_blended };
        self.positioning.is_limited = position_m.to_bits() != asked_m.to_bits();
        self.positioning.is_acknowledged = true;
        let is_busy = self.positioning.active.is_some() && !self.motion.has_arrived();
        if is_busy && controlword & IMMEDIATE == 0 {
            self.positioning.queued = Some(set_point);
            self.begin();
        } else {
            self.positioning.active = Some(set_point);
            self.begin();
        }
        self.reached.restart();
    }

    /// Continues after a halt, and goes on to the next set-point.
    pub(super) fn pursue_set_points(&mut self) {
        if self.motion.is_holding() {
            self.begin();
        } else if self.motion.has_arrived()
            && let Some(next) = self.positioning.queued.take()
        {
            self.positioning.active = Some(next);
            self.positioning.end_acknowledgement(self.asks_for_motion());
            self.begin();
        }
    }

    fn begin(&mut self) {
        if let (Some(active), false) = (self.positioning.active, self.is_halted) {
            let from_m = self.motion.demand_m().unwrap_or(self.measured.position_m);
            self.motion.pursue(self.positioning.goal(&active, from_m), active.law);
        }
    }
}

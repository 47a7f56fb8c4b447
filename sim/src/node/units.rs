//! From the coordinate of the axis to the numbers on the bus: polarity, factors, units, home offset.

use super::dictionary::{Dictionary, Slot};
use super::drive_objects::{UNIT_COUNTS, rounded};
use super::drive_slots::DriveSlots;
use super::motion::MotionLimits;
use super::profile::ProfileLaw;
use super::switches::Switches;

/// Bit 7 of the polarity: positions are inverted.
const REVERSED_POSITION: i64 = 0x80;
/// Bit 6 of the polarity: velocities are inverted.
const REVERSED_VELOCITY: i64 = 0x40;
/// A 32-bit limit at its maximum is no limit.
const NO_LIMIT: i64 = 0xFFFF_FFFF;
/// Way from the edge of a limit switch to where it stops an axis.
const OVERRUN_M: f64 = 1e-5;

/// The conversion between SI units and a drive's objects, cached from its dictionary.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    position_per_m: f64,
    velocity_per_m: f64,
    home_offset: i64,
    /// Place of the machine's home; 0 before the axis was homed.
    home_m: f64,
    /// Range after which positions wrap, if they do.
    range: Option<(i64, i64)>,
    limits: MotionLimits,
    quick_deceleration_m_s2: f64,
    slow_deceleration_m_s2: f64,
    force_share: f64,
    profile: ProfileLaw,
    homing: ProfileLaw,
    homing_creep_m_s: f64,
}

impl Units {
    /// Reads the conversion, and all rarely changing values that it converts.
    pub(super) fn read(
        dictionary: &Dictionary,
        slots: &DriveSlots,
        counts_per_m: f64,
        home_m: f64,
    ) -> Self {
        let number = |slot: Slot| dictionary.number(slot);
        let ratio = |over: Slot, under: Slot| number(over) as f64 / number(under).max(1) as f64;
        let sign = |bit| if number(slots.polarity) & bit == 0 { 1.0 } else { -1.0 };
        let resolution = ratio(slots.encoder_increments, slots.encoder_revolutions);
        let position_factor = ratio(slots.feed, slots.feed_revolutions)
            / (resolution * ratio(slots.gear_motor, slots.gear_shaft));
        let velocity_factor = position_factor
            * (resolution / ratio(slots.velocity_increments, slots.velocity_revolutions))
            * ratio(slots.velocity_numerator, slots.velocity_denominator);
        let position_counts = per_m(number(slots.position_unit), counts_per_m);
        let velocity_counts = per_m(number(slots.velocity_unit), counts_per_m);
        let position_per_m = position_counts * position_factor * sign(REVERSED_POSITION);
        let velocity_per_m = velocity_counts * velocity_factor * sign(REVERSED_VELOCITY);
        let home_offset = number(slots.home_offset);
        let (low, high) = (number(slots.range_min), number(slots.range_max));
        let wraps = low < high && (low > i32::MIN.into() || high < i32::MAX.into());

        let place = |slot| home_m + (number(slot) + home_offset) as f64 / position_per_m;
        let (one_m, other_m) = (place(slots.position_min), place(slots.position_max));
        let backwards = position_per_m < 0.0;
        let speed = |slot| number(slot) as f64 / velocity_per_m.abs();
        let acceleration_per_m = velocity_per_m.abs()
            * ratio(slots.acceleration_numerator, slots.acceleration_denominator);
        let acceleration = |slot| number(slot) as f64 / acceleration_per_m;
        let unless_unlimited = |slot: Slot, value: f64| {
            if number(slot) == NO_LIMIT { f64::INFINITY } else { value }
        };
        let motor_m_s =
            number(slots.motor_speed_max) as f64 / 60.0 * resolution / counts_per_m.abs();
        let deceleration_max_m_s2 =
            unless_unlimited(slots.deceleration_max, acceleration(slots.deceleration_max));
        let velocity_max_m_s =
            speed(slots.velocity_max).min(unless_unlimited(slots.motor_speed_max, motor_m_s));
        let acceleration_max_m_s2 =
            unless_unlimited(slots.acceleration_max, acceleration(slots.acceleration_max));
        let slow_deceleration_m_s2 =
            acceleration(slots.profile_deceleration).min(deceleration_max_m_s2);
        let homing_m_s2 = acceleration(slots.homing_acceleration);
        let torque =
            [slots.torque_max, slots.current_max, slots.positive_torque, slots.negative_torque];
        Self {
            position_per_m,
            velocity_per_m,
            home_offset,
            home_m,
            range: wraps.then_some((low, high)),
            limits: MotionLimits {
                position_min_m: if backwards { other_m } else { one_m },
                position_max_m: if backwards { one_m } else { other_m },
                velocity_max_m_s,
                acceleration_max_m_s2,
                deceleration_max_m_s2,
            },
            quick_deceleration_m_s2: acceleration(slots.deceleration).min(deceleration_max_m_s2),
            slow_deceleration_m_s2,
            force_share: torque
                .into_iter()
                .fold(1.0, |share: f64, slot| share.min(number(slot) as f64 / 1000.0)),
            profile: ProfileLaw {
                velocity_m_s: speed(slots.profile_velocity).min(velocity_max_m_s),
                acceleration_m_s2: acceleration(slots.profile_acceleration)
                    .min(acceleration_max_m_s2),
                deceleration_m_s2: slow_deceleration_m_s2,
            },
            homing: ProfileLaw {
                velocity_m_s: speed(slots.homing_speed).min(velocity_max_m_s),
                acceleration_m_s2: homing_m_s2.min(acceleration_max_m_s2),
                deceleration_m_s2: homing_m_s2.min(deceleration_max_m_s2),
            },
            homing_creep_m_s: speed(slots.homing_creep).min(velocity_max_m_s),
        }
    }

    /// Bounds every motion by the limit switches: a little beyond them, so that they are closed there.
    #[must_use]
    pub(super) fn within(mut self, switches: &Switches) -> Self {
        let limits = &mut self.limits;
        limits.position_min_m = limits.position_min_m.max(switches.min_m - OVERRUN_M);
        limits.position_max_m = limits.position_max_m.min(switches.max_m + OVERRUN_M);
        self
    }

    /// Returns the limits of every motion.
    pub(super) fn limits(&self) -> &MotionLimits {
        &self.limits
    }

    /// Returns the deceleration of the quick-stop ramp.
    pub(super) fn quick_deceleration_m_s2(&self) -> f64 {
        self.quick_deceleration_m_s2
    }

    /// Returns the deceleration of the slow-down ramp.
    pub(super) fn slow_deceleration_m_s2(&self) -> f64 {
        self.slow_deceleration_m_s2
    }

    /// Returns the limits of the drive's own profiles; 0x6081 counts in profile position only.
    pub(super) fn profile(&self) -> &ProfileLaw {
        &self.profile
    }

    /// Returns the limits of homing; the speed is that of the search for a switch.
    pub(super) fn homing(&self) -> &ProfileLaw {
        &self.homing
    }

    /// Returns the speed of the search for an edge or an index pulse.
    pub(super) fn homing_creep_m_s(&self) -> f64 {
        self.homing_creep_m_s
    }

    /// Returns the motor's force limit as a share, 0 to 1.
    pub(super) fn force_share(&self) -> f64 {
        self.force_share
    }

    /// Converts a position to the drive's units.
    pub(super) fn position(&self, position_m: f64) -> i64 {
        let shown = rounded((position_m - self.home_m) * self.position_per_m) - self.home_offset;
        match self.range {
            Some((low, high)) => low + (shown - low).rem_euclid(high - low + 1),
            None => shown,
        }
    }

    /// Converts a target to a position.
    pub(super) fn place_m(&self, target: i64) -> f64 {
        self.home_m + (target + self.home_offset) as f64 / self.position_per_m
    }

    /// Converts a distance to the drive's units.
    pub(super) fn distance(&self, distance_m: f64) -> f64 {
        distance_m * self.position_per_m
    }

    /// Converts a velocity to the drive's units.
    pub(super) fn velocity(&self, velocity_m_s: f64) -> i64 {
        rounded(velocity_m_s * self.velocity_per_m)
    }

    /// Converts a number to a distance.
    pub(super) fn distance_m(&self, number: i64) -> f64 {
        number as f64 / self.position_per_m
    }

    /// Converts a number to a velocity.
    pub(super) fn velocity_m_s(&self, number: i64) -> f64 {
        number as f64 / self.velocity_per_m
    }
}

/// One metre in a unit of 0x60A8 or 0x60A9: counts, or metres with a prefix.
fn per_m(unit: i64, counts_per_m: f64) -> f64 {
    let [.., numerator, prefix] = u32::try_from(unit).unwrap_or(UNIT_COUNTS).to_le_bytes();
    if numerator == 0x01 {
        10.0_f64.powi(-i32::from(prefix.cast_signed())).copysign(counts_per_m)
    } else {
        counts_per_m
    }
}

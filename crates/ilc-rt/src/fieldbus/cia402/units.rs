//! Conversion between SI units and the counts of a drive, in this place only.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

/// The metre, as CiA 303-2 codes it.
pub const UNIT_METRE: u32 = 0x01;
/// The radian, as CiA 303-2 codes it.
pub const UNIT_RADIAN: u32 = 0x10;
/// The second, as CiA 303-2 codes it.
const UNIT_SECOND: u32 = 0x03;

/// Counts of a drive or encoder per SI unit, with the sign of the axis and the place of its zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Negative for an axis whose positive direction is the drive's negative one.
    counts_per_m: f64,
    /// Position at which the drive shows 0.
    zero_m: f64,
}

impl Scale {
    /// Returns the scale, or `None` unless `counts_per_m` is finite and above zero.
    pub fn new(counts_per_m: f64) -> Option<Self> {
        (counts_per_m.is_finite() && counts_per_m > 0.0)
            .then_some(Self { counts_per_m, zero_m: 0.0 })
    }

    /// Returns the scale of an axis that counts in the other direction than its drive, if it does.
    #[must_use]
    pub fn reversed(self, is_reversed: bool) -> Self {
        if is_reversed { Self { counts_per_m: -self.counts_per_m, ..self } } else { self }
    }

    /// Returns the scale of an axis that is at `zero_m` where its drive shows 0.
    #[must_use]
    pub fn with_zero_m(self, zero_m: f64) -> Self {
        Self { zero_m, ..self }
    }

    /// Returns the nearest count of a position.
    ///
    /// Values beyond 32 bits saturate. NaN gives `None`, never 0: zero is a position, and a drive
    /// commanded there moves.
    pub fn position_to_counts(self, position_m: f64) -> Option<i32> {
        self.to_counts(position_m - self.zero_m)
    }

    /// Returns the position of `counts`.
    pub fn position_m(self, counts: i32) -> f64 {
        self.to_si(counts) + self.zero_m
    }

    /// Returns the nearest count of a distance (m) or velocity (m/s), which have no zero of their own;
    /// `None` for NaN, as [`Scale::position_to_counts`].
    pub fn to_counts(self, value_si: f64) -> Option<i32> {
        if value_si.is_nan() {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "saturates, and not NaN here")]
        Some((value_si * self.counts_per_m).round() as i32)
    }

    /// Returns the distance (m) or velocity (m/s) of `counts`.
    pub fn to_si(self, counts: i32) -> f64 {
        f64::from(counts) / self.counts_per_m
    }

    /// Returns 1, or -1 for an axis whose positive direction is the drive's negative one: the factor
    /// between a force of the axis and a torque of the drive.
    pub fn sign(self) -> f64 {
        self.counts_per_m.signum()
    }

    /// Returns the SI units equal to one count and to one count per second, coded as in objects
    /// 0x60A8 and 0x60A9, if a count is a power of ten of the unit; `unit` is that of the axis
    /// without prefix, e.g. [`UNIT_METRE`].
    pub fn si_units(self, unit: u32) -> Option<(u32, u32)> {
        (-9..=6_i8).find_map(|prefix| {
            let exact = 10.0_f64.powi((-prefix).into());
            let is_it = (self.counts_per_m.abs() / exact - 1.0).abs() < 1e-9;
            let position = u32::from(prefix.cast_unsigned()) << 24 | unit << 16;
            is_it.then_some((position, position | UNIT_SECOND << 8))
        })
    }

    /// Returns the counts per metre, without the sign of the axis.
    pub fn counts_per_m(self) -> f64 {
        self.counts_per_m.abs()
    }
}

/// Returns `value / rated` in thousandths, saturating at 16 bits; 0 for NaN, as no force is the
/// safe feed-forward.
pub fn per_mille(value: f64, rated: f64) -> i16 {
    let ratio = value / rated * 1000.0;
    #[expect(clippy::cast_possible_truncation, reason = "saturates; NaN gives 0, as documented")]
    {
        ratio.round() as i16
    }
}

/// Returns the value of `thousandths` of `rated`.
pub fn from_per_mille(thousandths: i16, rated: f64) -> f64 {
    f64::from(thousandths) * 1e-3 * rated
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    #[test]
    fn rounds_to_the_nearest_count_and_saturates() {
        let scale = Scale::new(1e8).unwrap();
        assert_eq!(scale.to_counts(0.04), Some(4_000_000));
        assert_eq!(scale.to_counts(-4.9e-9), Some(0));
        assert_eq!(scale.to_counts(-5.1e-9), Some(-1));
        assert_eq!(scale.to_counts(1e9), Some(i32::MAX));
        assert_eq!(scale.to_counts(f64::NEG_INFINITY), Some(i32::MIN));
        assert_eq!(scale.to_counts(f64::NAN), None);
    }

    #[test]
    fn every_count_survives_the_way_there_and_back() {
        let scale = Scale::new(123_456.789).unwrap();
        for counts in [i32::MIN, -1, 0, 1, 77_777, i32::MAX] {
            assert_eq!(scale.to_counts(scale.to_si(counts)), Some(counts));
        }
    }

    #[test]
    fn sign_and_zero_of_an_axis_go_both_ways() {
        let scale = Scale::new(1e3).unwrap().reversed(true).with_zero_m(0.5);
        assert_eq!(scale.position_to_counts(0.5), Some(0));
        assert_eq!(scale.position_to_counts(0.7), Some(-200));
        assert_eq!(scale.to_counts(0.2), Some(-200), "a velocity has no zero");
        assert!((scale.position_m(-200) - 0.7).abs() < 1e-12 && scale.sign() < 0.0);
        assert!((scale.to_si(-200) - 0.2).abs() < 1e-12);
        assert_eq!(scale.si_units(UNIT_METRE), Scale::new(1e3).unwrap().si_units(UNIT_METRE));
        assert_eq!(scale.reversed(false), scale);
    }

    #[test]
    fn decimal_counts_are_si_units() {
        let units = |counts| Scale::new(counts).unwrap().si_units(UNIT_METRE);
        assert_eq!(units(1e6), Some((0xFA01_0000, 0xFA01_0300)), "micrometres");
        assert_eq!(units(1.0), Some((0x0001_0000, 0x0001_0300)), "metres");
        assert_eq!(units(1e9), Some((0xF701_0000, 0xF701_0300)), "nanometres");
        assert_eq!(units(131_072.0), None);
    }

    #[test]
    fn refuses_scales_that_are_no_scales() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Scale::new(bad).is_none());
        }
    }

    #[test]
    fn torque_is_in_thousandths() {
        assert_eq!(per_mille(50.0, 200.0), 250);
        assert_eq!(per_mille(1e9, 1.0), i16::MAX);
        assert_eq!(per_mille(0.0, 0.0), 0);
        assert!((from_per_mille(250, 200.0) - 50.0).abs() < 1e-12);
    }
}

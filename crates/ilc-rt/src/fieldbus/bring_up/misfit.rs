//! An object's value that does not fit: found and required values as numbers, for `error` and those who
//! handle it; only `Display` makes words of them.

use std::fmt;

use super::setting::{Kind, Need, shown};
use crate::fieldbus::canopen::ObjectAddress;

/// Content found in an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Found {
    /// A number.
    Number(i64),
    /// A number, after everything else was set and the object had held the required one.
    NumberAtEnd(i64),
    /// Not read, as the cell description says so.
    Unread,
    /// The object cannot be read.
    Unreadable,
    /// A ratio of two objects: numerator and denominator.
    Ratio([u32; 2]),
    /// The three ratios between counts and increments.
    Scaling {
        /// Object 0x608F, increments per revolution of the motor.
        encoder_resolution: [u32; 2],
        /// Object 0x6091, revolutions of the motor per revolution of the shaft.
        gear_ratio: [u32; 2],
        /// Object 0x6092, counts per revolution of the shaft.
        feed_constant: [u32; 2],
    },
}

/// Requirement on an object.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Required {
    /// An allowed number.
    Number(Need),
    /// A ratio without 0.
    NonZeroRatio,
    /// One count of the bus per encoder increment, or the ratios in the cell description.
    CountPerIncrement,
    /// A ratio that the cell description states, as it states the others.
    StatedRatio,
    /// No home offset, unless the cell description states one.
    NoHomeOffset,
}

/// A value of an object, with what its text depends on.
pub(super) struct Shown<'a, T>(pub(super) ObjectAddress, pub(super) Kind, pub(super) &'a T);

impl fmt::Display for Shown<'_, Found> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(address, kind, found) = *self;
        match found {
            Found::Number(value) => f.write_str(&shown(address, kind, *value)),
            Found::NumberAtEnd(value) => write!(f, "{} at the end", shown(address, kind, *value)),
            Found::Unread => f.write_str("no value"),
            Found::Unreadable => f.write_str("no value to be read"),
            Found::Ratio([over, under]) => write!(f, "{over}/{under}"),
            Found::Scaling { encoder_resolution, gear_ratio, feed_constant } => write!(
                f,
                "{}/{} with 0x6091 = {}/{} and 0x6092 = {}/{}",
                encoder_resolution[0],
                encoder_resolution[1],
                gear_ratio[0],
                gear_ratio[1],
                feed_constant[0],
                feed_constant[1]
            ),
        }
    }
}

impl fmt::Display for Shown<'_, Required> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(address, kind, required) = *self;
        match required {
            Required::Number(need) => need.write(f, |value| shown(address, kind, value)),
            Required::NonZeroRatio => f.write_str("a ratio without 0"),
            Required::CountPerIncrement => f.write_str(
                "one count per encoder increment (0x6092 / (0x608F * 0x6091) = 1), or the ratios \
                 in [axis.drive]",
            ),
            Required::StatedRatio => {
                f.write_str("to be stated in [axis.drive] as the other ratios are")
            }
            Required::NoHomeOffset => f.write_str(
                "0; positions would be shifted against the cell description, unless [axis.drive] \
                 home_offset states it",
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_shown_in_hexadecimal() {
        let words = |index, sub, kind, need| {
            Shown(ObjectAddress::new(index, sub), kind, &Required::Number(need)).to_string()
        };
        assert_eq!(words(0x1005, 0, Kind::U32, Need::Exactly(0x80)), "0x00000080");
        assert_eq!(words(0x607E, 0, Kind::U8, Need::Exactly(0)), "0x00");
        assert_eq!(words(0x605A, 0, Kind::I16, Need::OneOf(vec![2, 6])), "2 or 6");
        assert_eq!(words(0x6072, 0, Kind::U16, Need::AtLeast(1000)), "at least 1000");
    }
}

//! An object of a node with a required value.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::fieldbus::canopen::ObjectAddress;
use crate::fieldbus::cia402::objects;

/// Relative tolerance of a rate after writing: drives store rates in their own units.
const RATE_TOLERANCE: f64 = 0.01;

/// Type of an object: sign and size in bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(rename = "ObjectType")]
pub enum Kind {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
}

impl Kind {
    /// Returns the lowest and the highest number.
    pub const fn range(self) -> (i64, i64) {
        match self {
            Self::U8 => (0, u8::MAX as i64),
            Self::I8 => (i8::MIN as i64, i8::MAX as i64),
            Self::U16 => (0, u16::MAX as i64),
            Self::I16 => (i16::MIN as i64, i16::MAX as i64),
            Self::U32 => (0, u32::MAX as i64),
            Self::I32 => (i32::MIN as i64, i32::MAX as i64),
        }
    }

    /// Returns the number of bytes.
    pub(super) const fn len(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
        }
    }

    /// Decodes `bytes`; if a node sends more than the type holds, it did not indicate the size.
    pub(super) fn decode(self, bytes: &[u8]) -> i64 {
        let n_bytes = bytes.len().min(self.len());
        let bits = 64 - 8 * n_bytes.max(1);
        let raw =
            bytes[..n_bytes].iter().rev().fold(0_u64, |all, byte| all << 8 | u64::from(*byte));
        match self {
            Self::U8 | Self::U16 | Self::U32 => raw.cast_signed(),
            Self::I8 | Self::I16 | Self::I32 => (raw << bits).cast_signed() >> bits,
        }
    }

    /// Encodes `number`, little-endian.
    pub(super) fn encode(self, number: i64) -> Vec<u8> {
        number.to_le_bytes()[..self.len()].to_vec()
    }
}

/// Allowed values of an object, and the one written if it holds another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Need {
    /// Exactly this value.
    Exactly(i64),
    /// This rate, as accurately as the drive can store it.
    Near(i64),
    /// This value or a higher one.
    AtLeast(i64),
    /// A value so large that it never takes effect; if the node refuses it, at least the second
    /// one.
    Ample(i64, i64),
    /// This value or a lower one.
    AtMost(i64),
    /// One of these; the first one is written.
    OneOf(Vec<i64>),
}

impl Need {
    /// Returns the value to write.
    pub(super) fn value(&self) -> i64 {
        match self {
            Self::Exactly(value)
            | Self::Near(value)
            | Self::AtLeast(value)
            | Self::Ample(value, _)
            | Self::AtMost(value) => *value,
            Self::OneOf(values) => values.first().copied().unwrap_or(0),
        }
    }

    /// Returns whether the object may stay as it is.
    pub(super) fn admits(&self, found: i64) -> bool {
        match self {
            Self::Exactly(value) => found == *value,
            Self::Near(value) => {
                let allowed = (*value as f64).abs() * RATE_TOLERANCE;
                (found.saturating_sub(*value) as f64).abs() <= allowed.max(1.0)
                    && found.signum() == value.signum()
            }
            Self::AtLeast(value) | Self::Ample(value, _) => found >= *value,
            Self::AtMost(value) => found <= *value,
            Self::OneOf(values) => values.contains(&found),
        }
    }

    /// Returns true if the node may run with its value after the best one was requested.
    pub(super) fn bears(&self, found: i64) -> bool {
        match self {
            Self::Ample(_, min) => found >= *min,
            _ => self.admits(found),
        }
    }

    /// Writes the need in words.
    pub(super) fn write(
        &self,
        f: &mut fmt::Formatter<'_>,
        shown: impl Fn(i64) -> String,
    ) -> fmt::Result {
        match self {
            Self::Exactly(value) | Self::Near(value) => f.write_str(&shown(*value)),
            Self::AtLeast(value) | Self::Ample(_, value) => write!(f, "at least {}", shown(*value)),
            Self::AtMost(value) => write!(f, "at most {}", shown(*value)),
            Self::OneOf(values) => {
                let words: Vec<String> = values.iter().map(|value| shown(*value)).collect();
                f.write_str(&words.join(" or "))
            }
        }
    }
}

/// Reaction to a node without the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Absence {
    /// The feature does not exist, so there is nothing to set.
    Harmless,
    /// The node is refused, for this purpose of the object.
    Refused(&'static str),
}

/// An object with its required value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Setting {
    pub(super) address: ObjectAddress,
    pub(super) kind: Kind,
    pub(super) need: Need,
    pub(super) absence: Absence,
}

impl Setting {
    /// Creates the setting of an optional object.
    pub(super) fn new(index: u16, sub: u8, kind: Kind, need: Need) -> Self {
        let address = ObjectAddress::new(index, sub);
        Self { address, kind, need, absence: Absence::Harmless }
    }

    /// Makes the object required.
    #[must_use]
    pub(super) fn needed(self, purpose: &'static str) -> Self {
        Self { absence: Absence::Refused(purpose), ..self }
    }

    /// Returns the object's name.
    pub(super) fn name(&self) -> &'static str {
        name(self.address)
    }
}

/// Returns the name of an object, or of its record.
pub(super) fn name(address: ObjectAddress) -> &'static str {
    let of_record = match address.index {
        0x1400..=0x15FF => objects::name(objects::RPDO_COMMUNICATION),
        0x1600..=0x17FF => objects::name(objects::RPDO_MAPPING),
        0x1800..=0x19FF => objects::name(objects::TPDO_COMMUNICATION),
        0x1A00..=0x1BFF => objects::name(objects::TPDO_MAPPING),
        index => objects::name(index),
    };
    of_record.unwrap_or("an object of the cell description")
}

/// Formats a number for reading: bits and identifiers in hexadecimal.
pub(super) fn shown(address: ObjectAddress, kind: Kind, value: i64) -> String {
    let is_code = matches!(
        (address.index, address.sub),
        (
            objects::COB_ID_SYNC
            | objects::COB_ID_EMCY
            | objects::CONSUMER_HEARTBEAT
            | objects::POLARITY
            | objects::POSITION_UNIT
            | objects::VELOCITY_UNIT,
            _
        )
            | (0x1400..=0x15FF | 0x1800..=0x19FF, 1)
            | (0x1600..=0x17FF | 0x1A00..=0x1BFF, 1..)
    );
    if is_code && value >= 0 {
        format!("0x{value:0width$X}", width = 2 * kind.len())
    } else {
        value.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_round_trip_in_their_type() {
        for (kind, numbers) in [
            (Kind::U8, [0, 1, 255]),
            (Kind::I8, [-128, -1, 127]),
            (Kind::U16, [0, 256, 65_535]),
            (Kind::I16, [-32_768, -2, 32_767]),
            (Kind::U32, [0, 70_000, 4_294_967_295]),
            (Kind::I32, [-2_147_483_648, -70_000, 2_147_483_647]),
        ] {
            for number in numbers {
                assert_eq!(kind.decode(&kind.encode(number)), number, "{kind:?}");
            }
        }
        // Four bytes without an indicated size.
        assert_eq!(Kind::I16.decode(&[0xFE, 0xFF, 0, 0]), -2);
        assert_eq!(Kind::U32.decode(&[7]), 7);
        assert_eq!(Kind::I32.decode(&[]), 0);
    }

    #[test]
    fn needs_admit_what_they_say() {
        assert!(Need::Near(1000).admits(1010) && !Need::Near(1000).admits(1011));
        assert!(Need::Near(1).admits(2) && !Need::Near(1).admits(0) && !Need::Near(1).admits(-1));
        assert!(Need::AtLeast(5).admits(5) && !Need::AtLeast(5).admits(4));
        assert!(!Need::Ample(9, 5).admits(5) && Need::Ample(9, 5).bears(5));
        assert!(!Need::Ample(9, 5).bears(4) && Need::Ample(9, 5).admits(9));
        assert!(Need::AtMost(5).admits(5) && !Need::AtMost(5).admits(6));
        assert!(Need::OneOf(vec![2, 6]).admits(6) && !Need::OneOf(vec![2, 6]).admits(1));
        assert_eq!(Need::OneOf(vec![2, 6]).value(), 2);
    }
}

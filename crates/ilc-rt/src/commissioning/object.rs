//! Objects of a node as typed values: text in, bytes on the bus, text out.

use serde::{Serialize, Serializer};

use super::error::CommissioningError;
use crate::fieldbus::Bus;
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::canopen::ObjectAddress;
use crate::record::{TEXT_MAX, printable};

/// Type of an object's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// Unsigned integer of this many bytes.
    Unsigned(usize),
    /// Signed integer of this many bytes.
    Signed(usize),
    /// IEEE 754 number of 4 or 8 bytes.
    Real(usize),
    /// Text.
    Text,
    /// Bytes, written as hexadecimal digits.
    Bytes,
}

/// All types by their names.
const TYPES: [(&str, DataType); 12] = [
    ("u8", DataType::Unsigned(1)),
    ("u16", DataType::Unsigned(2)),
    ("u32", DataType::Unsigned(4)),
    ("u64", DataType::Unsigned(8)),
    ("i8", DataType::Signed(1)),
    ("i16", DataType::Signed(2)),
    ("i32", DataType::Signed(4)),
    ("i64", DataType::Signed(8)),
    ("f32", DataType::Real(4)),
    ("f64", DataType::Real(8)),
    ("string", DataType::Text),
    ("bytes", DataType::Bytes),
];

/// Signed objects of CiA 402, whose size alone would not tell.
const SIGNED: [u16; 27] = [
    0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6060, 0x6061, 0x6062, 0x6063, 0x6064, 0x606B,
    0x606C, 0x6071, 0x6074, 0x6077, 0x607A, 0x607B, 0x607C, 0x607D, 0x6098, 0x60B0, 0x60B1, 0x60B2,
    0x60C1, 0x60F4, 0x60FF,
];

impl DataType {
    /// Names of all types.
    pub fn names() -> Vec<&'static str> {
        TYPES.iter().map(|(name, _)| *name).collect()
    }

    /// Returns the type of a name.
    pub fn named(name: &str) -> Option<Self> {
        TYPES.iter().find(|(each, _)| *each == name).map(|(_, kind)| *kind)
    }

    /// Returns the type's name.
    pub fn name(self) -> &'static str {
        TYPES.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| *name)
    }

    /// Returns the likely type of an object of this size; text and longer data by their characters.
    pub fn likely(address: ObjectAddress, bytes: &[u8]) -> Self {
        let is_signed =
            SIGNED.contains(&address.index) && !(has_count(address) && address.sub == 0);
        match bytes.len() {
            1 | 2 | 4 if is_signed => Self::Signed(bytes.len()),
            1 | 2 | 4 if !is_text(address) => Self::Unsigned(bytes.len()),
            _ if text(bytes).is_some() => Self::Text,
            _ => Self::Bytes,
        }
    }

    /// Returns the bytes of a value, little-endian.
    ///
    /// # Errors
    /// [`CommissioningError::Value`] with the range of the type.
    pub fn encode(self, value: &str) -> Result<Vec<u8>, CommissioningError> {
        let refused = |allowed: String| CommissioningError::Value {
            value: printable(value, TEXT_MAX),
            allowed: format!("{}: {allowed}", self.name()),
        };
        match self {
            Self::Unsigned(n) => {
                let max = u64::MAX >> (64 - 8 * n);
                let number = whole(value).and_then(|number| u64::try_from(number).ok());
                let number = number
                    .filter(|number| *number <= max)
                    .ok_or_else(|| refused(format!("allowed 0 to {max} (0x{max:X})")))?;
                Ok(number.to_le_bytes()[..n].to_vec())
            }
            Self::Signed(n) => {
                let max = i64::MAX >> (64 - 8 * n);
                let number = whole(value).and_then(|number| i64::try_from(number).ok());
                let number = number
                    .filter(|number| (-max - 1..=max).contains(number))
                    .ok_or_else(|| refused(format!("allowed {} to {max}", -max - 1)))?;
                Ok(number.to_le_bytes()[..n].to_vec())
            }
            Self::Real(n) => {
                let number: f64 = value
                    .parse()
                    .ok()
                    .filter(|number: &f64| number.is_finite())
                    .ok_or_else(|| refused("allowed a finite number".to_owned()))?;
                #[expect(clippy::cast_possible_truncation, reason = "rounded to the type's digits")]
                let short = number as f32;
                if n == 8 {
                    return Ok(number.to_le_bytes().to_vec());
                }
                if short.is_finite() {
                    Ok(short.to_le_bytes().to_vec())
                } else {
                    Err(refused(format!("allowed {} to {}", f32::MIN, f32::MAX)))
                }
            }
            Self::Text => Ok(value.as_bytes().to_vec()),
            Self::Bytes => hexadecimal(value)
                .ok_or_else(|| refused("allowed pairs of hexadecimal digits, as 01FF".to_owned())),
        }
    }

    /// Returns bytes as a value of this type; `None` if they have another size.
    pub fn decode(self, bytes: &[u8]) -> Option<ObjectValue> {
        let raw = || bytes.iter().rev().fold(0_u64, |sum, &byte| sum << 8 | u64::from(byte));
        Some(match self {
            Self::Unsigned(n) if bytes.len() == n => ObjectValue::Unsigned(raw()),
            Self::Signed(n) if bytes.len() == n => {
                let unused = 64 - 8 * n;
                ObjectValue::Signed((raw() << unused).cast_signed() >> unused)
            }
            Self::Real(4) => ObjectValue::Real(f32::from_le_bytes(bytes.try_into().ok()?).into()),
            Self::Real(_) => ObjectValue::Real(f64::from_le_bytes(bytes.try_into().ok()?)),
            Self::Text => {
                ObjectValue::Text(String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned())
            }
            Self::Bytes => ObjectValue::Bytes(bytes.to_vec()),
            Self::Unsigned(_) | Self::Signed(_) => return None,
        })
    }
}

/// A value of an object.
#[derive(Clone, Debug, PartialEq)]
pub enum ObjectValue {
    /// Unsigned integer.
    Unsigned(u64),
    /// Signed integer.
    Signed(i64),
    /// Real number.
    Real(f64),
    /// Text.
    Text(String),
    /// Bytes.
    Bytes(Vec<u8>),
}

impl ObjectValue {
    fn digits(bytes: &[u8]) -> String {
        bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
            for digit in [byte >> 4, byte & 15] {
                text.extend(char::from_digit(u32::from(digit), 16).map(|c| c.to_ascii_uppercase()));
            }
            text
        })
    }
}

impl std::fmt::Display for ObjectValue {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unsigned(number) => write!(f, "{number} (0x{number:X})"),
            Self::Signed(number) => write!(f, "{number}"),
            Self::Real(number) => write!(f, "{number}"),
            Self::Text(text) => write!(f, "\"{}\"", printable(text, TEXT_MAX)),
            Self::Bytes(bytes) => f.write_str(&Self::digits(bytes)),
        }
    }
}

impl Serialize for ObjectValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Unsigned(number) => serializer.serialize_u64(*number),
            Self::Signed(number) => serializer.serialize_i64(*number),
            Self::Real(number) => serializer.serialize_f64(*number),
            Self::Text(text) => serializer.serialize_str(text),
            Self::Bytes(bytes) => serializer.serialize_str(&Self::digits(bytes)),
        }
    }
}

/// Parses `INDEX[:SUB]`: the index in hexadecimal, as everybody writes it; the sub-index in decimal, or hexadecimal
/// with `0x`.
///
/// # Errors
/// [`CommissioningError::Address`]
pub fn parse_address(text: &str) -> Result<ObjectAddress, CommissioningError> {
    let refused = || CommissioningError::Address(printable(text, TEXT_MAX));
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let digits = index.strip_prefix("0x").or_else(|| index.strip_prefix("0X")).unwrap_or(index);
    // `from_str_radix` would take a sign.
    if digits.starts_with(['+', '-']) {
        return Err(refused());
    }
    let index = u16::from_str_radix(digits, 16).map_err(|_| refused())?;
    let sub = whole(sub).and_then(|sub| u8::try_from(sub).ok()).ok_or_else(refused)?;
    Ok(ObjectAddress::new(index, sub))
}

/// Reads an object, as the type given or the likely one.
///
/// # Errors
/// [`CommissioningError`] of the transfer, or if the object does not have the size of the type.
pub fn read_object(
    bus: &mut dyn Bus,
    client: &SdoClient,
    address: ObjectAddress,
    kind: Option<DataType>,
) -> Result<(DataType, ObjectValue), CommissioningError> {
    let bytes = client.upload(bus, address.index, address.sub)?;
    let kind = kind.unwrap_or_else(|| DataType::likely(address, &bytes));
    let value = kind.decode(&bytes).ok_or_else(|| CommissioningError::Value {
        value: ObjectValue::Bytes(bytes.clone()).to_string(),
        allowed: format!(
            "object {address} has {} bytes, not those of {}",
            bytes.len(),
            kind.name()
        ),
    })?;
    Ok((kind, value))
}

/// Writes an object, as the type given or that of its present value; returns the type.
///
/// # Errors
/// [`CommissioningError`] of the transfer, or for a value that does not fit.
pub fn write_object(
    bus: &mut dyn Bus,
    client: &SdoClient,
    address: ObjectAddress,
    kind: Option<DataType>,
    value: &str,
) -> Result<DataType, CommissioningError> {
    let kind = if let Some(kind) = kind {
        kind
    } else {
        let bytes = client.upload(bus, address.index, address.sub)?;
        let likely = DataType::likely(address, &bytes);
        if matches!(likely, DataType::Bytes) {
            let types = DataType::names().join(", ");
            let n_bytes = bytes.len();
            return Err(CommissioningError::TypeNeeded { address, n_bytes, types });
        }
        likely
    };
    client.download(bus, address.index, address.sub, &kind.encode(value)?)?;
    Ok(kind)
}

/// Returns whether sub-index 0 of a signed object is the number of its entries.
fn has_count(address: ObjectAddress) -> bool {
    matches!(address.index, 0x607B | 0x607D | 0x60C1)
}

/// Returns whether an object is a text by its definition, however short.
fn is_text(address: ObjectAddress) -> bool {
    matches!(address.index, 0x1008..=0x100A)
}

fn text(bytes: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(bytes).ok()?.trim_end_matches('\0');
    (!text.is_empty() && !text.chars().any(char::is_control)).then_some(text)
}

/// Parses a whole number, decimal or hexadecimal with `0x`.
fn whole(text: &str) -> Option<i128> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    if digits.starts_with(['+', '-']) {
        return None;
    }
    let number = match digits.strip_prefix("0x").or_else(|| digits.strip_prefix("0X")) {
        Some(hex) if !hex.starts_with(['+', '-']) => i128::from_str_radix(hex, 16).ok()?,
        Some(_) => return None,
        None => digits.parse().ok()?,
    };
    Some(sign * number)
}

fn hexadecimal(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> = text
        .chars()
        .filter(|c| *c != ' ')
        .map(|c| c.to_digit(16).and_then(|digit| u8::try_from(digit).ok()))
        .collect::<Option<_>>()?;
    let pairs = digits.chunks_exact(2);
    (pairs.remainder().is_empty() && !digits.is_empty())
        .then(|| pairs.map(|pair| pair[0] << 4 | pair[1]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_hexadecimal_and_its_sub_index_either() {
        for (text, index, sub) in [
            ("6041", 0x6041, 0),
            ("0x1018:4", 0x1018, 4),
            ("607D:0x02", 0x607D, 2),
            ("1A00:16", 0x1A00, 16),
        ] {
            assert_eq!(parse_address(text).unwrap(), ObjectAddress::new(index, sub));
        }
        for bad in ["", "x", "60411", "6041:", "6041:256", "+6041", "6041:-1", "0x", "6041:1:2"] {
            assert!(parse_address(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn values_round_trip_and_keep_their_range() {
        for (kind, text, shown) in [
            ("u8", "0xFF", "255 (0xFF)"),
            ("u64", "18446744073709551615", "18446744073709551615 (0xFFFFFFFFFFFFFFFF)"),
            ("i8", "-128", "-128"),
            ("i16", "-0x10", "-16"),
            ("i64", "-9223372036854775808", "-9223372036854775808"),
            ("f32", "0.5", "0.5"),
            ("f64", "-1e300", &(-1e300_f64).to_string()),
            ("string", "axis", "\"axis\""),
            ("bytes", "01 ff", "01FF"),
        ] {
            let kind = DataType::named(kind).unwrap();
            let bytes = kind.encode(text).unwrap();
            assert_eq!(kind.decode(&bytes).unwrap().to_string(), shown);
        }
        for (kind, bad) in [
            ("u8", "256"),
            ("u8", "-1"),
            ("i8", "128"),
            ("u16", "0x10000"),
            ("u32", "1.5"),
            ("f32", "1e39"),
            ("f64", "nan"),
            ("bytes", "123"),
            ("bytes", "xy"),
            ("i32", "--1"),
            ("u32", "0x-1"),
        ] {
            assert!(DataType::named(kind).unwrap().encode(bad).is_err(), "{kind} {bad}");
        }
    }

    #[test]
    fn the_likely_type_follows_the_profile_and_the_size() {
        let of = |index, sub, bytes: &[u8]| {
            DataType::likely(ObjectAddress::new(index, sub), bytes).name()
        };
        assert_eq!(of(0x6041, 0, &[0x50, 2]), "u16");
        assert_eq!(of(0x6064, 0, &[0; 4]), "i32");
        assert_eq!(of(0x607D, 0, &[2]), "u8");
        assert_eq!(of(0x607D, 1, &[0; 4]), "i32");
        assert_eq!(of(0x1008, 0, b"abcd"), "string");
        assert_eq!(of(0x2000, 0, b"hello"), "string");
        assert_eq!(of(0x2000, 0, &[0, 1, 2]), "bytes");
        assert!(DataType::Unsigned(4).decode(&[1, 2]).is_none());
    }
}

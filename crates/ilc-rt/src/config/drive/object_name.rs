//! The name of an object in a cell description: `0x6085`, or `0x607D:01` with its sub-index.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::fieldbus::canopen::ObjectAddress;

/// The index of an object and, if given, its sub-index; both hexadecimal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ObjectName {
    /// Index.
    pub index: u16,
    /// Sub-index; `None` for the object without one, or for the whole record.
    pub sub: Option<u8>,
}

impl ObjectName {
    /// Creates the name of an object with its sub-index, which is left out if it is 0.
    pub fn of(address: ObjectAddress) -> Self {
        Self { index: address.index, sub: Some(address.sub).filter(|sub| *sub != 0) }
    }

    /// Returns the address of the object; sub-index 0 where none is given.
    pub fn address(self) -> ObjectAddress {
        ObjectAddress::new(self.index, self.sub.unwrap_or(0))
    }

    /// Returns true for the object itself, and for every part of a record named without sub-index.
    pub fn covers(self, index: u16, sub: u8) -> bool {
        self.index == index && self.sub.is_none_or(|own| own == sub)
    }
}

impl fmt::Display for ObjectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.index)?;
        self.sub.map_or(Ok(()), |sub| write!(f, ":{sub:02X}"))
    }
}

impl FromStr for ObjectName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parse = || {
            let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"))?;
            let (index, sub) = match digits.split_once(':') {
                Some((index, sub)) => (index, Some(sub)),
                None => (digits, None),
            };
            let is_hex = |digits: &str, most| {
                (1..=most).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_hexdigit())
            };
            if !is_hex(index, 4) || !sub.is_none_or(|sub| is_hex(sub, 2)) {
                return None;
            }
            let sub = sub.map(|sub| u8::from_str_radix(sub, 16)).transpose().ok()?;
            Some(Self { index: u16::from_str_radix(index, 16).ok()?, sub })
        };
        parse().ok_or_else(|| {
            let shown: String = text.chars().take(40).collect();
            format!("{shown:?} is not an object: 0x and a hexadecimal index, as \"0x6085\", or \"0x607D:01\" with a sub-index")
        })
    }
}

impl Serialize for ObjectName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ObjectName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Cow::<str>::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl JsonSchema for ObjectName {
    fn schema_name() -> Cow<'static, str> {
        "ObjectName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "pattern": "^0[xX][0-9A-Fa-f]{1,4}(:[0-9A-Fa-f]{1,2})?$" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_both_ways() {
        for (text, index, sub) in [
            ("0x6085", 0x6085, None),
            ("0x607D:02", 0x607D, Some(2)),
            ("0x2000:FF", 0x2000, Some(255)),
        ] {
            let name: ObjectName = text.parse().unwrap();
            assert_eq!((name, name.to_string().as_str()), (ObjectName { index, sub }, text));
        }
        assert!("0x607D".parse::<ObjectName>().unwrap().covers(0x607D, 2));
        assert!(!"0x607D:01".parse::<ObjectName>().unwrap().covers(0x607D, 2));
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "6085", "0x", "0x60850", "0x6085:", "0x6085:100", "0x+085", "0x60 85", "ü"]
        {
            assert!(text.parse::<ObjectName>().unwrap_err().contains("is not an object"), "{text}");
        }
    }
}

//! Values of objects and their encoding.

use ilc_rt::fieldbus::canopen::AbortCode;

/// Longest text in a dictionary, in bytes.
pub const TEXT_MAX: usize = 32;

/// A short text, stored in place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Text {
    bytes: [u8; TEXT_MAX],
    len: usize,
}

impl Text {
    /// Returns the text, truncated to [`TEXT_MAX`] bytes.
    pub fn new(text: &[u8]) -> Self {
        let len = text.len().min(TEXT_MAX);
        let mut bytes = [0; TEXT_MAX];
        bytes[..len].copy_from_slice(&text[..len]);
        Self { bytes, len }
    }

    /// Returns the text.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// The value of an object; the variant is its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value {
    /// Unsigned, 8 bits.
    U8(u8),
    /// Unsigned, 16 bits.
    U16(u16),
    /// Unsigned, 32 bits.
    U32(u32),
    /// Signed, 8 bits.
    I8(i8),
    /// Signed, 16 bits.
    I16(i16),
    /// Signed, 32 bits.
    I32(i32),
    /// A visible string.
    Text(Text),
}

/// A value's bytes on the wire.
#[derive(Clone, Copy, Debug)]
pub struct Encoded {
    bytes: [u8; TEXT_MAX],
    len: usize,
}

impl Encoded {
    /// Returns the bytes, little-endian.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

impl Value {
    /// Returns the number of bytes on the wire.
    pub fn len(&self) -> usize {
        match self {
            Self::U8(_) | Self::I8(_) => 1,
            Self::U16(_) | Self::I16(_) => 2,
            Self::U32(_) | Self::I32(_) => 4,
            Self::Text(text) => text.len,
        }
    }

    /// Returns whether there is nothing to send: an empty text.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the bytes on the wire.
    pub fn encode(&self) -> Encoded {
        let bytes = match self {
            Self::Text(text) => return Encoded { bytes: text.bytes, len: text.len },
            Self::U8(value) => u32::from(*value).to_le_bytes(),
            Self::U16(value) => u32::from(*value).to_le_bytes(),
            Self::U32(value) => value.to_le_bytes(),
            Self::I8(value) => i32::from(*value).to_le_bytes(),
            Self::I16(value) => i32::from(*value).to_le_bytes(),
            Self::I32(value) => value.to_le_bytes(),
        };
        let mut padded = [0; TEXT_MAX];
        padded[..4].copy_from_slice(&bytes);
        Encoded { bytes: padded, len: self.len() }
    }

    /// Decodes `bytes` as a value of the same type.
    ///
    /// # Errors
    /// [`AbortCode::TooLong`] or [`AbortCode::TooShort`] if the length is not that of the type.
    pub fn decode_like(&self, bytes: &[u8]) -> Result<Self, AbortCode> {
        if let Self::Text(_) = self {
            return if bytes.len() > TEXT_MAX {
                Err(AbortCode::TooLong)
            } else {
                Ok(Self::Text(Text::new(bytes)))
            };
        }
        match bytes.len().cmp(&self.len()) {
            std::cmp::Ordering::Less => return Err(AbortCode::TooShort),
            std::cmp::Ordering::Greater => return Err(AbortCode::TooLong),
            std::cmp::Ordering::Equal => {}
        }
        Ok(match (self, bytes) {
            (Self::U8(_), &[a]) => Self::U8(a),
            (Self::I8(_), &[a]) => Self::I8(a.cast_signed()),
            (Self::U16(_), &[a, b]) => Self::U16(u16::from_le_bytes([a, b])),
            (Self::I16(_), &[a, b]) => Self::I16(i16::from_le_bytes([a, b])),
            (Self::U32(_), &[a, b, c, d]) => Self::U32(u32::from_le_bytes([a, b, c, d])),
            (Self::I32(_), &[a, b, c, d]) => Self::I32(i32::from_le_bytes([a, b, c, d])),
            _ => return Err(AbortCode::Length),
        })
    }

    /// Returns the number; 0 for a text.
    pub fn number(&self) -> i64 {
        match *self {
            Self::U8(value) => value.into(),
            Self::U16(value) => value.into(),
            Self::U32(value) => value.into(),
            Self::I8(value) => value.into(),
            Self::I16(value) => value.into(),
            Self::I32(value) => value.into(),
            Self::Text(_) => 0,
        }
    }

    /// Returns `number` saturated to the same type; a text is unchanged.
    #[must_use]
    pub fn with_number(&self, number: i64) -> Self {
        macro_rules! nearest {
            ($variant:ident, $kind:ty) => {{
                let clamped = number.clamp(i64::from(<$kind>::MIN), i64::from(<$kind>::MAX));
                Self::$variant(<$kind>::try_from(clamped).unwrap_or_default())
            }};
        }
        match self {
            Self::U8(_) => nearest!(U8, u8),
            Self::U16(_) => nearest!(U16, u16),
            Self::U32(_) => nearest!(U32, u32),
            Self::I8(_) => nearest!(I8, i8),
            Self::I16(_) => nearest!(I16, i16),
            Self::I32(_) => nearest!(I32, i32),
            Self::Text(_) => *self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_round_trip_and_refuse_other_lengths() {
        let values = [
            Value::U8(200),
            Value::U16(60_000),
            Value::U32(4_000_000_000),
            Value::I8(-100),
            Value::I16(-30_000),
            Value::I32(-2_000_000_000),
            Value::Text(Text::new(b"simulated drive")),
        ];
        for value in values {
            assert_eq!(value.decode_like(value.encode().as_bytes()), Ok(value));
        }
        assert_eq!(Value::U16(0).decode_like(&[1]), Err(AbortCode::TooShort));
        assert_eq!(Value::U16(0).decode_like(&[1, 2, 3]), Err(AbortCode::TooLong));
        assert_eq!(Value::Text(Text::new(b"")).decode_like(&[0; 33]), Err(AbortCode::TooLong));
    }

    #[test]
    fn numbers_saturate_at_the_type() {
        assert_eq!(Value::I16(0).with_number(1 << 40), Value::I16(i16::MAX));
        assert_eq!(Value::U8(0).with_number(-1), Value::U8(0));
    }
}

//! Floats in JSON that read back bit for bit: the shortest decimal form, or a word for what is no number.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Deserialize)]
#[serde(untagged)]
enum Text<'a> {
    Number(f64),
    Word(&'a str),
}

impl Text<'_> {
    fn value(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            Self::Word("NaN") => Some(f64::NAN),
            Self::Word("inf") => Some(f64::INFINITY),
            Self::Word("-inf") => Some(f64::NEG_INFINITY),
            Self::Word(_) => None,
        }
    }
}

struct Exact(f64);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize(&self.0, serializer)
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde hands it over")]
pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else if value.is_nan() {
        serializer.serialize_str("NaN")
    } else {
        serializer.serialize_str(if *value > 0.0 { "inf" } else { "-inf" })
    }
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Text::deserialize(deserializer)?.value().ok_or_else(|| D::Error::custom("not a number"))
}

/// The same for lists.
pub(super) mod list {
    use super::{Deserializer, Exact, Serializer, Text};
    use serde::de::Error as _;
    use serde::{Deserialize as _, Serialize as _};

    pub(in crate::recording) fn serialize<S: Serializer>(
        values: &[f64],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        values.iter().map(|value| Exact(*value)).collect::<Vec<_>>().serialize(serializer)
    }

    pub(in crate::recording) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<f64>, D::Error> {
        let texts = Vec::<Text>::deserialize(deserializer)?;
        let value = |text: &Text| text.value().ok_or_else(|| D::Error::custom("not a number"));
        texts.iter().map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    #[derive(Serialize, Deserialize)]
    struct Message {
        #[serde(with = "super")]
        one: f64,
        #[serde(with = "super::list")]
        many: Vec<f64>,
    }

    #[test]
    fn every_float_comes_back_bit_for_bit() {
        let hard = [
            0.1,
            -0.0,
            5e-324,
            f64::MAX,
            f64::MIN_POSITIVE,
            1.0 / 3.0,
            f64::from_bits(0x3fb9_9999_9999_999b),
            f64::INFINITY,
            f64::NEG_INFINITY,
        ];
        for one in hard {
            let text = serde_json::to_string(&Message { one, many: hard.to_vec() }).unwrap();
            let back: Message = serde_json::from_str(&text).unwrap();
            assert_eq!(back.one.to_bits(), one.to_bits(), "{text}");
            assert!(back.many.iter().zip(hard).all(|(a, b)| a.to_bits() == b.to_bits()), "{text}");
        }
        let text = serde_json::to_string(&Message { one: f64::NAN, many: vec![] }).unwrap();
        assert!(serde_json::from_str::<Message>(&text).unwrap().one.is_nan());
        assert!(serde_json::from_str::<Message>(r#"{"one":"two","many":[]}"#).is_err());
    }
}

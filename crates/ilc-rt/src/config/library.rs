//! `[library]`: the runs that stay in the library.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::schema::field_order;

/// Runs to keep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Keep {
    /// All.
    #[default]
    All,
    /// Every n-th, by the number of the run.
    Every(u32),
    /// The one with the smallest error.
    Best,
}

/// `[library]`: storage of the runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct LibrarySection {
    /// Runs that stay in the library when nothing is learned from them: `"all"`, `"best"`, or a number from 1 for
    /// every n-th; the newest always does. `--keep` replaces it.
    pub keep: Keep,
}

impl FromStr for Keep {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            "best" => Ok(Self::Best),
            _ => text
                .parse()
                .ok()
                .filter(|n| *n > 0)
                .map(Self::Every)
                .ok_or_else(|| "allowed: all, best, or a number from 1".to_owned()),
        }
    }
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all"),
            Self::Best => f.write_str("best"),
            Self::Every(n) => n.fmt(f),
        }
    }
}

impl Serialize for Keep {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Every(n) => serializer.serialize_u32(*n),
            named => serializer.collect_str(named),
        }
    }
}

impl<'de> Deserialize<'de> for Keep {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        /// Form of the value in a file.
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Given {
            Number(i64),
            Name(String),
        }
        let given = Given::deserialize(deserializer)
            .map_err(|_| serde::de::Error::custom("allowed: all, best, or a number from 1"))?;
        let text = match given {
            Given::Number(n) => n.to_string(),
            Given::Name(name) => name,
        };
        text.parse().map_err(|allowed| serde::de::Error::custom(format!("{text}: {allowed}")))
    }
}

impl JsonSchema for Keep {
    fn schema_name() -> Cow<'static, str> {
        "Keep".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "anyOf": [
                { "type": "string", "enum": ["all", "best"] },
                { "type": "integer", "minimum": 1, "maximum": u32::MAX },
            ],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_words_and_numbers() {
        let keep = |text: &str| toml::from_str::<LibrarySection>(text).map(|section| section.keep);
        assert_eq!(keep("").unwrap(), Keep::All);
        assert_eq!(keep("keep = \"best\"").unwrap(), Keep::Best);
        assert_eq!(keep("keep = 100").unwrap(), Keep::Every(100));
        for wrong in ["keep = 0", "keep = -3", "keep = \"worst\"", "keep = true", "kept = 3"] {
            assert!(keep(wrong).is_err(), "{wrong}");
        }
        for section in [Keep::All, Keep::Best, Keep::Every(7)].map(|keep| LibrarySection { keep }) {
            let text = toml::to_string(&section).unwrap();
            assert_eq!(toml::from_str::<LibrarySection>(&text).unwrap(), section, "{text}");
        }
    }
}

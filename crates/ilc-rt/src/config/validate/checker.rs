//! Refusal of a value: file, key, value, and the allowed values.

use crate::config::{Cell, ConfigError};
use crate::schema::{self, Violation};

/// Refuses values of one file.
pub(super) struct Checker {
    pub(super) file: String,
}

impl Checker {
    pub(super) fn refuse(
        &self,
        key: &str,
        value: &dyn std::fmt::Display,
        allowed: &str,
    ) -> ConfigError {
        let (key, value, allowed) = (key.to_owned(), value.to_string(), allowed.to_owned());
        ConfigError::value(&self.file, &Violation { key, value, allowed })
    }

    pub(super) fn that(
        &self,
        holds: bool,
        key: &str,
        value: &dyn std::fmt::Display,
        allowed: &str,
    ) -> Result<(), ConfigError> {
        if holds { Ok(()) } else { Err(self.refuse(key, value, allowed)) }
    }

    /// Refuses the first number out of the range of its field.
    pub(super) fn ranges(&self, cell: &Cell) -> Result<(), ConfigError> {
        self.allow(schema::check(cell, ""))
    }

    pub(super) fn allow(&self, found: Result<(), Violation>) -> Result<(), ConfigError> {
        found.map_err(|violation| ConfigError::value(&self.file, &violation))
    }

    /// Refuses a number that is not finite from `low` to `high`.
    pub(super) fn range(
        &self,
        key: &str,
        value: f64,
        low: f64,
        high: f64,
    ) -> Result<(), ConfigError> {
        self.that(
            value.is_finite() && (low..=high).contains(&value),
            key,
            &value,
            &format!("allowed {low} to {high}"),
        )
    }
}

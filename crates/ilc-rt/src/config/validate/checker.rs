//! The one way to refuse a value: file, key, value, and what is allowed.

use crate::config::{Cell, ConfigError};
use crate::record::{TEXT_MAX, printable};
use crate::schema::{self, Violation};

/// Most characters of a value that is refused.
const VALUE_MAX: usize = 80;

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
        ConfigError::Value {
            file: printable(&self.file, TEXT_MAX),
            key: printable(key, TEXT_MAX),
            value: printable(&value.to_string(), VALUE_MAX),
            allowed: printable(allowed, TEXT_MAX),
        }
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

    /// Refuses the first number that is out of the range that its field states.
    pub(super) fn ranges(&self, cell: &Cell) -> Result<(), ConfigError> {
        schema::check(cell, "")
            .map_err(|Violation { key, value, allowed }| self.refuse(&key, &value, &allowed))
    }

    /// Refuses what is not a finite number from `low` to `high`.
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

    /// [`Checker::range`] for a value that need not be there.
    pub(super) fn range_if(
        &self,
        key: &str,
        value: Option<f64>,
        low: f64,
        high: f64,
    ) -> Result<(), ConfigError> {
        value.map_or(Ok(()), |value| self.range(key, value, low, high))
    }
}

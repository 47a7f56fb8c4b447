//! The one way to refuse a value: file, key, value, and what is allowed.

use crate::config::ConfigError;

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
            file: self.file.clone(),
            key: key.to_owned(),
            value: value.to_string(),
            allowed: allowed.to_owned(),
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

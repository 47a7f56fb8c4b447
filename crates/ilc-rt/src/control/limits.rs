//! Saturation of commands, with a flag for non-finite values.

/// A saturated command with flags.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded {
    /// The command, always finite.
    pub value: f64,
    /// True if the command was cut to a bound.
    pub saturated: bool,
    /// False if the command was NaN or infinite; `value` is then 0.
    pub finite: bool,
}

/// Saturates a command to `-most..=most`, and flags a non-finite one.
///
/// # Real Time
/// Hot; never panics: a bound that is negative or NaN counts as 0.
pub fn clamp_finite(value: f64, most: f64) -> Bounded {
    let most = if most >= 0.0 { most } else { 0.0 };
    if !value.is_finite() {
        return Bounded { value: 0.0, saturated: false, finite: false };
    }
    let bounded = value.clamp(-most, most);
    Bounded { value: bounded, saturated: value.abs() > most, finite: true }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests {
    use super::*;

    #[test]
    fn clamping_says_what_it_did() {
        let within = clamp_finite(-0.5, 1.0);
        assert_eq!(within, Bounded { value: -0.5, saturated: false, finite: true });
        let cut = clamp_finite(-3.0, 1.0);
        assert_eq!(cut, Bounded { value: -1.0, saturated: true, finite: true });
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(
                clamp_finite(bad, 1.0),
                Bounded { value: 0.0, saturated: false, finite: false }
            );
        }
        assert_eq!(clamp_finite(1.0, f64::NAN).value, 0.0);
        assert_eq!(clamp_finite(1.0, -1.0).value, 0.0);
    }
}

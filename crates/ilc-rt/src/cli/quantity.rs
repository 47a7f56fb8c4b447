//! Formatting of numbers: three digits, a unit with a suitable prefix, and a change in percent.

/// Change beyond which a percentage is meaningless.
const CHANGE_MAX_PERCENT: f64 = 1e4;

/// Display unit of a quantity in metres or radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unit {
    /// Its symbol.
    pub(super) symbol: &'static str,
    scale: f64,
    milli: &'static str,
    nano: &'static str,
}

impl Unit {
    /// Micrometres, the usual unit of errors.
    pub(super) const LENGTH: Self = Self { symbol: "um", scale: 1e6, milli: "mm", nano: "nm" };
    /// Microradians.
    pub(super) const ANGLE: Self = Self { symbol: "urad", scale: 1e6, milli: "mrad", nano: "nrad" };

    /// Returns this unit with a suitable prefix for a quantity of this size.
    pub(super) fn for_size(self, value: f64) -> Self {
        match value.abs() {
            size if size >= 1e-2 && size.is_finite() => {
                Self { symbol: self.milli, scale: 1e3, ..self }
            }
            size if size < 1e-7 && size > 0.0 => Self { symbol: self.nano, scale: 1e9, ..self },
            _ => self,
        }
    }

    /// Formats a quantity as a number in this unit.
    pub(super) fn of(self, value: f64) -> String {
        digits(value * self.scale)
    }

    /// Formats a quantity as a number with its unit.
    pub(super) fn with(self, value: f64) -> String {
        format!("{} {}", self.of(value), self.symbol)
    }
}

/// Formats three significant digits, if possible without an exponent; `-` for NaN and infinity.
pub(super) fn digits(value: f64) -> String {
    match value.abs() {
        size if !size.is_finite() => "-".to_owned(),
        size if size >= 1e9 => format!("{value:.2e}"),
        size if size >= 100.0 => format!("{value:.0}"),
        size if size >= 10.0 => format!("{value:.1}"),
        size if !(5e-5..1.0).contains(&size) => format!("{value:.2}"),
        size if size >= 0.1 => format!("{value:.3}"),
        _ => format!("{value:.4}"),
    }
}

/// Returns the change in percent; `None` without a reference value, or beyond a meaningful
/// percentage.
fn percent(before: f64, after: f64) -> Option<f64> {
    let percent = (after / before - 1.0) * 100.0;
    (before > 0.0 && percent.abs() <= CHANGE_MAX_PERCENT).then_some(percent)
}

/// Formats a change with its sign: `-94.0 %`.
pub(super) fn change(before: f64, after: f64) -> Option<String> {
    percent(before, after).map(|percent| match format!("{percent:+.1} %") {
        zero if zero == "-0.0 %" || zero == "+0.0 %" => "0.0 %".to_owned(),
        text => text,
    })
}

/// Formats a change in words: `94.0 % less`.
pub(super) fn less(before: f64, after: f64) -> Option<String> {
    percent(before, after).map(|percent| {
        let way = if percent > 0.0 { "more" } else { "less" };
        format!("{:.1} % {way}", percent.abs())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits() {
        for (value, text) in [
            (0.0, "0.00"),
            (1235.4, "1235"),
            (45.678, "45.7"),
            (4.5678, "4.57"),
            (0.45678, "0.457"),
            (0.045_678, "0.0457"),
            (1e-6, "0.00"),
            (f64::NAN, "-"),
            (f64::INFINITY, "-"),
            (3e12, "3.00e12"),
        ] {
            assert_eq!(digits(value), text);
        }
        assert_eq!(Unit::LENGTH.for_size(0.02).with(0.02), "20.0 mm");
        assert_eq!(Unit::ANGLE.for_size(5e-8).with(5e-8), "50.0 nrad");
        assert_eq!(Unit::LENGTH.for_size(0.0), Unit::LENGTH);
        assert_eq!(Unit::LENGTH.for_size(f64::INFINITY), Unit::LENGTH);
    }

    #[test]
    fn a_change_is_told_only_where_there_is_one() {
        assert_eq!(change(200.0, 50.0).unwrap(), "-75.0 %");
        assert_eq!(less(200.0, 50.0).unwrap(), "75.0 % less");
        assert_eq!(
            (change(1.0, 3.0).unwrap(), less(1.0, 3.0).unwrap()),
            ("+200.0 %".into(), "200.0 % more".into())
        );
        assert_eq!(change(1.0, 1.0 - 1e-9).unwrap(), "0.0 %");
        for (before, after) in
            [(0.0, 1.0), (1.0, f64::NAN), (1e-20, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)]
        {
            assert_eq!((change(before, after), less(before, after)), (None, None));
        }
    }
}

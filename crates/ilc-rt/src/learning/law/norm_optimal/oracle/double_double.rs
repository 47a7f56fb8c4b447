//! Double-double numbers of 32 digits, for reference solutions only.

#![allow(clippy::float_cmp, reason = "exact where exactness is what is tested")]

use std::ops::{Add, Div, Mul, Neg, Sub};

/// `high + low`, with `low` below half a unit in the last place of `high`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Double {
    high: f64,
    low: f64,
}

impl Double {
    pub(super) const ZERO: Self = Self { high: 0.0, low: 0.0 };

    pub(super) fn value(self) -> f64 {
        self.high
    }

    pub(super) fn sqrt(self) -> Self {
        let guess = Self::from(self.high.sqrt());
        (guess + self / guess) * Self::from(0.5)
    }
}

impl From<f64> for Double {
    fn from(high: f64) -> Self {
        Self { high, low: 0.0 }
    }
}

/// Returns the exact sum of two numbers, the first not the smaller one.
fn quick_sum(a: f64, b: f64) -> Double {
    let high = a + b;
    Double { high, low: b - (high - a) }
}

/// Returns the exact sum of any two numbers.
fn sum(a: f64, b: f64) -> Double {
    let high = a + b;
    let part = high - a;
    Double { high, low: (a - (high - part)) + (b - part) }
}

/// Splits a number into a sum of two with half the digits.
fn split(a: f64) -> (f64, f64) {
    let scaled = 134_217_729.0 * a;
    let high = scaled - (scaled - a);
    (high, a - high)
}

/// Returns the exact product of two numbers.
fn product(a: f64, b: f64) -> Double {
    let high = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    Double { high, low: ((a1 * b1 - high) + a1 * b2 + a2 * b1) + a2 * b2 }
}

impl Add for Double {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (high, low) = (sum(self.high, other.high), sum(self.low, other.low));
        let once = quick_sum(high.high, high.low + low.high);
        quick_sum(once.high, once.low + low.low)
    }
}

impl Neg for Double {
    type Output = Self;

    fn neg(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }
}

impl Sub for Double {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Double {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let high = product(self.high, other.high);
        quick_sum(high.high, high.low + self.high * other.low + self.low * other.high)
    }
}

impl Div for Double {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.high / other.high;
        let rest = self - other * Self::from(first);
        let second = rest.high / other.high;
        let rest = rest - other * Self::from(second);
        let third = rest.high / other.high;
        quick_sum(first, second) + Self::from(third)
    }
}

#[test]
fn a_third_has_thirty_two_digits() {
    let third = Double::from(1.0) / Double::from(3.0);
    let rest = third * Double::from(3.0) - Double::from(1.0);
    assert!(rest.value().abs() < 1e-31, "{rest:?}");
    let two = Double::from(2.0).sqrt();
    assert!((two * two - Double::from(2.0)).value().abs() < 1e-31);
    assert_eq!((Double::from(1.0) + Double::from(1e-20) - Double::from(1.0)).value(), 1e-20);
}

//! A function of time with its first three derivatives (jet), so that velocity, acceleration and
//! jerk are exact. Used by the other files of this folder.

use std::ops::{Add, Mul, Neg, Sub};

/// Value, first, second and third derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jet(pub [f64; 4]);

impl Jet {
    /// Returns a constant.
    pub fn constant(value: f64) -> Self {
        Self([value, 0.0, 0.0, 0.0])
    }

    /// Returns `offset + rate t` at the time where its value is `value`.
    pub fn line(value: f64, rate: f64) -> Self {
        Self([value, rate, 0.0, 0.0])
    }

    /// Returns `f(self)`, from `f` and its derivatives at the value of `self` (Faà di Bruno).
    #[must_use]
    pub fn compose(self, [f0, f1, f2, f3]: [f64; 4]) -> Self {
        let [_, u1, u2, u3] = self.0;
        Self([
            f0,
            f1 * u1,
            f2 * u1 * u1 + f1 * u2,
            f3 * u1 * u1 * u1 + 3.0 * f2 * u1 * u2 + f1 * u3,
        ])
    }

    /// Returns `sin(self)`.
    #[must_use]
    pub fn sin(self) -> Self {
        let (s, c) = self.0[0].sin_cos();
        self.compose([s, c, -s, -c])
    }

    /// Returns `1 - exp(-self)`, accurate for small values.
    #[must_use]
    pub fn rise(self) -> Self {
        let e = (-self.0[0]).exp();
        self.compose([-(-self.0[0]).exp_m1(), e, -e, e])
    }

    /// Returns `exp(-self)`.
    #[must_use]
    pub fn decay(self) -> Self {
        let e = (-self.0[0]).exp();
        self.compose([e, -e, e, -e])
    }

    /// Returns `1 / (1 + exp(-self))`, without overflow at either end.
    #[must_use]
    pub fn logistic(self) -> Self {
        let x = self.0[0];
        let small = (-x.abs()).exp();
        let (s, rest) = if x < 0.0 {
            (small / (1.0 + small), 1.0 / (1.0 + small))
        } else {
            (1.0 / (1.0 + small), small / (1.0 + small))
        };
        let slope = s * rest;
        let tilt = rest - s;
        self.compose([s, slope, slope * tilt, slope * (tilt * tilt - 2.0 * slope)])
    }

    /// Returns the square.
    #[must_use]
    pub fn squared(self) -> Self {
        self * self
    }

    /// Returns the cube.
    #[must_use]
    pub fn cubed(self) -> Self {
        self * self * self
    }

    /// Returns the same function reversed in time.
    #[must_use]
    pub fn reversed(self) -> Self {
        let [value, first, second, third] = self.0;
        Self([value, -first, second, -third])
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        Self(self.0.map(|value| -value))
    }
}

impl Mul for Jet {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self.0, other.0);
        Self([
            a[0] * b[0],
            a[1] * b[0] + a[0] * b[1],
            a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2],
            a[3] * b[0] + 3.0 * (a[2] * b[1] + a[1] * b[2]) + a[0] * b[3],
        ])
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|value| value * factor))
    }
}

//! Parameter of a curve at an arc length, tabulated: one polynomial per stretch of the curve.
//!
//! The parameter and its first three derivatives by the arc length are known exactly at both ends of a
//! stretch; the polynomial of degree 7 through them is accurate to rounding on a stretch that is short
//! enough. Only the plan of a run imports it.

use super::Curve;
use super::arc_length::{ArcLength, length};
use super::frame::{dot, norm};

/// Deviation in the middle of a stretch that is rounding, relative to the parameter.
const EXACT: f64 = 4e-14;
/// Largest number of bisections of a stretch; at a cusp no number would do.
const DEPTH: usize = 16;
/// Distance from the ends, relative to the stretch, at which the third derivative is taken: it may jump
/// at an end.
const INSIDE: f64 = 1e-8;

/// A part of the curve, its parameter by the arc length.
#[derive(Clone, Debug)]
struct Stretch {
    from_m: f64,
    per_m: f64,
    from: f64,
    /// Of the parameter beyond `from` by the share of the length; none if it must be iterated.
    polynomial: Option<[f64; 7]>,
}

impl Stretch {
    fn parameter(&self, polynomial: &[f64; 7], s_m: f64) -> f64 {
        let share = (s_m - self.from_m) * self.per_m;
        self.from + polynomial.iter().rev().fold(0.0, |sum, c| (sum + c) * share)
    }
}

/// The parameter by the arc length.
#[derive(Clone, Debug)]
pub(super) struct Inverse<'a, C> {
    curve: &'a C,
    measured: &'a ArcLength,
    stretches: Vec<Stretch>,
}

impl<'a, C: Curve> Inverse<'a, C> {
    /// Tabulates a curve.
    pub(super) fn new(curve: &'a C, measured: &'a ArcLength) -> Self {
        let mut stretches = Vec::new();
        for (from, to) in measured.intervals() {
            let mut todo = vec![(from, to, DEPTH)];
            while let Some((a, b, depth)) = todo.pop() {
                let middle = 0.5 * (a.0 + b.0);
                let middle_m = from.1 + length(curve, from.0, middle);
                let stretch = stretch(curve, a, b);
                let exact = stretch.polynomial.as_ref().is_some_and(|polynomial| {
                    let off = stretch.parameter(polynomial, middle_m) - middle;
                    off.abs() <= EXACT * middle.abs().max(b.0 - a.0)
                });
                if exact {
                    stretches.push(stretch);
                } else if depth == 0 {
                    stretches.push(Stretch { polynomial: None, ..stretch });
                } else {
                    todo.push(((middle, middle_m), b, depth - 1));
                    todo.push((a, (middle, middle_m), depth - 1));
                }
            }
        }
        Self { curve, measured, stretches }
    }

    /// Returns the parameter at a distance from the start.
    pub(super) fn parameter(&self, s_m: f64) -> f64 {
        let after = self.stretches.partition_point(|stretch| stretch.from_m <= s_m);
        match self.stretches.get(after.saturating_sub(1)) {
            Some(stretch @ Stretch { polynomial: Some(polynomial), .. })
                if s_m >= 0.0 && s_m < self.measured.total_m() =>
            {
                stretch.parameter(polynomial, s_m)
            }
            _ => self.measured.parameter(self.curve, s_m),
        }
    }
}

/// Returns the polynomial through both ends, each a parameter and its arc length.
fn stretch(curve: &impl Curve, (from, from_m): (f64, f64), (to, to_m): (f64, f64)) -> Stretch {
    let length_m = to_m - from_m;
    let inward = INSIDE * (to - from);
    let [_, a1, a2, a3] = derivatives(curve, from, from + inward, length_m);
    let [_, b1, b2, b3] = derivatives(curve, to, to - inward, length_m);
    // Of the remainder, which the terms up to the third order leave at the far end.
    let r0 = (to - from) - (a1 + a2 / 2.0 + a3 / 6.0);
    let r1 = b1 - (a1 + a2 + a3 / 2.0);
    let r2 = b2 - (a2 + a3);
    let r3 = b3 - a3;
    let polynomial = [
        a1,
        a2 / 2.0,
        a3 / 6.0,
        35.0 * r0 - 15.0 * r1 + 2.5 * r2 - r3 / 6.0,
        -84.0 * r0 + 39.0 * r1 - 7.0 * r2 + 0.5 * r3,
        70.0 * r0 - 34.0 * r1 + 6.5 * r2 - 0.5 * r3,
        -20.0 * r0 + 10.0 * r1 - 2.0 * r2 + r3 / 6.0,
    ];
    let is_finite = polynomial.iter().all(|value| value.is_finite());
    let polynomial = is_finite.then_some(polynomial);
    Stretch { from_m, per_m: 1.0 / length_m, from, polynomial }
}

/// Returns the parameter and its derivatives by the share of a length, the third one taken nearby.
///
/// With `q = |r'|`: `t' = 1/q`, `t'' = -q'/q³`, `t''' = (3 q'² - q q'')/q⁵`.
fn derivatives(curve: &impl Curve, parameter: f64, near: f64, length_m: f64) -> [f64; 4] {
    let of = |parameter: f64| {
        let [_, first, second, third] = curve.at(parameter);
        let q = norm(&first);
        let rate = dot(&first, &second) / q;
        let bend = (dot(&second, &second) + dot(&first, &third) - rate * rate) / q;
        let share = length_m / q;
        [
            parameter,
            share,
            -rate * share * share / q,
            (3.0 * rate * rate - q * bend) * share.powi(3) / (q * q),
        ]
    };
    let [parameter, first, second, _] = of(parameter);
    [parameter, first, second, of(near)[3]]
}

#[cfg(test)]
mod tests {
    use super::super::{Butterfly, Spiral, Spline};
    use super::*;

    fn assert_is_inverse(curve: &impl Curve) {
        let measured = ArcLength::new(curve).unwrap();
        let table = Inverse::new(curve, &measured);
        for i in 0..=20_000 {
            let s_m = measured.total_m() * f64::from(i) / 20_000.0;
            for found in [table.parameter(s_m), measured.parameter(curve, s_m)] {
                let mut knots = measured.intervals();
                let (from, _) = knots.find(|(a, b)| (a.0..=b.0).contains(&found)).unwrap();
                let found_m = from.1 + length(curve, from.0, found);
                assert!(
                    (found_m - s_m).abs() <= 1e-13 * measured.total_m(),
                    "{s_m}: {found} is at {found_m}"
                );
            }
        }
        assert!(table.stretches.len() < 10_000, "{}", table.stretches.len());
    }

    #[test]
    fn the_table_is_the_inverse_of_the_length_to_rounding() {
        assert_is_inverse(&Butterfly::new(0.00185, 12.0, [0.0; 2]).unwrap());
        assert_is_inverse(&Spiral::new(0.004, 5.5, [0.1, 0.0]).unwrap());
        let points = [[0.0, 0.0], [0.05, 0.01], [0.02, 0.07], [-0.03, 0.05], [0.0, -0.04]];
        let points: Vec<Vec<f64>> = points.iter().map(|point| point.to_vec()).collect();
        assert_is_inverse(&Spline::through(&points).unwrap());
        // The last one turns back, almost at a standstill.
        let points = [[0.0, 0.0], [0.05, 1e-7], [0.02, 0.0]].map(|point| point.to_vec());
        assert_is_inverse(&Spline::through(&points).unwrap());
    }
}

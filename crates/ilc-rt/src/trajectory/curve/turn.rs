//! Cuts of a curve where it turns back or bends too tightly to be run through: there the axes come
//! to rest.
//!
//! With respect to its parameter, a curve slows down where it reverses: its first derivative is
//! smallest, and orthogonal to the second one. The radius of curvature there is `|r'|²/|r''|`; in a
//! cusp, e.g. when an axis reverses, it is 0 and the direction flips from one point to the next.

use super::frame::{dot, norm};
use super::{Curve, Derivatives};

/// Points between two breaks at which the slope of the parameter speed is evaluated.
const LOOKS: usize = 16;
/// Bisections of an interval around a minimum.
const HALVINGS: usize = 60;

/// Part of a curve.
#[derive(Clone, Debug)]
pub(super) struct Piece<'a, C> {
    curve: &'a C,
    breaks: Vec<f64>,
    /// True for an end of the piece that is a turn.
    pub(super) turns: [bool; 2],
}

impl<C: Curve> Curve for Piece<'_, C> {
    fn n_axes(&self) -> usize {
        self.curve.n_axes()
    }

    fn breaks(&self) -> Vec<f64> {
        self.breaks.clone()
    }

    fn at(&self, parameter: f64) -> Derivatives {
        self.curve.at(parameter)
    }
}

/// Returns the parts between bends of less than a radius.
pub(super) fn pieces<C: Curve>(curve: &C, radius_m: f64) -> Vec<Piece<'_, C>> {
    let breaks = curve.breaks();
    let turns = turns(curve, &breaks, radius_m);
    let mut pieces = Vec::with_capacity(turns.len() + 1);
    let mut piece = Piece { curve, breaks: Vec::new(), turns: [false; 2] };
    let mut next = turns.into_iter().peekable();
    for parameter in breaks {
        while let Some(turn) = next.next_if(|turn| *turn <= parameter) {
            if piece.breaks.last() != Some(&turn) {
                piece.breaks.push(turn);
            }
            piece.turns[1] = true;
            let begun = Piece { curve, breaks: vec![turn], turns: [true, false] };
            pieces.push(std::mem::replace(&mut piece, begun));
        }
        if piece.breaks.last() != Some(&parameter) {
            piece.breaks.push(parameter);
        }
    }
    pieces.push(piece);
    pieces
}

/// Returns the interior parameters at which the curve bends more tightly.
fn turns(curve: &impl Curve, breaks: &[f64], radius_m: f64) -> Vec<f64> {
    let (Some(&first), Some(&last)) = (breaks.first(), breaks.last()) else { return Vec::new() };
    // The derivative of half the square of the parameter speed.
    let slope = |parameter: f64| {
        let [_, first, second, _] = curve.at(parameter);
        dot(&first, &second)
    };
    let mut turns = Vec::new();
    for pair in breaks.windows(2) {
        let place = |look: usize| pair[0] + (pair[1] - pair[0]) * look as f64 / LOOKS as f64;
        let (mut before, mut falls) = (pair[0], slope(pair[0]) < 0.0);
        for look in 1..=LOOKS {
            let here = place(look);
            let falls_here = slope(here) < 0.0;
            if falls && !falls_here {
                let (mut low, mut high) = (before, here);
                for _ in 0..HALVINGS {
                    let middle = 0.5 * (low + high);
                    if slope(middle) < 0.0 { low = middle } else { high = middle }
                }
                let [_, speed, bend, _] = curve.at(high).map(|derivative| norm(&derivative));
                let inside = high > first && high < last;
                if inside && speed * speed < radius_m * bend {
                    turns.push(high);
                }
            }
            (before, falls) = (here, falls_here);
        }
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::super::{Spiral, Spline};
    use super::*;

    fn cuts(points: &[Vec<f64>], radius_m: f64) -> Vec<f64> {
        let spline = Spline::through(points).unwrap();
        let pieces = pieces(&spline, radius_m);
        for pair in pieces.windows(2) {
            assert_eq!(pair[0].breaks.last(), pair[1].breaks.first());
            assert!(pair[0].turns[1] && pair[1].turns[0]);
        }
        for piece in &pieces {
            assert!(piece.breaks.windows(2).all(|pair| pair[0] < pair[1]), "{piece:?}");
        }
        pieces[1..].iter().map(|piece| piece.breaks[0]).collect()
    }

    #[test]
    fn an_axis_that_reverses_is_cut_where_it_does() {
        for points in [[0.0, 0.05, 0.02, 0.08], [0.0, 0.05, 0.0, 0.05]] {
            let points: Vec<Vec<f64>> = points.iter().map(|&x| vec![x]).collect();
            let spline = Spline::through(&points).unwrap();
            let found = cuts(&points, 1e-9);
            assert_eq!(found.len(), 2, "{found:?}");
            for turn in found {
                assert!(spline.at(turn)[1][0].abs() < 1e-12, "it stands still there");
            }
        }
        // Exact at a point, by symmetry.
        let found = cuts(&[vec![0.0], vec![0.05], vec![0.0]], 1e-9);
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn a_smooth_curve_stays_whole_and_a_tight_one_is_cut_by_its_radius() {
        let spiral = Spiral::new(0.004, 3.0, [0.0; 2]).unwrap();
        assert_eq!(pieces(&spiral, 1e-5).len(), 1);
        let near = |off: f64| vec![vec![0.0, 0.0], vec![0.05, off], vec![0.02, 0.0]];
        assert!(cuts(&near(0.02), 1e-5).is_empty());
        assert_eq!(cuts(&near(1e-9), 1e-5).len(), 1);
        assert_eq!(cuts(&near(0.0), 1e-5).len(), 1);
        assert!(cuts(&near(1e-3), 1e-12).is_empty());
    }
}

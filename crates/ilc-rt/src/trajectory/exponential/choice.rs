//! Choice of α for each place of an E/S move; read by its plan.

use super::alpha::{AlphaInterval, Place};
use super::leg::{End, Leg, PlacedLeg};
use crate::interpolate::{AxisLimits, PathLimits};
use crate::trajectory::error::TrajectoryError;

/// Relative distance from a limit: far above the rounding of a peak.
pub(super) const MARGIN: f64 = 1e-10;

/// The α of one place, and its admissible intervals.
#[derive(Clone, Debug, PartialEq)]
pub struct AlphaChoice {
    /// Segment at whose start, or before whose end, it is.
    pub segment: usize,
    /// `start-up`, `transition` or `end`.
    pub place: &'static str,
    /// The α used: the largest admissible one. In s⁻³ (and s⁻² for the oscillation) for start-up
    /// and end, in s⁻¹ for a transition.
    pub alpha: f64,
    /// All admissible intervals in ascending order.
    pub admissible: Vec<AlphaInterval>,
}

/// Upper bounds of α for each kind of place; infinite for as large as the limits allow.
///
/// # Units
/// - as in [`AlphaChoice::alpha`]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlphaMax {
    /// At starts from rest.
    pub start_up: f64,
    /// At a corner where a line continues, or reverses.
    pub transition: f64,
    /// At ends at rest.
    pub end: f64,
}

impl Default for AlphaMax {
    fn default() -> Self {
        Self { start_up: f64::INFINITY, transition: f64::INFINITY, end: f64::INFINITY }
    }
}

/// Chooses the α of each place in order, and sets it in the legs.
pub(super) fn choose(
    legs: &mut [PlacedLeg],
    limits: &[AxisLimits],
    reserve: f64,
    alpha_max: &AlphaMax,
) -> Result<Vec<AlphaChoice>, TrajectoryError> {
    let mut choices = Vec::new();
    let n_legs = legs.len();
    for i in 0..=n_legs {
        let before = i.checked_sub(1).map(|at| (at, 1));
        let after = (i < n_legs).then_some((i, 0));
        let joined = after.is_some_and(|(at, _)| legs[at].leg.ends[0] != End::Rest);
        let members: Vec<(usize, usize)> = before.into_iter().chain(after).collect();
        // Without a transition between them, legs end and start independently.
        let groups: Vec<Vec<(usize, usize)>> = if joined {
            vec![members]
        } else {
            members.into_iter().map(|member| vec![member]).collect()
        };
        for members in groups {
            let Some(&(segment, which)) = members.first() else { continue };
            let (name, alpha_max) = match which {
                _ if joined => ("transition", alpha_max.transition),
                0 => ("start-up", alpha_max.start_up),
                _ => ("end", alpha_max.end),
            };
            let along = PathLimits::along(&legs[segment].line.direction, limits, f64::INFINITY);
            let near: Vec<(Leg, usize)> =
                members.iter().map(|&(at, which)| (legs[at].leg, which)).collect();
            // No further end follows on its leg.
            let margin = if name == "end" { MARGIN } else { reserve };
            let place = Place { legs: &near, limits: along, margin, alpha_max, segment, name };
            let (alpha, admissible) = place.choose()?;
            for &(at, which) in &members {
                legs[at].leg.alpha[which] = Some(alpha);
            }
            choices.push(AlphaChoice { segment, place: name, alpha, admissible });
        }
    }
    Ok(choices)
}

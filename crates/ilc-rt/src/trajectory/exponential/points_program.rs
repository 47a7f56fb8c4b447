//! Programs of a modulated tool path (MTP), as an operator would write them for a CNC.
//!
//! An oscillation along the feed breaks chips. As a program it is a sequence of straight moves,
//! usually six per period. Cold.

use super::plan::ModulatedSegment;
use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::path::PathSegment;

/// Points per period of the usual program.
pub const POINTS_A_PERIOD: usize = 6;
/// Largest number of moves of a program.
const MOVES_MAX: f64 = 1e6;

/// Returns the straight moves of a modulated leg: points at equal times on `v t + A sin(ω t)`, each
/// move with the speed that takes it there on time.
///
/// # Errors
/// [`TrajectoryError`] for values out of range, or more than a million moves.
/// # Source
/// - \[dimarco2016\], Chapter 1, Fig. 1.3: the six-point sine
pub fn points_program(
    start_m: &[f64],
    segment: &ModulatedSegment,
    points_a_period: usize,
) -> Result<Vec<PathSegment>, TrajectoryError> {
    let refuse = |name, value, allowed| Err(TrajectoryError::Shape { name, value, allowed });
    if segment.to_m.len() != start_m.len() {
        return Err(TrajectoryError::Coordinates {
            segment: 0,
            found: segment.to_m.len(),
            expected: start_m.len(),
        });
    }
    for (name, value) in [
        ("feed_m_s", segment.feed_m_s),
        ("frequency_hz", segment.frequency_hz),
        ("amplitude_m", segment.amplitude_m),
    ] {
        if !is_positive(value) {
            return refuse(name, value, "a finite number above 0");
        }
    }
    if points_a_period < 3 {
        return refuse("points_a_period", points_a_period as f64, "at least 3");
    }
    let along: Vec<f64> = segment.to_m.iter().zip(start_m).map(|(to, from)| to - from).collect();
    let length_m = along.iter().fold(0.0_f64, |sum, share| sum.hypot(*share));
    if !is_positive(length_m) {
        return Err(TrajectoryError::ZeroLength { segment: 0 });
    }
    let duration_s = length_m / segment.feed_m_s;
    let step_s = 1.0 / (segment.frequency_hz * points_a_period as f64);
    let n_moves = (duration_s / step_s - 1e-9).ceil();
    if n_moves > MOVES_MAX {
        return refuse("moves of the program", n_moves, "up to 1000000");
    }
    let omega = std::f64::consts::TAU * segment.frequency_hz;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "compared with the most moves before"
    )]
    let n_moves = n_moves as usize;
    let mut moves = Vec::with_capacity(n_moves);
    let (mut before_m, mut before_s) = (0.0, 0.0);
    for k in 1..=n_moves {
        let t_s = (k as f64 * step_s).min(duration_s);
        let s_m = if k == n_moves {
            length_m
        } else {
            segment.feed_m_s * t_s + segment.amplitude_m * (omega * t_s).sin()
        };
        let to_m = if k == n_moves {
            segment.to_m.clone()
        } else {
            start_m.iter().zip(&along).map(|(from, share)| from + share * s_m / length_m).collect()
        };
        let feed_m_s = (s_m - before_m).abs() / (t_s - before_s);
        // Two neighbours may coincide where the tool is at rest.
        if feed_m_s > 0.0 {
            moves.push(PathSegment::line(to_m, feed_m_s));
        }
        (before_m, before_s) = (s_m, t_s);
    }
    Ok(moves)
}

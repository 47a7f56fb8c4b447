//! The sentence of a refusal: the value, its unit and the allowed ones.
//!
//! A rotary axis is measured in radians, and only the cell knows the rotary ones: for display,
//! [`TrajectoryError::in_units`] takes the units of the axes; the default is metres.

use std::fmt;

use super::error::TrajectoryError;
use crate::interpolate::{AxisUnit, MAX_AXES, MoveError, Quantity};

/// A refusal with the units of its axes.
#[derive(Clone, Copy, Debug)]
pub struct Refusal<'a> {
    error: &'a TrajectoryError,
    units: &'a [AxisUnit],
}

impl TrajectoryError {
    /// Returns the refusal with the units of the axes.
    pub fn in_units<'a>(&'a self, units: &'a [AxisUnit]) -> Refusal<'a> {
        Refusal { error: self, units }
    }
}

impl std::error::Error for TrajectoryError {}

impl fmt::Display for TrajectoryError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.in_units(&[]).fmt(out)
    }
}

impl fmt::Display for Refusal<'_> {
    #[expect(clippy::too_many_lines, reason = "one sentence a variant")]
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        use TrajectoryError as E;
        let path = AxisUnit::along(self.units);
        let of_axis = |axis: usize| self.units.get(axis).copied().unwrap_or_default();
        let (unit, speed) = (path.symbol(), Quantity::Velocity.unit(path));
        match *self.error {
            E::Move(refused) => match refused {
                MoveError::Length { length } => {
                    write!(out, "length {length} {unit}: a move needs a finite length above 0")
                }
                MoveError::Limit { quantity, value } => {
                    let unit = quantity.unit(path);
                    write!(out, "{quantity} limit {value} {unit}: must be finite and above 0")
                }
                MoveError::AxisLimit { axis, quantity, value } => write!(
                    out,
                    "axis {}: {quantity} limit {value} {}: must be finite and above 0",
                    axis + 1,
                    quantity.unit(of_axis(axis))
                ),
                MoveError::Duration { length, duration_s } => write!(
                    out,
                    "a move of {length} {unit} at these limits would last {duration_s} s: must be \
                     finite and above 0"
                ),
                MoveError::Axes { n_axes } => {
                    write!(out, "{n_axes} axes: allowed 1 to {MAX_AXES}")
                }
                MoveError::Position { axis, position, limit } => write!(
                    out,
                    "axis {}: position {position} {unit}: must be finite and within {limit} {unit} of 0",
                    axis + 1,
                    unit = of_axis(axis).symbol()
                ),
            },
            E::LimitCount { found, expected } => write!(
                out,
                "limits of {found} axes for points of {expected} coordinates: must be equal"
            ),
            E::Coordinates { segment, found, expected } => write!(
                out,
                "segment {}: {found} coordinates: must be {expected}, as the start has",
                segment + 1
            ),
            E::Feed { segment, feed } => write!(
                out,
                "segment {}: feed {feed} {speed}: must be finite and above 0",
                segment + 1
            ),
            E::StartVelocity { axis, velocity, limit } => write!(
                out,
                "axis {}: start velocity {velocity} {unit}: must be within {limit} {unit} of 0",
                axis + 1,
                unit = Quantity::Velocity.unit(of_axis(axis))
            ),
            E::ZeroLength { segment } => {
                write!(out, "segment {}: ends where it starts: leave it out, or move", segment + 1)
            }
            E::Plane { segment, plane: [p, q] } => write!(
                out,
                "segment {}: an arc in the plane of axes {} and {}: must be two of the path's own",
                segment + 1,
                p + 1,
                q + 1
            ),
            E::Arc { segment, from_radius, to_radius } => write!(
                out,
                "segment {}: an arc that starts {} {unit} from its centre and ends {} {unit} from it: \
                 must be equal to a thousandth, finite and above 0",
                segment + 1,
                Figure(from_radius),
                Figure(to_radius)
            ),
            E::NotStraight { segment } => write!(
                out,
                "segment {}: an arc: only straight segments are interpolated in this way",
                segment + 1
            ),
            E::Amplitude { segment, amplitude } => write!(
                out,
                "segment {}: amplitude {amplitude} {unit}: must be finite and not below 0",
                segment + 1
            ),
            E::Frequency { segment, frequency_hz } => write!(
                out,
                "segment {}: frequency {frequency_hz} Hz: must be finite and above 0",
                segment + 1
            ),
            E::Row { row, axis, quantity, reached, limit } => write!(
                out,
                "row {}: axis {}: the {quantity} over the cycle is {} {unit}, limit {} {unit}: let the \
                 set points change more slowly, and rest at the first and the last",
                row + 1,
                axis + 1,
                Figure(reached),
                Figure(limit),
                unit = quantity.unit(of_axis(axis))
            ),
            E::SetPoint { at_s, axis, quantity, reached, limit } => write!(
                out,
                "axis {}: at {} s the {quantity} of the set points over the cycle is {} {unit}, limit \
                 {} {unit}: lower the feed or smooth the path",
                axis + 1,
                Figure(at_s),
                Figure(reached),
                Figure(limit),
                unit = quantity.unit(of_axis(axis))
            ),
            E::Alpha { segment, place, alpha, quantity, reached, limit } => write!(
                out,
                "segment {} {place}: no alpha holds every limit: at alpha {} the {quantity} along the \
                 path reaches {} {unit}, limit {} {unit}; lower the feed or the oscillation",
                segment + 1,
                Figure(alpha),
                Figure(reached),
                Figure(limit),
                unit = quantity.unit(path)
            ),
            E::Programmed { segment, quantity, reached, limit } => write!(
                out,
                "segment {}: the {quantity} of the programmed oscillation reaches {} {unit} along the \
                 path, limit {} {unit}; lower its amplitude or its frequency",
                segment + 1,
                Figure(reached),
                Figure(limit),
                unit = quantity.unit(path)
            ),
            E::AlphaMax { segment, place, value, min } => write!(
                out,
                "segment {} {place}: alpha_max {value}: must be at least {}, as the {place} is not over \
                 within its segment otherwise",
                segment + 1,
                Figure(min)
            ),
            E::Hurried { segment, lasts_s, needs_s } => write!(
                out,
                "segment {}: lasts {} s at its feed, and its oscillation has to be 0 for {} s of that \
                 near the corners: lower the amplitude, or make the segment longer",
                segment + 1,
                Figure(lasts_s),
                Figure(needs_s)
            ),
            E::Shape { name, value, allowed } => {
                write!(out, "{name} = {value}: allowed {allowed}")
            }
            E::Cusp { at } => write!(
                out,
                "the curve stands still or has a corner at {} {unit} from its start: two points may not \
                 be the same",
                Figure(at)
            ),
            E::Unproven { axis, at, quantity, reached, limit, rounds } => write!(
                out,
                "axis {}: at {} {} from the start of the curve the {quantity} is {} {unit}, limit {} \
                 {unit}, after {rounds} attempts to slow down: raise the limit or smooth the curve",
                axis + 1,
                Figure(at),
                path.symbol(),
                Figure(reached),
                Figure(limit),
                unit = quantity.unit(of_axis(axis))
            ),
            E::Empty => out.write_str("a path of 0 segments: at least 1 is needed"),
            E::Time { name, value_s, low_s, high_s } => {
                write!(out, "{name} {value_s} s: allowed {low_s} to {high_s} s")
            }
            E::TooLong { duration_s, n_samples, n_samples_max } => write!(
                out,
                "the run lasts {duration_s} s, {n_samples} samples: allowed {n_samples_max}"
            ),
            E::Exceeds {
                axis,
                quantity,
                reached,
                limit,
                feed_factor,
                feed_admissible,
                window_admissible_s,
            } => {
                let (axis, unit) = (axis + 1, quantity.unit(of_axis(axis)));
                let reached = Figure(reached);
                write!(
                    out,
                    "axis {axis}: {quantity} reaches {reached} {unit}, limit {limit} {unit}: "
                )?;
                if feed_factor > 0.0 {
                    let (feed, factor) = (Figure(feed_admissible), Figure(feed_factor));
                    write!(
                        out,
                        "largest admissible feed {feed} {speed} (every feed times {factor})"
                    )?;
                } else {
                    out.write_str("no lower feed was found that holds the limits")?;
                }
                match window_admissible_s {
                    Some(window_s) => write!(out, ", or blend window {} s", Figure(window_s)),
                    None => Ok(()),
                }
            }
        }
    }
}

/// Formats a computed number to six digits.
struct Figure(f64);

impl fmt::Display for Figure {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let scale = 10.0_f64.powf(5.0 - self.0.abs().log10().floor());
        let rounded = (self.0 * scale).round() / scale;
        write!(out, "{}", if rounded.is_finite() { rounded } else { self.0 })
    }
}

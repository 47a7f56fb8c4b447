//! A spiral of constant pitch from its centre outwards, counter-clockwise.

use std::f64::consts::TAU;

use super::frame::flat;
use super::{Curve, Derivatives};
use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::jet::Jet;

/// `r = pitch θ/2π` around a centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spiral {
    pitch_m: f64,
    turns: f64,
    center_m: [f64; 2],
}

impl Spiral {
    /// Creates a spiral with a number of turns.
    ///
    /// # Errors
    /// [`TrajectoryError::Shape`] for a pitch or number of turns out of range.
    /// # Source
    /// - \[barton2010\], Section 8.1.2: from the centre, counter-clockwise
    pub fn new(pitch_m: f64, turns: f64, center_m: [f64; 2]) -> Result<Self, TrajectoryError> {
        if !is_positive(pitch_m) || pitch_m > 10.0 {
            return Err(TrajectoryError::Shape {
                name: "pitch_m",
                value: pitch_m,
                allowed: "above 0, up to 10",
            });
        }
        if !is_positive(turns) || turns > 1000.0 {
            return Err(TrajectoryError::Shape {
                name: "turns",
                value: turns,
                allowed: "above 0, up to 1000",
            });
        }
        Ok(Self { pitch_m, turns, center_m })
    }
}

impl Curve for Spiral {
    fn n_axes(&self) -> usize {
        2
    }

    fn breaks(&self) -> Vec<f64> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "up to 1000 turns"
        )]
        let n = (self.turns * 8.0).ceil() as usize;
        (0..=n).map(|i| self.turns * TAU * i as f64 / n as f64).collect()
    }

    fn at(&self, parameter: f64) -> Derivatives {
        let angle = Jet::line(parameter, 1.0);
        let quarter = Jet::constant(std::f64::consts::FRAC_PI_2);
        let radius = angle * (self.pitch_m / TAU);
        let (x, y) = (radius * (angle + quarter).sin(), radius * angle.sin());
        let mut values: [[f64; 2]; 4] = std::array::from_fn(|i| [x.0[i], y.0[i]]);
        values[0] = [values[0][0] + self.center_m[0], values[0][1] + self.center_m[1]];
        flat(values)
    }
}

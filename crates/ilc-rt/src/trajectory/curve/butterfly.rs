//! The butterfly contour, `r = e^{cos t} - 2 cos 4t - sin⁵(t/12)`.

use super::frame::flat;
use super::{Curve, Derivatives};
use crate::interpolate::limits::is_positive;
use crate::trajectory::error::TrajectoryError;
use crate::trajectory::jet::Jet;

/// Number of turns after which the contour closes; `sin⁵(t/12)` has this period.
const TURNS_MAX: f64 = 12.0;

/// `x = scale r sin t`, `y = scale r cos t`, for whole or fractional turns from `t = 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Butterfly {
    scale_m: f64,
    turns: f64,
    center_m: [f64; 2],
}

impl Butterfly {
    /// Creates the contour around a centre.
    ///
    /// # Errors
    /// [`TrajectoryError::Shape`] for a scale or number of turns out of range.
    /// # Source
    /// - [filter-ilc]: the contour of its experiments, `scale = 1.85 mm`
    pub fn new(scale_m: f64, turns: f64, center_m: [f64; 2]) -> Result<Self, TrajectoryError> {
        if !is_positive(scale_m) || scale_m > 10.0 {
            return Err(TrajectoryError::Shape {
                name: "scale_m",
                value: scale_m,
                allowed: "above 0, up to 10",
            });
        }
        if !is_positive(turns) || turns > TURNS_MAX {
            return Err(TrajectoryError::Shape {
                name: "turns",
                value: turns,
                allowed: "above 0, up to 12",
            });
        }
        Ok(Self { scale_m, turns, center_m })
    }
}

impl Curve for Butterfly {
    fn n_axes(&self) -> usize {
        2
    }

    fn breaks(&self) -> Vec<f64> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "up to 12 turns"
        )]
        let n = (self.turns * 32.0).ceil() as usize;
        (0..=n).map(|i| self.turns * std::f64::consts::TAU * i as f64 / n as f64).collect()
    }

    fn at(&self, parameter: f64) -> Derivatives {
        let t = Jet::line(parameter, 1.0);
        let quarter = std::f64::consts::FRAC_PI_2;
        let cos = |jet: Jet| (jet + Jet::constant(quarter)).sin();
        let wave = (t * (1.0 / 12.0)).sin();
        // e^{cos t} as the decay of -cos t.
        let radius = (-cos(t)).decay() - cos(t * 4.0) * 2.0 - wave.squared() * wave.cubed();
        let (x, y) = (radius * t.sin() * self.scale_m, radius * cos(t) * self.scale_m);
        let mut values: [[f64; 2]; 4] = std::array::from_fn(|i| [x.0[i], y.0[i]]);
        values[0] = [values[0][0] + self.center_m[0], values[0][1] + self.center_m[1]];
        flat(values)
    }
}

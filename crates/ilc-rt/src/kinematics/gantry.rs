//! Two or three axes at almost right angles.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::error::{KinematicsError, finite};

/// A gantry whose second axis is out of square.
///
/// `x_tool = x + orthogonality_rad y`, `y_tool = y`, as calibrations of machine tools state it.
///
/// # Units
/// - metres, and radians for the error of the right angle
/// # Source
/// - \[haas2016\], Sect. 4: the error that an encoder cannot see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gantry {
    orthogonality_rad: f64,
}

impl Gantry {
    /// Makes the mechanism.
    ///
    /// # Errors
    /// - [`KinematicsError::NotFinite`] for an angle that is not a number.
    pub fn new(orthogonality_rad: f64) -> Result<Self, KinematicsError> {
        finite("orthogonality_rad", &[orthogonality_rad])?;
        Ok(Self { orthogonality_rad })
    }

    /// Returns the error of the right angle.
    pub fn orthogonality_rad(&self) -> f64 {
        self.orthogonality_rad
    }

    /// Returns where the tool is for axis positions.
    ///
    /// # Real Time
    /// Hot; what is not finite stays so.
    pub fn forward(&self, axes_m: [f64; 2]) -> [f64; 2] {
        [axes_m[0] + self.orthogonality_rad * axes_m[1], axes_m[1]]
    }

    /// Returns the axis positions that bring the tool to a place.
    ///
    /// # Real Time
    /// Hot; what is not finite stays so.
    pub fn inverse(&self, tool_m: [f64; 2]) -> [f64; 2] {
        [tool_m[0] - self.orthogonality_rad * tool_m[1], tool_m[1]]
    }

    /// Returns how axis velocities become tool velocities, row by row: constant.
    pub fn jacobian(&self) -> [[f64; 2]; 2] {
        [[1.0, self.orthogonality_rad], [0.0, 1.0]]
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_methods, reason = "tests are cold")]
mod tests {
    use super::*;

    #[test]
    fn hand_computed_and_back() {
        let gantry = Gantry::new(2.5e-3).unwrap();
        let tool = gantry.forward([0.1, 0.06]);
        assert!((tool[0] - 0.10015).abs() < 1e-15 && (tool[1] - 0.06).abs() < 1e-15);
        let axes = gantry.inverse(tool);
        assert!((axes[0] - 0.1).abs() < 1e-15);
        assert!(Gantry::new(f64::NAN).is_err());
    }
}

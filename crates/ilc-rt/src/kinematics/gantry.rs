//! A gantry of two axes that are slightly out of square.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::error::{KinematicsError, finite};

/// A gantry with an orthogonality error between its axes.
///
/// `x_tool = x + orthogonality_rad y`, `y_tool = y`, the usual form of a machine tool's squareness
/// calibration.
///
/// # Units
/// - metres; radians for the orthogonality error
/// # Source
/// - \[haas2016\], Sect. 4: an error that the encoders cannot see.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gantry {
    orthogonality_rad: f64,
}

impl Gantry {
    /// Creates the mechanism.
    ///
    /// # Errors
    /// - [`KinematicsError::NotFinite`] for a non-finite angle.
    pub fn new(orthogonality_rad: f64) -> Result<Self, KinematicsError> {
        finite("orthogonality_rad", &[orthogonality_rad])?;
        Ok(Self { orthogonality_rad })
    }

    /// Returns the orthogonality error.
    pub fn orthogonality_rad(&self) -> f64 {
        self.orthogonality_rad
    }

    /// Returns the tool position for axis positions (forward kinematics).
    ///
    /// # Real Time
    /// Hot; non-finite values pass through.
    pub fn forward(&self, axes_m: [f64; 2]) -> [f64; 2] {
        [axes_m[0] + self.orthogonality_rad * axes_m[1], axes_m[1]]
    }

    /// Returns the axis positions for a tool position (inverse kinematics).
    ///
    /// # Real Time
    /// Hot; non-finite values pass through.
    pub fn inverse(&self, tool_m: [f64; 2]) -> [f64; 2] {
        [tool_m[0] - self.orthogonality_rad * tool_m[1], tool_m[1]]
    }

    /// Returns the Jacobian from axis to tool velocities, row-major; it is constant.
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

//! The delta mechanism: a parallel robot with three legs.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use nalgebra::{Matrix3, Vector3};

use super::error::{KinematicsError, finite};
use super::spheres::{NoPoint, upper_meeting_point};

/// A pose counts as singular if the sine between a rod and the plane or crank concerned is smaller.
const SINGULAR: f64 = 1e-6;

/// Three cranks at 0, 120 and 240 degrees around a base, each with a rod to the tool.
///
/// The knee of leg `i` is `k_i = R_z(phi_i) (base + crank cos theta_i, 0, crank sin theta_i)`, and the
/// tool is the point above the knees with `|p - k_i| = rod` for all three.
///
/// # Shapes
/// - joint angles and positions have three coordinates; Jacobians are row by row
/// # Units
/// - metres and radians; `base_m` is the radius of the crank pivots minus the radius of the rod
///   joints on the tool
/// # Source
/// - \[barton2010\], Eq. (7.1) to (7.11) with `tan(theta / 2)` for the printed `tan(theta / b)`, App. C and
///   F for the default lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delta {
    base_m: f64,
    crank_m: f64,
    rod_m: f64,
    /// Cosine and sine of the azimuth of each leg.
    azimuths: [(f64, f64); 3],
}

impl Default for Delta {
    /// The mechanism of the source: 37, 60 and 145 mm.
    fn default() -> Self {
        Self::with_lengths(0.037, 0.060, 0.145)
    }
}

impl Delta {
    /// Creates a mechanism.
    ///
    /// # Errors
    /// - [`KinematicsError::Length`] for a crank or rod of length 0 or less, a negative base
    ///   radius, or rods too short to close the mechanism anywhere above the base.
    pub fn new(base_m: f64, crank_m: f64, rod_m: f64) -> Result<Self, KinematicsError> {
        for (what, value_m, least_m, allowed) in [
            ("base_m", base_m, 0.0, "it must be finite and not negative"),
            ("crank_m", crank_m, f64::MIN_POSITIVE, "it must be finite and above 0"),
            ("rod_m", rod_m, f64::MIN_POSITIVE, "it must be finite and above 0"),
        ] {
            if !(value_m.is_finite() && value_m >= least_m) {
                return Err(KinematicsError::Length { what, value_m, allowed });
            }
        }
        if rod_m <= (base_m - crank_m).max(0.0) {
            let allowed = "the rods must reach from the knees to the axis: above base_m - crank_m";
            return Err(KinematicsError::Length { what: "rod_m", value_m: rod_m, allowed });
        }
        Ok(Self::with_lengths(base_m, crank_m, rod_m))
    }

    fn with_lengths(base_m: f64, crank_m: f64, rod_m: f64) -> Self {
        let half_root_3 = 0.75_f64.sqrt();
        let azimuths = [(1.0, 0.0), (-0.5, half_root_3), (-0.5, -half_root_3)];
        Self { base_m, crank_m, rod_m, azimuths }
    }

    /// Returns base radius, crank and rod.
    pub fn lengths_m(&self) -> [f64; 3] {
        [self.base_m, self.crank_m, self.rod_m]
    }

    /// Returns the tool position (forward kinematics).
    ///
    /// # Real Time
    /// Hot.
    /// # Errors
    /// - [`KinematicsError::Open`] if the rods do not meet above the knees.
    /// # Source
    /// - \[barton2010\], Eq. (7.5): three spheres, intersected geometrically instead of by
    ///   elimination.
    pub fn forward(&self, joints_rad: [f64; 3]) -> Result<[f64; 3], KinematicsError> {
        finite("joints_rad", &joints_rad)?;
        let point = upper_meeting_point(&self.knees_m(joints_rad), self.rod_m);
        let point = point.map_err(|why| {
            let reason = match why {
                NoPoint::Collinear => "the knees lie on one line",
                NoPoint::Apart => "the knees are too far apart for the rods",
            };
            KinematicsError::Open { joints_rad, reason }
        })?;
        Ok(point.into())
    }

    /// Returns the crank angles for a tool position, knees outward (inverse kinematics).
    ///
    /// # Real Time
    /// Hot.
    /// # Errors
    /// - [`KinematicsError::Unreachable`] with the pose and the leg that cannot reach it, or if the
    ///   mechanism would assemble below its knees there.
    /// # Source
    /// - \[barton2010\], Eq. (7.8): the same quadratic, solved for the angle itself.
    pub fn inverse(&self, pose_m: [f64; 3]) -> Result<[f64; 3], KinematicsError> {
        finite("pose_m", &pose_m)?;
        let mut joints_rad = [0.0; 3];
        for (leg, joint_rad) in joints_rad.iter_mut().enumerate() {
            let (cos, sin) = self.azimuths[leg];
            let out = cos * pose_m[0] + sin * pose_m[1] - self.base_m;
            let side = cos * pose_m[1] - sin * pose_m[0];
            let up = pose_m[2];
            // |p - k|^2 = rod^2 is `across cos(theta) + along sin(theta) = wanted`.
            let reach_squared = out * out + up * up;
            let (across, along) = (2.0 * self.crank_m * out, 2.0 * self.crank_m * up);
            let wanted =
                reach_squared + side * side + self.crank_m * self.crank_m - self.rod_m * self.rod_m;
            let room = across * across + along * along - wanted * wanted;
            if room < 0.0 {
                let reason = if wanted > 0.0 { "too far" } else { "too near" };
                return Err(KinematicsError::Unreachable { pose_m, leg, reason });
            }
            // Of the two solutions, the one with the knee outward.
            let turned = along.atan2(across) - room.sqrt().atan2(wanted);
            *joint_rad = wrapped(turned);
        }
        // The same joints assembled above the knees: a different result means another assembly
        // mode.
        let closed = self.forward(joints_rad).map(Vector3::from);
        let there = Vector3::from(pose_m);
        if !closed.is_ok_and(|closed| (closed - there).norm() <= 1e-6 * self.rod_m) {
            let reason = "the tool would have to be below the knees";
            return Err(KinematicsError::Unreachable { pose_m, leg: 0, reason });
        }
        Ok(joints_rad)
    }

    /// Returns the Jacobian from joint to tool velocities, in m/rad: `dp = J dtheta`.
    ///
    /// From `(p - k_i) . dp = (p - k_i) . k_i' dtheta_i`, so `J = S^-1 diag(s_i . k_i')` with the rods
    /// `s_i = p - k_i` as the rows of `S`.
    ///
    /// # Real Time
    /// Hot.
    /// # Errors
    /// - as [`Delta::forward`], and [`KinematicsError::Singular`] where the rods lie in one plane
    ///   (the tool moves freely) or a crank is aligned with its rod (the joint cannot move the
    ///   tool).
    /// # Source
    /// - \[barton2010\], Sect. 7.2.3, which uses a difference quotient over a large step.
    pub fn jacobian(&self, joints_rad: [f64; 3]) -> Result<[[f64; 3]; 3], KinematicsError> {
        let point = Vector3::from(self.forward(joints_rad)?);
        let knees = self.knees_m(joints_rad);
        let mut rods = Matrix3::zeros();
        let mut drives = [0.0; 3];
        for leg in 0..3 {
            let rod = (point - knees[leg]) / self.rod_m;
            let (sin_theta, cos_theta) = joints_rad[leg].sin_cos();
            let (cos, sin) = self.azimuths[leg];
            let swing = Vector3::new(-sin_theta * cos, -sin_theta * sin, cos_theta);
            drives[leg] = rod.dot(&swing) * self.crank_m;
            rods.set_row(leg, &rod.transpose());
        }
        let singular = |reason| KinematicsError::Singular { joints_rad, reason };
        if rods.determinant().abs() < SINGULAR {
            return Err(singular("the three rods lie in one plane"));
        }
        if drives.iter().any(|drive| drive.abs() < SINGULAR * self.crank_m) {
            return Err(singular("a crank and its rod lie in one line"));
        }
        let inverse = rods.try_inverse().ok_or(singular("the three rods lie in one plane"))?;
        let jacobian = inverse * Matrix3::from_diagonal(&Vector3::from(drives));
        Ok(std::array::from_fn(|row| std::array::from_fn(|col| jacobian[(row, col)])))
    }

    /// Returns true if the tool can reach a position and move from it in every direction.
    ///
    /// # Real Time
    /// Hot.
    pub fn is_in_workspace(&self, pose_m: [f64; 3]) -> bool {
        self.inverse(pose_m).is_ok_and(|joints_rad| self.jacobian(joints_rad).is_ok())
    }

    /// Returns the condition number of the Jacobian: largest over smallest singular value. 1 is
    /// isotropic; it grows without bound towards a singularity.
    ///
    /// # Errors
    /// - as [`Delta::jacobian`]
    pub fn condition(&self, joints_rad: [f64; 3]) -> Result<f64, KinematicsError> {
        let rows = self.jacobian(joints_rad)?;
        let jacobian = Matrix3::from_fn(|row, col| rows[row][col]);
        let values = jacobian.singular_values();
        Ok(values.max() / values.min())
    }

    fn knees_m(&self, joints_rad: [f64; 3]) -> [Vector3<f64>; 3] {
        std::array::from_fn(|leg| {
            let (sin_theta, cos_theta) = joints_rad[leg].sin_cos();
            let radius = self.base_m + self.crank_m * cos_theta;
            let (cos, sin) = self.azimuths[leg];
            Vector3::new(radius * cos, radius * sin, self.crank_m * sin_theta)
        })
    }
}

/// Wraps an angle to (-pi, pi].
fn wrapped(angle_rad: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if angle_rad <= -PI {
        angle_rad + TAU
    } else if angle_rad > PI {
        angle_rad - TAU
    } else {
        angle_rad
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    reason = "tests are cold"
)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn straight_up_is_hand_computed() {
        // Knees at radius 37 + 60 cos 60 = 67 mm, height 60 sin 60; the rods rise by sqrt(145^2 - 67^2).
        let angle = std::f64::consts::FRAC_PI_3;
        let top = Delta::default().forward([angle; 3]).unwrap();
        let height = 0.06 * angle.sin() + (0.145_f64.powi(2) - 0.067_f64.powi(2)).sqrt();
        assert!(top[0].abs() < 1e-16 && top[1].abs() < 1e-16);
        assert!((top[2] - height).abs() < 1e-15, "{top:?}");
        let back = Delta::default().inverse(top).unwrap();
        assert!(back.iter().all(|joint| (joint - angle).abs() < 1e-12), "{back:?}");
    }

    #[test]
    fn the_printed_jacobian_is_a_pose_of_this_mechanism() {
        // The source prints -44.71, 22.36, 38.72 and 14.56 mm/rad for equal angles, from a coarse
        // step.
        let rows = Delta::default().jacobian([1.05; 3]).unwrap();
        assert!((rows[0][0] + 2.0 * rows[0][1]).abs() < 1e-12, "{rows:?}");
        assert!((rows[1][2] + rows[1][1]).abs() < 1e-12 && rows[1][0].abs() < 1e-12);
        assert!((rows[2][0] - rows[2][2]).abs() < 1e-12);
        assert!((rows[1][2] / rows[0][1] - 3.0_f64.sqrt()).abs() < 1e-9, "38.72 / 22.36");
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_numbers() {
        let delta = Delta::default();
        let told = delta.inverse([0.0, 0.0, 0.5]).unwrap_err().to_string();
        assert!(
            told.contains("(0.000000, 0.000000, 0.500000) m") && told.contains("too far"),
            "{told}"
        );
        assert!(delta.inverse([0.0, 0.0, -0.1]).is_err());
        assert!(matches!(
            delta.inverse([0.0, f64::NAN, 0.1]),
            Err(KinematicsError::NotFinite { index: 1, .. })
        ));
        let wide = Delta::new(0.2, 0.06, 0.145).unwrap();
        assert!(wide.forward([0.0; 3]).unwrap_err().to_string().contains("too far apart"));
        for (lengths, word) in [
            ([-0.1, 0.06, 0.1], "base_m"),
            ([0.1, 0.0, 0.1], "crank_m"),
            ([0.1, 0.06, f64::NAN], "rod_m"),
            ([0.3, 0.06, 0.2], "base_m - crank_m"),
        ] {
            let told = Delta::new(lengths[0], lengths[1], lengths[2]).unwrap_err().to_string();
            assert!(told.contains(word), "{told}");
        }
    }

    #[test]
    fn a_crank_along_its_rod_is_singular() {
        // Knees fold in until the crank of each leg points at the tool on the axis.
        let delta = Delta::new(0.1, 0.06, 0.2).unwrap();
        // Base, crank and rod in one line: crank at the angle whose cosine is -base / (crank + rod).
        let angle = (-0.1_f64 / 0.26).acos();
        let told = delta.jacobian([angle; 3]).unwrap_err().to_string();
        assert!(told.contains("one line"), "{told}");
    }

    proptest! {
        #![proptest_config(ilc_cases::cases(2000))]

        #[test]
        fn round_trips_over_the_workspace(
            base in 0.01..0.1_f64, crank in 0.04..0.2_f64, rod in 0.1..0.4_f64,
            joints in prop::array::uniform3(-0.6..1.9_f64),
        ) {
            let Ok(delta) = Delta::new(base, crank, rod) else { return Ok(()) };
            let Ok(pose) = delta.forward(joints) else { return Ok(()) };
            prop_assume!(delta.condition(joints).is_ok_and(|condition| condition < 100.0));
            let Ok(back) = delta.inverse(pose) else { return Ok(()) };
            let again = delta.forward(back).unwrap();
            for axis in 0..3 {
                prop_assert!((again[axis] - pose[axis]).abs() < 1e-9, "{pose:?} {again:?}");
            }
        }

        #[test]
        fn the_jacobian_is_the_derivative(joints in prop::array::uniform3(0.2..1.5_f64)) {
            let delta = Delta::default();
            let Ok(rows) = delta.jacobian(joints) else { return Ok(()) };
            let step = 1e-5;
            for joint in 0..3 {
                let moved = |by: f64| {
                    let mut joints = joints;
                    joints[joint] += by;
                    delta.forward(joints)
                };
                let (Ok(ahead), Ok(behind)) = (moved(step), moved(-step)) else { continue };
                for axis in 0..3 {
                    let slope = (ahead[axis] - behind[axis]) / (2.0 * step);
                    prop_assert!((slope - rows[axis][joint]).abs() < 1e-8, "{slope} {rows:?}");
                }
            }
        }
    }

    #[test]
    fn angles_come_back_over_the_whole_grid_of_the_default() {
        let delta = Delta::default();
        let mut count = 0;
        for a in 0..12 {
            for b in 0..12 {
                for c in 0..12 {
                    let joints = [a, b, c].map(|step| 0.2 + 0.1 * f64::from(step));
                    let pose = delta.forward(joints).unwrap();
                    let Ok(back) = delta.inverse(pose) else {
                        panic!("{joints:?} -> {pose:?}");
                    };
                    let worst = joints
                        .iter()
                        .zip(back)
                        .map(|(one, other)| (one - other).abs())
                        .fold(0.0, f64::max);
                    assert!(worst < 1e-9, "{joints:?} {back:?}");
                    count += 1;
                }
            }
        }
        assert_eq!(count, 1728);
    }
}

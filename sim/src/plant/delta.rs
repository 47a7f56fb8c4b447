//! Three cranks that move one platform: a delta mechanism with coupled inertia, gravity and friction.
//!
//! Each crank has the cascade of its drive, which knows nothing of the others.

use std::f64::consts::TAU;

use ilc_rt::config::{Cell, DeltaSimulation};
use ilc_rt::kinematics::{self, KinematicsError};

use super::drive_loop::DriveLoop;
use super::environment::Environment;
use super::friction::Friction;
use super::noise::Noise;
use super::{Demand, Plant};

/// Number of cranks.
pub(super) const LEGS: usize = 3;
/// Sweeps over the cranks in which friction and brakes of a step settle.
const SWEEPS: usize = 40;
/// Time by which the mechanism is moved on for the rate of its Jacobian.
const RATE_S: f64 = 1e-4;

type Vector = [f64; LEGS];
type Matrix = [[f64; LEGS]; LEGS];

/// One crank: its drive, its friction and its motion.
#[derive(Clone, Copy, Debug)]
struct Crank {
    drive: DriveLoop,
    friction: Friction,
    viscous_n_s_m: f64,
    force_max_n: f64,
    integral_n: f64,
    /// Force that is added to the output of the velocity controller.
    feedforward_n: f64,
    force_n: f64,
    /// Error of the encoder in this step.
    noise_rad: f64,
}

/// A delta mechanism under the drives of its cranks.
///
/// With the Jacobian `J` of the platform, its mass `m` and the inertia `I` of a crank, the angles `q` follow
///
/// `(I + m JᵀJ) q̈ + m Jᵀ (J̇ q̇ + g e_z) = τ - friction`
///
/// A step first moves freely, then friction and brakes take from each crank the impulse that stops it, as far as they
/// can: a crank at rest stays at rest, to the last bit, while the others move the platform. Where the mechanism cannot
/// close, it stands.
///
/// # Real Time
/// [`Plant::step`] does not allocate.
#[derive(Clone, Debug)]
pub struct Delta {
    mechanism: kinematics::Delta,
    description: DeltaSimulation,
    cranks: [Crank; LEGS],
    angle_rad: Vector,
    rate_rad_s: Vector,
    tool_m: Vector,
    noise_m: f64,
    noise: Noise,
    environment: Environment,
}

impl Delta {
    /// Creates the mechanism of three axes of a cell description, at rest at its start position.
    ///
    /// # Errors
    /// [`KinematicsError`] for a mechanism that validation would have refused.
    pub fn from_cell(
        cell: &Cell,
        description: &DeltaSimulation,
        first: usize,
    ) -> Result<Self, KinematicsError> {
        let mechanism =
            kinematics::Delta::new(description.base_m, description.crank_m, description.rod_m)?;
        let names: Vec<&str> =
            cell.axes.iter().skip(first).map(|axis| axis.name.as_str()).collect();
        let of =
            |leg: usize| cell.axes.get(first + leg).map(|axis| axis.simulation).unwrap_or_default();
        let angle_rad: Vector = std::array::from_fn(|leg| of(leg).position_start_m);
        let cranks = std::array::from_fn(|leg| {
            let s = of(leg);
            Crank {
                drive: DriveLoop::tuned(
                    s.mass_kg,
                    TAU * s.natural_frequency_hz,
                    s.damping,
                    s.integral_time_s,
                    s.force_max_n,
                ),
                friction: Friction {
                    coulomb_n: s.coulomb_n,
                    static_n: s.static_n,
                    stribeck_m_s: s.stribeck_m_s,
                },
                viscous_n_s_m: s.viscous_n_s_m,
                force_max_n: s.force_max_n,
                integral_n: 0.0,
                feedforward_n: 0.0,
                force_n: 0.0,
                noise_rad: 0.0,
            }
        });
        Ok(Self {
            tool_m: mechanism.forward(angle_rad)?,
            mechanism,
            description: *description,
            cranks,
            angle_rad,
            rate_rad_s: [0.0; LEGS],
            noise_m: cell.simulation.encoder_noise_m,
            noise: Noise::new(cell.simulation.seed.wrapping_add(first as u64)),
            environment: Environment::new(&cell.simulation, &names),
        })
    }

    /// Returns inertia, and the torque of gravity and of the motion itself, at angles and rates.
    fn dynamics(
        &mut self,
        angle_rad: &Vector,
        rate_rad_s: &Vector,
    ) -> Result<(Matrix, Vector), KinematicsError> {
        let mass_kg = self.description.platform_kg + self.environment.of(0).payload_kg;
        let jacobian = self.mechanism.jacobian(*angle_rad)?;
        let beside = |sign: f64| {
            let moved: Vector =
                std::array::from_fn(|leg| angle_rad[leg] + sign * RATE_S * rate_rad_s[leg]);
            self.mechanism.jacobian(moved)
        };
        // At rest both are the same, and there is no acceleration of the motion itself.
        let (after, before) = (beside(1.0)?, beside(-1.0)?);
        let own_m_s2: Vector = std::array::from_fn(|row| {
            (0..LEGS)
                .map(|leg| (after[row][leg] - before[row][leg]) / (2.0 * RATE_S) * rate_rad_s[leg])
                .sum()
        });
        let pull_m_s2 = [own_m_s2[0], own_m_s2[1], own_m_s2[2] + self.description.gravity_m_s2];
        let dot = |a: usize, b: &dyn Fn(usize) -> f64| -> f64 {
            (0..LEGS).map(|row| jacobian[row][a] * b(row)).sum()
        };
        let inertia = std::array::from_fn(|a| {
            std::array::from_fn(|b| {
                let own = if a == b { self.description.crank_kg_m2 } else { 0.0 };
                own + mass_kg * dot(a, &|row| jacobian[row][b])
            })
        });
        let torque = std::array::from_fn(|leg| mass_kg * dot(leg, &|row| pull_m_s2[row]));
        Ok((inertia, torque))
    }

    /// Returns the rates after a step under these torques of the motors; the brakes of `is_off` are applied.
    fn rates_after(
        &mut self,
        motor_n: &Vector,
        is_off: [bool; LEGS],
        dt_s: f64,
    ) -> Result<Vector, KinematicsError> {
        let (angle_rad, rate_rad_s) = (self.angle_rad, self.rate_rad_s);
        let (inertia, opposing) = self.dynamics(&angle_rad, &rate_rad_s)?;
        let mobility = inverse(&inertia);
        let impulse: Vector = std::array::from_fn(|leg| {
            let viscous_n = self.cranks[leg].viscous_n_s_m * rate_rad_s[leg];
            (motor_n[leg] - opposing[leg] - viscous_n) * dt_s
        });
        let mut next: Vector = std::array::from_fn(|leg| {
            rate_rad_s[leg]
                + (0..LEGS).map(|other| mobility[leg][other] * impulse[other]).sum::<f64>()
        });
        let most: Vector = std::array::from_fn(|leg| {
            let Crank { friction, force_max_n, .. } = &self.cranks[leg];
            let sliding_n = if rate_rad_s[leg] == 0.0 {
                friction.static_n
            } else {
                friction.sliding_n(rate_rad_s[leg])
            };
            // A brake holds as much as the motor's maximum torque.
            (sliding_n + if is_off[leg] { *force_max_n } else { 0.0 }) * dt_s
        });
        let mut taken = [0.0; LEGS];
        let mut rests = [false; LEGS];
        for _ in 0..SWEEPS {
            for leg in 0..LEGS {
                let stopping = taken[leg] - next[leg] / mobility[leg][leg];
                let bounded = stopping.clamp(-most[leg], most[leg]);
                rests[leg] = bounded.to_bits() == stopping.to_bits();
                let change = bounded - taken[leg];
                taken[leg] = bounded;
                for (rate, row) in next.iter_mut().zip(&mobility) {
                    *rate += row[leg] * change;
                }
            }
        }
        for (rate, rests) in next.iter_mut().zip(rests) {
            if rests {
                *rate = 0.0;
            }
        }
        Ok(next)
    }
}

impl Plant for Delta {
    fn n_axes(&self) -> usize {
        LEGS
    }

    fn step(&mut self, demand: &[Demand], dt_s: f64) {
        self.environment.advance(dt_s);
        let mut motor_n = [0.0; LEGS];
        let mut is_off = [true; LEGS];
        for (leg, crank) in self.cranks.iter_mut().enumerate() {
            let demand = demand.get(leg).copied().unwrap_or(Demand::Off);
            is_off[leg] = demand == Demand::Off;
            crank.force_n = crank.drive.force_n(
                demand,
                self.angle_rad[leg] + crank.noise_rad,
                self.rate_rad_s[leg],
                crank.feedforward_n,
                &mut crank.integral_n,
                dt_s,
            );
            motor_n[leg] = crank.force_n;
        }
        let stands = [0.0; LEGS];
        let rates = self.rates_after(&motor_n, is_off, dt_s).unwrap_or(stands);
        let moved: Vector = std::array::from_fn(|leg| self.angle_rad[leg] + rates[leg] * dt_s);
        // Where it cannot move on, it has hit its end.
        let closes = self.mechanism.jacobian(moved).and_then(|_| self.mechanism.forward(moved));
        match closes {
            Ok(tool_m) => (self.angle_rad, self.rate_rad_s, self.tool_m) = (moved, rates, tool_m),
            Err(_) => self.rate_rad_s = stands,
        }
        if self.noise_m > 0.0 {
            for crank in &mut self.cranks {
                crank.noise_rad = self.noise_m * self.noise.normal();
            }
        }
    }

    fn limit_force(&mut self, axis: usize, share: f64) {
        if let Some(crank) = self.cranks.get_mut(axis) {
            crank.drive.force_max_n = crank.force_max_n * share;
        }
    }

    fn feed_force(&mut self, axis: usize, force_n: f64) {
        if let Some(crank) = self.cranks.get_mut(axis) {
            crank.feedforward_n = force_n;
        }
    }

    fn encoder_m(&self, axis: usize) -> f64 {
        let noise_rad = self.cranks.get(axis).map_or(0.0, |crank| crank.noise_rad);
        self.angle_rad.get(axis).map_or(0.0, |angle_rad| angle_rad + noise_rad)
    }

    fn encoder_velocity_m_s(&self, axis: usize) -> f64 {
        self.rate_rad_s.get(axis).copied().unwrap_or(0.0)
    }

    fn force_n(&self, axis: usize) -> f64 {
        self.cranks.get(axis).map_or(0.0, |crank| crank.force_n)
    }

    fn tool_m(&self, axis: usize) -> f64 {
        self.tool_m.get(axis).copied().unwrap_or(0.0)
    }
}

/// Returns the inverse of an inertia, which is symmetric and positive definite.
fn inverse(m: &Matrix) -> Matrix {
    let minor = |row: usize, column: usize| {
        let [r, s] = [(row + 1) % LEGS, (row + 2) % LEGS];
        let [c, d] = [(column + 1) % LEGS, (column + 2) % LEGS];
        m[r][c] * m[s][d] - m[r][d] * m[s][c]
    };
    let determinant: f64 = (0..LEGS).map(|column| m[0][column] * minor(0, column)).sum();
    std::array::from_fn(|row| std::array::from_fn(|column| minor(column, row) / determinant))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp, reason = "what rests must rest to the last bit")]
mod tests;

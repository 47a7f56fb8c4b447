//! Basis functions: signals of the program of an axis that a parametric law weights by parameters.

use std::f64::consts::TAU;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Velocity up to which an axis counts as at rest, in its unit per second.
const REST_VELOCITY: f64 = 1e-3;

/// Signal of the set points of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MotionFunction {
    /// Distance from the start.
    Position,
    /// First derivative: what lags behind.
    Velocity,
    /// Second derivative: what inertia leaves.
    Acceleration,
    /// Third derivative.
    Jerk,
    /// Fourth derivative: what a flexible mode leaves.
    Snap,
    /// Direction of travel, smooth at rest: Coulomb friction.
    Coulomb,
    /// Velocity again, under the name of the friction.
    Viscous,
}

impl MotionFunction {
    /// Returns the name in a cell description.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
            Self::Snap => "snap",
            Self::Coulomb => "coulomb",
            Self::Viscous => "viscous",
        }
    }

    fn signal(self, position_m: &[f64], dt_s: f64) -> Vec<f64> {
        let derivative = |order| derivative(position_m, dt_s, order);
        match self {
            Self::Position => position_m.iter().map(|r| r - position_m[0]).collect(),
            Self::Velocity | Self::Viscous => derivative(1),
            Self::Acceleration => derivative(2),
            Self::Jerk => derivative(3),
            Self::Snap => derivative(4),
            Self::Coulomb => derivative(1).iter().map(|v| (v / REST_VELOCITY).tanh()).collect(),
        }
    }
}

/// Direction of travel in which an entry of a table counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Travel {
    /// In both.
    Both,
    /// Towards higher positions; at rest by half.
    Forward,
    /// Towards lower positions; at rest by half.
    Backward,
}

/// Basis function of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Function {
    /// Of the motion.
    Motion(MotionFunction),
    /// `sin(2 pi order r / pitch)` of the position r, or the cosine.
    Harmonic {
        /// Period in the unit of the position.
        pitch_m: f64,
        /// Number of the harmonic, from 1.
        order: u32,
        /// Cosine in place of sine.
        is_cosine: bool,
    },
    /// Entry of a table over the position, between whose entries the input is interpolated linearly.
    Entry {
        /// Position of the entry.
        at_m: f64,
        /// Distance of the entries.
        spacing_m: f64,
        /// Direction of travel in which it counts.
        travel: Travel,
    },
}

impl Function {
    /// Returns the signal for the set points of an axis, `lead` samples ahead; beyond the end it is held.
    pub fn signal(self, position_m: &[f64], dt_s: f64, lead: usize) -> Vec<f64> {
        let signal: Vec<f64> = match self {
            Self::Motion(function) => function.signal(position_m, dt_s),
            Self::Harmonic { pitch_m, order, is_cosine } => {
                let phase = position_m.iter().map(|r| TAU * f64::from(order) * r / pitch_m);
                phase.map(|phase| if is_cosine { phase.cos() } else { phase.sin() }).collect()
            }
            Self::Entry { at_m, spacing_m, travel } => {
                let hat = |r: &f64| (1.0 - (r - at_m).abs() / spacing_m).max(0.0);
                let sign = match travel {
                    Travel::Both => return ahead(position_m.iter().map(hat).collect(), lead),
                    Travel::Forward => 1.0,
                    Travel::Backward => -1.0,
                };
                let direction = MotionFunction::Coulomb.signal(position_m, dt_s);
                let share = direction.iter().map(|direction| 0.5 * (1.0 + sign * direction));
                position_m.iter().zip(share).map(|(r, share)| share * hat(r)).collect()
            }
        };
        ahead(signal, lead)
    }

    /// Returns the name of the parameter, for the record of a run.
    pub fn name(self) -> String {
        match self {
            Self::Motion(function) => function.as_str().to_owned(),
            Self::Harmonic { pitch_m, order, is_cosine } => {
                format!("{}({order} / {pitch_m})", if is_cosine { "cos" } else { "sin" })
            }
            Self::Entry { at_m, travel, .. } => {
                let sign = match travel {
                    Travel::Both => "",
                    Travel::Forward => "+",
                    Travel::Backward => "-",
                };
                format!("table({at_m:.4}{sign})")
            }
        }
    }
}

fn ahead(mut signal: Vec<f64>, lead: usize) -> Vec<f64> {
    let last = signal.last().copied().unwrap_or(0.0);
    let n_samples = signal.len();
    signal.drain(..lead.min(n_samples));
    signal.resize(n_samples, last);
    signal
}

/// Returns a derivative by central differences; before and after the run the axis rests.
fn derivative(position_m: &[f64], dt_s: f64, order: usize) -> Vec<f64> {
    let (Some(first), Some(last)) = (position_m.first(), position_m.last()) else {
        return Vec::new();
    };
    let mut wide = vec![*first; order];
    wide.extend_from_slice(position_m);
    wide.extend(std::iter::repeat_n(*last, order));
    for _ in 0..order {
        wide = wide.windows(3).map(|w| (w[2] - w[0]) / (2.0 * dt_s)).collect();
    }
    wide
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_a_polynomial_are_exact_inside() {
        let dt_s = 0.5;
        let cubic: Vec<f64> = (0..20).map(|k| (f64::from(k) * dt_s).powi(3)).collect();
        let of = |function: MotionFunction| Function::Motion(function).signal(&cubic, dt_s, 0);
        let (acceleration, jerk) = (of(MotionFunction::Acceleration), of(MotionFunction::Jerk));
        for k in 4..16_u32 {
            let at = k as usize;
            assert!((acceleration[at] - 6.0 * f64::from(k) * dt_s).abs() < 1e-9);
            assert!((jerk[at] - 6.0).abs() < 1e-9);
        }
        assert_eq!(of(MotionFunction::Velocity), of(MotionFunction::Viscous));
        let ahead = Function::Motion(MotionFunction::Position).signal(&cubic, dt_s, 3);
        assert_eq!((ahead[0], ahead[18], ahead.len()), (cubic[3], cubic[19], 20));
    }

    #[test]
    fn the_entries_of_a_table_interpolate() {
        let way: Vec<f64> = (0..50).map(|k| 0.01 * f64::from(k)).collect();
        let values = [3.0, -1.0, 4.0, 2.0, 0.5, 7.0];
        let entry = |index: u32, travel| Function::Entry {
            at_m: 0.1 * f64::from(index),
            spacing_m: 0.1,
            travel,
        };
        let mut sum = vec![0.0; 50];
        let mut by_direction = vec![0.0; 50];
        for (index, value) in (0..).zip(values) {
            let signal = entry(index, Travel::Both).signal(&way, 0.1, 0);
            sum.iter_mut().zip(signal).for_each(|(sum, psi)| *sum += value * psi);
            for travel in [Travel::Forward, Travel::Backward] {
                let signal = entry(index, travel).signal(&way, 0.1, 0);
                let own = if travel == Travel::Forward { value } else { -value };
                by_direction.iter_mut().zip(signal).for_each(|(sum, psi)| *sum += own * psi);
            }
        }
        assert!((sum[10] + 1.0).abs() < 1e-12 && (sum[15] - 1.5).abs() < 1e-12, "{sum:?}");
        // Travel is forward all the way.
        for (one, other) in sum.iter().zip(&by_direction) {
            assert!((one - other).abs() < 1e-9, "{by_direction:?}");
        }
    }
}

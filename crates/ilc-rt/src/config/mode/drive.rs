//! Linear model of a drive's own loops, from all three of its inputs to its position.
//!
//! `dv/dt = a (w - v) + i + F/m`, `di/dt = a/T (w - v)`, `w = kv (r - y) + v_offset`: a proportional
//! position loop around a velocity loop of bandwidth `a`, with integral time `T` if it has one. For
//! the modes beside it.

use nalgebra::{DMatrix, dmatrix};

use crate::model::{ModelError, StateSpace};

/// Loops of a drive.
pub(super) struct DriveLoops {
    /// Gain of the position loop; 0 if the drive has none.
    pub(super) position_gain_per_s: f64,
    /// Bandwidth of the velocity loop.
    pub(super) bandwidth_rad_s: f64,
    /// Integral time of the velocity loop, if it has one.
    pub(super) integral_time_s: Option<f64>,
    /// Moving mass.
    pub(super) mass_kg: f64,
}

impl DriveLoops {
    /// Returns the gain of the velocity loop: force per velocity error.
    pub(super) fn gain_n_s_m(&self) -> f64 {
        self.bandwidth_rad_s * self.mass_kg
    }

    /// Returns the continuous model; inputs are set point, velocity and force.
    pub(super) fn model(&self) -> Result<StateSpace, ModelError> {
        let (kv, a) = (self.position_gain_per_s, self.bandwidth_rad_s);
        let per_kg = 1.0 / self.mass_kg;
        let (states, inputs) = match self.integral_time_s {
            None => (dmatrix![0.0, 1.0; -a * kv, -a], dmatrix![0.0, 0.0, 0.0; a * kv, a, per_kg]),
            Some(time_s) => {
                let b = a / time_s;
                (
                    dmatrix![0.0, 1.0, 0.0; -a * kv, -a, 1.0; -b * kv, -b, 0.0],
                    dmatrix![0.0, 0.0, 0.0; a * kv, a, per_kg; b * kv, b, 0.0],
                )
            }
        };
        let mut output = DMatrix::zeros(1, states.nrows());
        output[(0, 0)] = 1.0;
        StateSpace::continuous(states, inputs, output, DMatrix::zeros(1, 3))
    }
}

/// Returns the model from one of several inputs.
pub(super) fn from_input(model: &StateSpace, input: usize) -> Result<StateSpace, ModelError> {
    let column = |matrix: &DMatrix<f64>| matrix.columns(input, 1).into_owned();
    StateSpace::new(
        model.a().clone(),
        column(model.b()),
        model.c().clone(),
        column(model.d()),
        model.dt_s(),
    )
}

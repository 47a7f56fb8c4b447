//! PID control with derivative filter, output saturation and anti-windup.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::{Bounded, clamp_finite};

/// Discretisation of the derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Derivative {
    /// `(e[k] - e[k-1]) / dt`
    Difference,
    /// `(e[k-1] - e[k-2]) / dt`, one sample late: \[barton2010\], Eq. (8.3).
    DelayedDifference,
    /// `s / (T s + 1)`, discretised with a zero-order hold: \[dimarco2016\], Sect. 4.1.
    Filtered {
        /// Filter time constant `T`.
        time_constant_s: f64,
    },
}

/// Gains and limit of a PID controller.
///
/// # Units
/// - output units per error unit (`kp`), times second (`kd_s`), per second (`ki_per_s`)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidGains {
    /// Proportional gain.
    pub kp: f64,
    /// Integral gain.
    pub ki_per_s: f64,
    /// Derivative gain.
    pub kd_s: f64,
    /// Discretisation of the derivative.
    pub derivative: Derivative,
    /// Output limit, symmetric; infinite for unlimited.
    pub output_max: f64,
}

/// A PID controller.
///
/// `u[k] = kp e[k] + ki dt sum_{i<k} e[i] + kd (de/dt)[k]`, saturated to
/// `-output_max..=output_max`. Anti-windup: while the output saturates, the integral ignores errors
/// that would drive it further (conditional integration).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pid {
    gains: PidGains,
    dt_s: f64,
    /// Pole of the derivative filter: the factor by which its state decays in one sample.
    keep: f64,
    integral: f64,
    memory: [f64; 2],
}

/// Unsaturated controller in state space: `x[k+1] = a x[k] + b e[k]`, `u[k] = c x[k] + d e[k]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PidMatrices {
    /// State matrix, row-major.
    pub a: [[f64; 3]; 3],
    /// Input matrix (from the error).
    pub b: [f64; 3],
    /// Output matrix.
    pub c: [f64; 3],
    /// Feedthrough.
    pub d: f64,
}

impl Pid {
    /// Creates the controller at rest. Non-finite parameters, and negative ones where that is not
    /// allowed, count as 0; a NaN `output_max` gives an output of 0. A tick cannot report errors,
    /// so the configuration checks them.
    pub fn new(gains: PidGains, dt_s: f64) -> Self {
        let keep = match gains.derivative {
            Derivative::Filtered { time_constant_s } if time_constant_s > 0.0 => {
                (-dt_s / time_constant_s).exp()
            }
            _ => 0.0,
        };
        Self { gains, dt_s, keep, integral: 0.0, memory: [0.0; 2] }
    }

    /// Returns the output for the error of this tick.
    ///
    /// # Real Time
    /// Hot. A non-finite error gives an output of 0, flagged, and leaves the state unchanged.
    pub fn step(&mut self, error: f64) -> Bounded {
        if !error.is_finite() {
            return clamp_finite(error, self.gains.output_max);
        }
        let PidGains { kp, ki_per_s, kd_s, output_max, .. } = self.gains;
        let rate = self.differentiate(error);
        let output = clamp_finite(kp * error + self.integral + kd_s * rate, output_max);
        let winds_up = output.saturated && ki_per_s * error * output.value > 0.0;
        if !winds_up {
            self.integral += ki_per_s * self.dt_s * error;
        }
        output
    }

    /// Resets the controller to rest.
    pub fn reset(&mut self) {
        self.integral = 0.0;
        self.memory = [0.0; 2];
    }

    /// Returns the unsaturated controller in state space, for analysis.
    pub fn matrices(&self) -> PidMatrices {
        let PidGains { kp, ki_per_s, kd_s, derivative, .. } = self.gains;
        let slope = kd_s / self.dt_s;
        // States: the integral part of the output, and the states of the derivative.
        let mut a = [[1.0, 0.0, 0.0], [0.0; 3], [0.0; 3]];
        let b_integral = ki_per_s * self.dt_s;
        match derivative {
            Derivative::Filtered { time_constant_s } if time_constant_s > 0.0 => {
                a[1][1] = self.keep;
                let gain = kd_s / time_constant_s;
                let (c, d) = ([1.0, -gain, 0.0], kp + gain);
                PidMatrices { a, b: [b_integral, 1.0 - self.keep, 0.0], c, d }
            }
            Derivative::Difference | Derivative::Filtered { .. } => {
                let (c, d) = ([1.0, -slope, 0.0], kp + slope);
                PidMatrices { a, b: [b_integral, 1.0, 0.0], c, d }
            }
            Derivative::DelayedDifference => {
                a[2][1] = 1.0;
                PidMatrices { a, b: [b_integral, 1.0, 0.0], c: [1.0, slope, -slope], d: kp }
            }
        }
    }

    fn differentiate(&mut self, error: f64) -> f64 {
        let [last, older] = self.memory;
        match self.gains.derivative {
            Derivative::Filtered { time_constant_s } if time_constant_s > 0.0 => {
                self.memory[0] = self.keep * last + (1.0 - self.keep) * error;
                (error - last) / time_constant_s
            }
            Derivative::Difference | Derivative::Filtered { .. } => {
                self.memory[0] = error;
                (error - last) / self.dt_s
            }
            Derivative::DelayedDifference => {
                self.memory = [error, last];
                (last - older) / self.dt_s
            }
        }
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::float_cmp,
    reason = "tests are cold, and exact where exactness is promised"
)]
mod tests {
    use super::*;

    fn gains(derivative: Derivative) -> PidGains {
        PidGains { kp: 2.0, ki_per_s: 10.0, kd_s: 0.5, derivative, output_max: f64::INFINITY }
    }

    #[test]
    fn hand_computed_outputs() {
        let mut pid = Pid::new(gains(Derivative::Difference), 0.1);
        // 2*1 + 0.5*1/0.1; then 2*1 + 10*0.1*1; then 2*3 + 2 + 0.5*2/0.1.
        let outputs = [1.0, 1.0, 3.0].map(|error| pid.step(error).value);
        assert_eq!(outputs, [7.0, 3.0, 18.0]);
        let mut late = Pid::new(gains(Derivative::DelayedDifference), 0.1);
        let outputs = [1.0, 1.0, 3.0].map(|error| late.step(error).value);
        assert_eq!(outputs, [2.0, 8.0, 8.0]);
    }

    #[test]
    fn the_filtered_derivative_of_a_held_step_decays_exponentially() {
        let filtered = Derivative::Filtered { time_constant_s: 0.01 };
        let only = PidGains { kp: 0.0, ki_per_s: 0.0, kd_s: 1.0, ..gains(filtered) };
        let mut pid = Pid::new(only, 0.002);
        for k in 0..20 {
            let wanted = 100.0 * (-0.2 * f64::from(k)).exp();
            assert!((pid.step(1.0).value - wanted).abs() < 1e-10 * 100.0);
        }
    }

    #[test]
    fn matrices_and_steps_agree() {
        for derivative in [
            Derivative::Difference,
            Derivative::DelayedDifference,
            Derivative::Filtered { time_constant_s: 0.03 },
        ] {
            let mut pid = Pid::new(gains(derivative), 0.01);
            let PidMatrices { a, b, c, d } = pid.matrices();
            let mut x = [0.0; 3];
            for k in 0..50 {
                let error = (0.37 * f64::from(k)).sin();
                let wanted = c.iter().zip(x).map(|(c, x)| c * x).sum::<f64>() + d * error;
                assert!((pid.step(error).value - wanted).abs() < 1e-12);
                x = std::array::from_fn(|row| {
                    a[row].iter().zip(x).map(|(a, x)| a * x).sum::<f64>() + b[row] * error
                });
            }
        }
    }

    #[test]
    fn it_does_not_wind_up_and_comes_off_the_limit_at_once() {
        let limited = PidGains { output_max: 1.0, kd_s: 0.0, ..gains(Derivative::Difference) };
        let mut pid = Pid::new(limited, 0.1);
        for _ in 0..1000 {
            assert_eq!(pid.step(1.0).value, 1.0);
        }
        assert!(pid.step(-0.2).value < 1.0);
    }

    #[test]
    fn what_is_not_finite_is_flagged_and_forgotten() {
        let mut pid = Pid::new(gains(Derivative::Difference), 0.1);
        pid.step(1.0);
        let before = pid;
        let bad = pid.step(f64::NAN);
        assert!(!bad.finite && bad.value == 0.0 && pid == before);
        pid.reset();
        assert_eq!(pid.step(1.0).value, 7.0);
    }
}

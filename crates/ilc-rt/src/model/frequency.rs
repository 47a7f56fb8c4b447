//! Frequency response and static gain of a model.

use nalgebra::{Complex, DMatrix};

use super::{ModelError, StateSpace};

/// Magnitude and phase of one channel (Bode plot).
#[derive(Debug, Clone, PartialEq)]
pub struct Bode {
    /// Absolute value at each frequency.
    pub magnitude: Vec<f64>,
    /// Unwrapped phase at each frequency.
    pub phase_rad: Vec<f64>,
}

impl StateSpace {
    /// Returns the frequency response.
    ///
    /// `G(w) = C (q I - A)^-1 B + D`, `q = j w` (continuous) or `exp(j w T)` (discrete)
    ///
    /// # Shapes
    /// - one matrix (`n_outputs`, `n_inputs`) for each frequency
    /// # Units
    /// - `w_rad_s` in rad/s
    /// # Errors
    /// - [`ModelError::NotFinite`] for a NaN or infinite frequency.
    /// - [`ModelError::Numerics`] at a frequency that is a pole.
    pub fn frequency_response(
        &self,
        w_rad_s: &[f64],
    ) -> Result<Vec<DMatrix<Complex<f64>>>, ModelError> {
        let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
        let (a, b, c, d) = (complex(&self.a), complex(&self.b), complex(&self.c), complex(&self.d));
        let mut response = Vec::with_capacity(w_rad_s.len());
        for (col, &w) in w_rad_s.iter().enumerate() {
            crate::interrupt::point();
            if !w.is_finite() {
                return Err(ModelError::NotFinite { what: "w_rad_s", row: 0, col, value: w });
            }
            let q = match self.dt_s {
                None => Complex::new(0.0, w),
                Some(dt_s) => Complex::new(0.0, w * dt_s).exp(),
            };
            let n = self.n_states();
            if n == 0 {
                response.push(d.clone());
                continue;
            }
            let mut resolvent = -&a;
            for i in 0..n {
                resolvent[(i, i)] += q;
            }
            match resolvent.lu().solve(&b).map(|states| &c * states + &d) {
                Some(found) if is_finite(&found) => response.push(found),
                // A pole, unless it is uncontrollable or unobservable.
                _ => response.push(self.without_hidden(w)?),
            }
        }
        Ok(response)
    }

    /// Returns the response at a frequency where `q I - A` is singular: that of the minimal
    /// realisation.
    fn without_hidden(&self, w: f64) -> Result<DMatrix<Complex<f64>>, ModelError> {
        let is_a_pole = ModelError::Numerics {
            what: "the frequency response",
            reason: "a frequency is a pole of the model",
        };
        let minimal = self.minimal()?;
        if minimal.n_states() == self.n_states() {
            return Err(is_a_pole);
        }
        minimal.frequency_response(&[w])?.pop().ok_or(is_a_pole)
    }

    /// Returns magnitude and phase of the channel from one input to one output.
    ///
    /// # Units
    /// - `w_rad_s` in rad/s; unwrapped phase in rad
    /// # Errors
    /// - as [`StateSpace::frequency_response`], and [`ModelError::Parameter`] for a channel that
    ///   does not exist.
    pub fn bode(&self, w_rad_s: &[f64], output: usize, input: usize) -> Result<Bode, ModelError> {
        for (what, value, count) in
            [("output", output, self.n_outputs()), ("input", input, self.n_inputs())]
        {
            if value >= count {
                return Err(ModelError::Parameter {
                    what,
                    value: value as f64,
                    allowed: "it must be below the number of channels, counted from 0",
                });
            }
        }
        let response = self.frequency_response(w_rad_s)?;
        let mut phase_rad: Vec<f64> = response.iter().map(|g| g[(output, input)].arg()).collect();
        unwrap_phase(&mut phase_rad);
        Ok(Bode {
            magnitude: response.iter().map(|g| g[(output, input)].norm()).collect(),
            phase_rad,
        })
    }

    /// Returns the static (DC) gain.
    ///
    /// `G(0) = D - C A^-1 B` (continuous), `G(1) = D + C (I - A)^-1 B` (discrete)
    ///
    /// # Shapes
    /// - (`n_outputs`, `n_inputs`)
    /// # Errors
    /// - [`ModelError::Numerics`] if the model has a pole at zero frequency (integrator).
    pub fn dc_gain(&self) -> Result<DMatrix<f64>, ModelError> {
        let n = self.n_states();
        if n == 0 {
            return Ok(self.d.clone());
        }
        let system = match self.dt_s {
            None => -&self.a,
            Some(_) => DMatrix::identity(n, n) - &self.a,
        };
        let size = system.amax();
        let lu = system.full_piv_lu();
        // The last pivot shows how near a pole is to zero frequency.
        if size > 0.0
            && lu.u()[(n - 1, n - 1)].abs() > f64::EPSILON * size
            && let Some(states) = lu.solve(&self.b)
        {
            let gain = &self.d + &self.c * states;
            if gain.iter().all(|value| value.is_finite()) {
                return Ok(gain);
            }
        }
        // An uncontrollable or unobservable state is free to integrate.
        let minimal = self.minimal()?;
        if minimal.n_states() < n {
            return minimal.dc_gain();
        }
        Err(ModelError::Numerics {
            what: "the static gain",
            reason: "the model has a pole at rest: it integrates",
        })
    }
}

fn is_finite(matrix: &DMatrix<Complex<f64>>) -> bool {
    matrix.iter().all(|value| value.re.is_finite() && value.im.is_finite())
}

/// Unwraps a phase in place.
///
/// # Units
/// - `phase_rad` in rad
pub fn unwrap_phase(phase_rad: &mut [f64]) {
    let turn = std::f64::consts::TAU;
    let mut added = 0.0;
    for k in 1..phase_rad.len() {
        let step = phase_rad[k] + added - phase_rad[k - 1];
        added -= turn * (step / turn).round();
        phase_rad[k] += added;
    }
}

#[cfg(test)]
mod tests {
    use super::super::{from_transfer_function, second_order};
    use super::*;

    #[test]
    fn a_lag_falls_to_half_its_power_at_its_corner() {
        let lag = from_transfer_function(&[4.0], &[1.0, 2.0], None).unwrap();
        let g = lag.frequency_response(&[0.0, 2.0]).unwrap();
        assert!((g[0][(0, 0)] - Complex::new(2.0, 0.0)).norm() < 1e-14);
        assert!((g[1][(0, 0)] - Complex::new(1.0, -1.0)).norm() < 1e-14);
        assert!((lag.dc_gain().unwrap()[(0, 0)] - 2.0).abs() < 1e-14);
    }

    #[test]
    fn the_phase_of_a_delay_goes_on_falling() {
        let hold = StateSpace::static_gain(DMatrix::from_element(1, 1, 2.0), Some(0.01)).unwrap();
        let late = hold.delayed(5).unwrap();
        let w: Vec<f64> = (0..300).map(f64::from).collect();
        let bode = late.bode(&w, 0, 0).unwrap();
        for (w, (magnitude, phase)) in w.iter().zip(bode.magnitude.iter().zip(&bode.phase_rad)) {
            assert!((magnitude - 2.0).abs() < 1e-12 && (phase + 0.05 * w).abs() < 1e-10);
        }
    }

    fn gain_of(value: f64) -> StateSpace {
        StateSpace::static_gain(DMatrix::from_element(1, 1, value), Some(1e-3)).unwrap()
    }

    #[test]
    fn states_that_nothing_reaches_or_nothing_sees_do_not_integrate() {
        let one = |value: f64| DMatrix::from_element(1, 1, value);
        // SciPy's realisation of a gain: a state at rest that no input excites.
        for (b, c) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)] {
            for (pole, dt_s) in [(0.0, None), (1.0, Some(0.01))] {
                let gain = StateSpace::new(one(pole), one(b), one(c), one(2.0), dt_s).unwrap();
                assert!((gain.dc_gain().unwrap()[(0, 0)] - 2.0).abs() < 1e-15, "{b} {c}");
                let response = gain.frequency_response(&[0.0]).unwrap();
                assert!((response[0][(0, 0)] - Complex::new(2.0, 0.0)).norm() < 1e-15);
            }
        }
        // Appended to an axis with a static gain.
        let lag = from_transfer_function(&[0.5], &[1.0, -0.5], Some(1e-3)).unwrap();
        let hidden = StateSpace::discrete(one(1.0), one(0.0), one(1.0), one(3.0), 1e-3).unwrap();
        let both = lag.append(&hidden).unwrap().dc_gain().unwrap();
        assert!((both - DMatrix::from_diagonal(&nalgebra::dvector![1.0, 3.0])).amax() < 1e-12);
        // Deadbeat: all poles at the origin.
        assert!((gain_of(3.0).delayed(4).unwrap().dc_gain().unwrap()[(0, 0)] - 3.0).abs() < 1e-15);
    }

    #[test]
    fn poles_on_the_axis_are_refused_by_name() {
        let integrator = from_transfer_function(&[1.0], &[1.0, 0.0], None).unwrap();
        assert!(integrator.dc_gain().unwrap_err().to_string().contains("integrates"));
        assert!(integrator.frequency_response(&[0.0]).is_err());
        assert!(integrator.frequency_response(&[f64::NAN]).is_err());
        let gain = StateSpace::static_gain(DMatrix::from_element(1, 1, 2.0), None).unwrap();
        assert!((gain.dc_gain().unwrap()[(0, 0)] - 2.0).abs() < 1e-15);
        assert!((gain.frequency_response(&[1.0]).unwrap()[0][(0, 0)].re - 2.0).abs() < 1e-15);
        // A double integrator, one behind a gain of two axes, and an almost-integrator.
        let double = from_transfer_function(&[1.0], &[1.0, -2.0, 1.0], Some(1e-3)).unwrap();
        assert!(
            double.dc_gain().is_err() && double.append(&gain_of(2.0)).unwrap().dc_gain().is_err()
        );
        let axis = second_order(10.0, 0.5).unwrap();
        assert!(axis.bode(&[1.0], 1, 0).is_err() && axis.bode(&[1.0], 0, 1).is_err());
        assert!((axis.dc_gain().unwrap()[(0, 0)] - 1.0).abs() < 1e-14);
    }
}

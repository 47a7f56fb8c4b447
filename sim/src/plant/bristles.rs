//! LuGre friction: presliding displacement, hysteresis and stick-slip from the deflection of bristles.
//! For the axis of the gantry.
//!
//! `ż = v − σ0 |v| z / g(v)`, `F = σ0 z + σ1 ż`, with the Stribeck curve `g`.
//!
//! Source: C. Canudas de Wit et al., "A new model for control of systems with friction", IEEE
//! Transactions on Automatic Control 40 (1995), equations 1 to 4.

use super::exact_step::{ExactStep, State};
use super::friction::Friction;

/// Bristles with their mean deflection.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_field_names, reason = "each ends in its unit")]
pub(super) struct Bristles {
    stiffness_n_m: f64,
    damping_n_s_m: f64,
    deflection_m: f64,
}

impl Bristles {
    pub(super) fn new(stiffness_n_m: f64, damping_n_s_m: f64) -> Self {
        Self { stiffness_n_m, damping_n_s_m, deflection_m: 0.0 }
    }

    /// Relaxes the bristles, as on an axis that its brake holds.
    pub(super) fn relax(&mut self) {
        self.deflection_m = 0.0;
    }

    /// Returns the state after a step under a force; `friction` is the Stribeck curve.
    ///
    /// The deflection is implicit in its own decay and so stays within `g/σ0` at any velocity.
    pub(super) fn step(
        &mut self,
        friction: &Friction,
        step: &ExactStep,
        z: &State,
        force_n: f64,
    ) -> State {
        let (velocity_m_s, curve_n) = (z[1], friction.sliding_n(z[1]));
        let before_m = self.deflection_m;
        self.deflection_m = if curve_n > 0.0 {
            let decay = step.dt_s * self.stiffness_n_m * velocity_m_s.abs() / curve_n;
            (before_m + velocity_m_s * step.dt_s) / (1.0 + decay)
        } else {
            0.0
        };
        let rate_m_s = (self.deflection_m - before_m) / step.dt_s;
        let friction_n = self.stiffness_n_m * self.deflection_m + self.damping_n_s_m * rate_m_s;
        step.free(z, force_n - friction_n)
    }
}

#[cfg(test)]
mod tests {
    use super::super::exact_step::Mechanics;
    use super::*;

    const DT_S: f64 = 125e-6;
    const FRICTION: Friction = Friction { coulomb_n: 15.0, static_n: 25.0, stribeck_m_s: 0.002 };

    fn mass() -> ExactStep {
        let alone =
            Mechanics { carriage_kg: 20.0, mode_kg: 0.0, mode_rad_s: 1.0, mode_damping: 0.0 };
        ExactStep::new(&alone, DT_S)
    }

    fn run(force_n: impl Fn(usize) -> f64, n: usize) -> Vec<State> {
        let (step, mut bristles) = (mass(), Bristles::new(1e6, 4e3));
        let mut z = [0.0; 4];
        let states = (0..n).map(|k| {
            z = bristles.step(&FRICTION, &step, &z, force_n(k));
            z
        });
        states.collect()
    }

    #[test]
    fn below_static_friction_it_is_a_spring_that_yields() {
        // Slowly loaded, F = s0 z and dz/dx = 1 - F/g: x = -(g/s0) ln(1 - F/g) up, and on the way back
        // dz/dx = 1 + F/g.
        let ramp_n = |k: usize| 10.0 - (k as f64 / 4000.0 - 10.0).abs();
        let states = run(ramp_n, 80_000);
        let up_m = -25e-6 * (1.0_f64 - 0.4).ln();
        let down_m = up_m - 25e-6 * (1.0_f64 + 0.4).ln();
        assert!((states[39_999][0] / up_m - 1.0).abs() < 0.01, "{}", states[39_999][0]);
        assert!((states[79_999][0] / down_m - 1.0).abs() < 0.02, "{}", states[79_999][0]);
    }

    #[test]
    fn in_steady_sliding_it_is_the_stribeck_curve() {
        // 20 N above the 15 N of Coulomb friction accelerate 20 kg at 1 m/s^2.
        let states = run(|_| 35.0, 16_000);
        let acceleration = (states[15_999][1] - states[11_999][1]) / (4000.0 * DT_S);
        assert!((acceleration - 1.0).abs() < 1e-3, "{acceleration}");
    }

    #[test]
    fn the_break_away_force_is_the_static_friction() {
        // A force that rises by 1 N/s: no sliding below 25 N, sliding soon above.
        let states = run(|k| k as f64 * DT_S, 8000 * 26);
        assert!(states[8000 * 24][1].abs() < 1e-4);
        assert!(states[8000 * 26 - 1][1] > 0.05, "{}", states[8000 * 26 - 1][1]);
    }
}

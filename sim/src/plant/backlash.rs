//! Backlash between a carriage and the mass it carries. For the axis of the gantry.

use super::exact_step::{ExactStep, Mechanics, State};

/// A spring that acts only beyond a play: with deflection `q`, `F = k (q − clamp(q, ±b/2)) + c q̇` in
/// contact, 0 between.
///
/// Each regime is linear and stepped exactly; a change of regime takes effect with the next step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Backlash {
    half_m: f64,
    apart: ExactStep,
}

impl Backlash {
    pub(super) fn new(backlash_m: f64, mechanics: &Mechanics, dt_s: f64) -> Self {
        let apart = Mechanics { mode_rad_s: 0.0, ..*mechanics };
        Self { half_m: 0.5 * backlash_m, apart: ExactStep::new(&apart, dt_s) }
    }

    /// Steps with the dynamics of the present regime; `in_contact` are those without play.
    pub(super) fn step(
        &self,
        in_contact: &ExactStep,
        z: &State,
        step: impl FnOnce(&ExactStep, &State) -> State,
    ) -> State {
        let play_m = z[2].clamp(-self.half_m, self.half_m);
        if z[2].abs() < self.half_m {
            return step(&self.apart, z);
        }
        let mut next = step(in_contact, &[z[0], z[1], z[2] - play_m, z[3]]);
        next[2] += play_m;
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 125e-6;
    const PAIR: Mechanics =
        Mechanics { carriage_kg: 3.0, mode_kg: 1.0, mode_rad_s: 200.0, mode_damping: 0.0 };

    /// Steps freely and returns the states.
    fn freely(backlash_m: f64, mut z: State, n: usize) -> Vec<State> {
        let (whole, play) = (ExactStep::new(&PAIR, DT_S), Backlash::new(backlash_m, &PAIR, DT_S));
        let steps = (0..n).map(|_| {
            z = play.step(&whole, &z, |step, z| step.free(z, 0.0));
            z
        });
        steps.collect()
    }

    #[test]
    fn in_the_gap_both_masses_coast() {
        for z in freely(0.01, [0.0, 0.2, 0.0, -0.1], 200) {
            assert!((z[1] - 0.2).abs() < 1e-12 && (z[3] + 0.1).abs() < 1e-12);
        }
    }

    #[test]
    fn without_play_it_is_the_plain_spring() {
        let plain = ExactStep::new(&PAIR, DT_S);
        let mut z = [0.0, 0.1, 2e-4, 0.0];
        for stepped in freely(0.0, z, 400) {
            z = plain.free(&z, 0.0);
            assert!(z.iter().zip(stepped).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    // From wall to wall at relative velocity w the load coasts for b/w and is thrown back within
    // half a period of the contact, pi/w_c with w_c^2 = k (1/m_c + 1/m_f).
    #[test]
    fn it_bounces_with_the_period_of_play_and_contact() {
        let (backlash_m, relative_m_s) = (1e-3, 0.05);
        let contact_rad_s = 200.0 * (1.0_f64 + 1.0 / 3.0).sqrt();
        let half_s = backlash_m / relative_m_s + std::f64::consts::PI / contact_rad_s;
        let states = freely(backlash_m, [0.0, 0.0, 0.0, relative_m_s], 4000);
        let turns: Vec<usize> =
            (1..states.len()).filter(|&k| states[k][3] * states[k - 1][3] < 0.0).collect();
        assert!(turns.len() > 6, "{turns:?}");
        for pair in turns.windows(2) {
            let between_s = (pair[1] - pair[0]) as f64 * DT_S;
            assert!((between_s / half_s - 1.0).abs() < 0.02, "{between_s} {half_s}");
        }
        let momentum = |z: &State| 4.0 * z[1] + z[3];
        assert!((momentum(states.last().unwrap()) - relative_m_s).abs() < 1e-9);
    }
}

//! Application of the learned input to the axes: bounded, rate-limited (bumpless), and faded out
//! after a run.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use crate::control::{SlewLimiter, clamp_finite};
use crate::interpolate::MAX_AXES;

/// The learned input of all axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct LearnedInput {
    max: [f64; MAX_AXES],
    slew: [SlewLimiter; MAX_AXES],
    value: [f64; MAX_AXES],
    fade_from: [f64; MAX_AXES],
    fade_ticks: u32,
    fade_tick: u32,
}

impl LearnedInput {
    /// Creates it with bound `max`, rate limit `step_max` per tick and its bound `bend_max` from tick to
    /// tick, and a fade-out of `fade_ticks`.
    pub(super) fn new(
        max: [f64; MAX_AXES],
        step_max: [f64; MAX_AXES],
        bend_max: [f64; MAX_AXES],
        fade_ticks: u32,
    ) -> Self {
        Self {
            max,
            slew: std::array::from_fn(|axis| {
                SlewLimiter::new(step_max[axis]).bending(bend_max[axis], max[axis])
            }),
            value: [0.0; MAX_AXES],
            fade_from: [0.0; MAX_AXES],
            fade_ticks: fade_ticks.max(1),
            fade_tick: fade_ticks.max(1),
        }
    }

    /// Returns the input of this tick.
    pub(super) fn value(&self) -> [f64; MAX_AXES] {
        self.value
    }

    /// Takes one row of the table, bounded.
    ///
    /// # Errors
    /// The axis with a non-finite entry; its input stays unchanged.
    pub(super) fn follow(&mut self, row: &[f64]) -> Result<(), usize> {
        let mut bad = Ok(());
        for (axis, &wanted) in row.iter().enumerate().take(MAX_AXES) {
            let bounded = clamp_finite(wanted, self.max[axis]);
            if bounded.finite {
                self.value[axis] = self.slew[axis].next(bounded.value);
            } else {
                bad = Err(axis);
            }
        }
        self.fade_from = self.value;
        self.fade_tick = 0;
        bad
    }

    /// Fades the input out, along half a cosine from its value at the end of the run.
    pub(super) fn fade(&mut self) {
        if self.fade_tick >= self.fade_ticks {
            return;
        }
        self.fade_tick += 1;
        let share = f64::from(self.fade_tick) / f64::from(self.fade_ticks);
        let weight =
            if share >= 1.0 { 0.0 } else { 0.5 * (1.0 + (std::f64::consts::PI * share).cos()) };
        for axis in 0..MAX_AXES {
            self.value[axis] = self.fade_from[axis] * weight;
            self.slew[axis].reset(self.value[axis]);
        }
    }

    /// Drops the input at once, because it has become part of the set point, but for the axes where
    /// it `stays` and is still to be faded out.
    pub(super) fn absorb(&mut self, stays: &[bool; MAX_AXES]) {
        for (axis, stays) in stays.iter().enumerate() {
            if !stays {
                self.value[axis] = 0.0;
                self.fade_from[axis] = 0.0;
            }
        }
        if !stays.contains(&true) {
            self.fade_tick = self.fade_ticks;
        }
    }

    /// Returns whether no input is left.
    pub(super) fn faded(&self) -> bool {
        self.fade_tick >= self.fade_ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input() -> LearnedInput {
        LearnedInput::new([1.0; MAX_AXES], [0.25; MAX_AXES], [f64::INFINITY; MAX_AXES], 10)
    }

    #[test]
    fn a_wild_table_is_bounded_and_never_steps() {
        let mut input = input();
        let mut last = 0.0;
        for wanted in [5.0, 5.0, -5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0] {
            assert_eq!(input.follow(&[wanted, 0.0]), Ok(()));
            assert!((input.value()[0] - last).abs() <= 0.25 + 1e-15 && input.value()[0] <= 1.0);
            last = input.value()[0];
        }
        assert_eq!(input.follow(&[0.0, f64::NAN]), Err(1));
    }

    #[test]
    fn what_became_part_of_a_command_is_dropped_and_an_offset_fades() {
        let mut input = input();
        assert_eq!(input.follow(&[0.2, 0.2]), Ok(()));
        let mut stays = [false; MAX_AXES];
        stays[1] = true;
        input.absorb(&stays);
        assert_eq!(
            input.value()[..2].iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
            [0.0_f64, 0.2].map(f64::to_bits)
        );
        assert!(!input.faded());
        for _ in 0..10 {
            input.fade();
        }
        assert!(input.faded() && input.value()[1] == 0.0);
        assert_eq!(input.follow(&[0.2, 0.2]), Ok(()));
        input.absorb(&[false; MAX_AXES]);
        assert!(input.faded() && input.value()[1] == 0.0);
    }

    #[test]
    fn it_fades_to_exactly_zero() {
        let mut input = input();
        assert_eq!(input.follow(&[0.2]), Ok(()));
        let mut last = 0.2;
        for _ in 0..10 {
            assert!(!input.faded());
            input.fade();
            assert!(input.value()[0] < last);
            last = input.value()[0];
        }
        assert!(input.faded() && last == 0.0);
    }
}

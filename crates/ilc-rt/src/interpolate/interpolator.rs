//! The set points of a run, one a tick.

use super::blend::Blend;
use super::exact_stop::ExactStop;
use super::setpoint::Setpoint;
use super::table::Table;

/// How the corners of this run are taken.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    ExactStop(ExactStop),
    Blend(Blend),
    Hold(Setpoint),
    Table(Table),
}

/// A planned run: rest, path, rest.
#[derive(Clone, Debug)]
pub struct Interpolator {
    motion: Motion,
    n_axes: usize,
    cycle_s: f64,
    n_samples: usize,
    tick: usize,
}

impl Interpolator {
    /// Starts a planned motion at its first tick.
    pub(crate) fn new(motion: Motion, n_axes: usize, cycle_s: f64, n_samples: usize) -> Self {
        Self { motion, n_axes, cycle_s, n_samples, tick: 0 }
    }

    /// Goes back to the first set point.
    ///
    /// # Real Time
    /// Hot; a blended path refills its filters, in the order of the windows.
    pub fn restart(&mut self) {
        self.tick = 0;
        match &mut self.motion {
            Motion::ExactStop(moves) => moves.restart(),
            Motion::Blend(blend) => blend.restart(),
            Motion::Hold(_) | Motion::Table(_) => {}
        }
    }

    /// The set point of the next tick; the first call gives the start, and the last set point, which
    /// says `done`, is repeated for ever.
    ///
    /// # Real Time
    /// Hot, allocates nothing.
    #[expect(
        clippy::should_implement_trait,
        reason = "the set points do not end: the last one is held"
    )]
    pub fn next(&mut self) -> Setpoint {
        let done = self.tick + 1 >= self.n_samples;
        let setpoint = match &mut self.motion {
            Motion::ExactStop(moves) => moves.at(self.tick as f64 * self.cycle_s),
            Motion::Blend(blend) => blend.next(),
            Motion::Hold(setpoint) => *setpoint,
            Motion::Table(table) => table.at(self.tick),
        };
        if !done {
            self.tick += 1;
        }
        Setpoint { done, ..setpoint }
    }

    /// Number of samples of the run, the first and the last included.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Number of axes.
    pub fn n_axes(&self) -> usize {
        self.n_axes
    }

    /// The servo cycle for which the run was planned.
    pub fn cycle_s(&self) -> f64 {
        self.cycle_s
    }

    /// All set points of the run, by running a copy: the same numbers bit by bit as in the loop.
    ///
    /// # Shapes
    /// - returns `n_samples * n_axes`, time first, in metres
    /// # Real Time
    /// Cold: allocates.
    #[expect(clippy::disallowed_methods, reason = "cold: laid out once a campaign")]
    pub fn reference(&self) -> Vec<f64> {
        let mut copy = self.clone();
        copy.restart();
        let mut reference_m = Vec::with_capacity(self.n_samples * self.n_axes);
        for _ in 0..self.n_samples {
            let setpoint = copy.next();
            reference_m.extend_from_slice(&setpoint.position_m[..self.n_axes]);
        }
        reference_m
    }
}

//! The set points of a run, one per tick.

use super::blend::Blend;
use super::exact_stop::ExactStop;
use super::setpoint::Setpoint;
use super::table::Table;

/// Planned motion of a run, by its treatment of corners.
#[derive(Clone, Debug)]
pub(crate) enum Motion {
    ExactStop(ExactStop),
    Blend(Blend),
    Hold(Setpoint),
    Table(Table),
}

/// A planned run: dwell, path, dwell.
#[derive(Clone, Debug)]
pub struct Interpolator {
    motion: Motion,
    n_axes: usize,
    cycle_s: f64,
    n_samples: usize,
    tick: usize,
}

impl Interpolator {
    /// Creates the interpolator at its first tick.
    pub(crate) fn new(motion: Motion, n_axes: usize, cycle_s: f64, n_samples: usize) -> Self {
        Self { motion, n_axes, cycle_s, n_samples, tick: 0 }
    }

    /// Restarts at the first set point.
    ///
    /// # Real Time
    /// Hot; a blended path refills its filters, at a cost proportional to the windows.
    pub fn restart(&mut self) {
        self.tick = 0;
        match &mut self.motion {
            Motion::ExactStop(moves) => moves.restart(),
            Motion::Blend(blend) => blend.restart(),
            Motion::Hold(_) | Motion::Table(_) => {}
        }
    }

    /// Returns the set point of the next tick; the first call returns the start. The last set
    /// point, marked `done`, is repeated indefinitely.
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

    /// Returns the set point between two ticks of a path that is known at any time, not earlier than that of
    /// the previous call; `None` for a path that is known at its ticks only.
    pub(crate) fn between(&mut self, tick: usize, fraction: f64) -> Option<Setpoint> {
        match &mut self.motion {
            Motion::ExactStop(moves) => {
                Some(moves.between((tick as f64 + fraction) * self.cycle_s))
            }
            Motion::Hold(setpoint) => Some(*setpoint),
            Motion::Blend(_) | Motion::Table(_) => None,
        }
    }

    /// Returns the number of samples of the run, first and last included.
    pub fn n_samples(&self) -> usize {
        self.n_samples
    }

    /// Returns the number of axes.
    pub fn n_axes(&self) -> usize {
        self.n_axes
    }

    /// Returns the servo cycle that the run was planned for.
    pub fn cycle_s(&self) -> f64 {
        self.cycle_s
    }

    /// Returns all set points of the run, from a copy: bit-identical to those in the loop.
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

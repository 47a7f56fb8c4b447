//! Playback of a run at a scale of time: the path stays, its speed changes.
//!
//! At scale 1 every set point is bit-identical to that of the run. Between two ticks of the run a
//! path with exact stops is evaluated at its own time; the others are interpolated by cubics through
//! their neighbouring set points and velocities.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::MAX_AXES;
use super::interpolator::Interpolator;
use super::setpoint::Setpoint;

/// A run with its place on the path: `tick + fraction` of its own ticks.
#[derive(Clone, Debug)]
pub struct Playback {
    run: Interpolator,
    /// Set points of `tick` and of the one after it.
    around: [Setpoint; 2],
    tick: usize,
    fraction: f64,
}

impl Playback {
    /// Creates the playback at the start of a run.
    pub fn new(run: Interpolator) -> Self {
        let nothing = Setpoint::at_rest([0.0; MAX_AXES]);
        let mut playback = Self { run, around: [nothing; 2], tick: 0, fraction: 0.0 };
        playback.restart();
        playback
    }

    /// Restarts at the first set point.
    ///
    /// # Real Time
    /// As [`Interpolator::restart`].
    pub fn restart(&mut self) {
        self.run.restart();
        (self.tick, self.fraction) = (0, 0.0);
        self.around = [self.run.next(), self.run.next()];
    }

    /// Returns the number of samples of the run.
    pub fn n_samples(&self) -> usize {
        self.run.n_samples()
    }

    /// Returns the sample of the run that the last set point belongs to, and how far it is on its way to
    /// the next one, 0 to 1.
    pub fn place(&self) -> (usize, f64) {
        (self.tick, self.fraction)
    }

    /// Goes on by `scale` of a tick, 0 to 1; the place stays within the run.
    ///
    /// # Real Time
    /// Hot, allocates nothing.
    pub fn advance(&mut self, scale: f64) {
        if self.tick + 1 >= self.run.n_samples() {
            return;
        }
        self.fraction += scale;
        if self.fraction >= 1.0 {
            self.fraction -= 1.0;
            self.tick += 1;
            self.around = [self.around[1], self.run.next()];
        }
        if self.tick + 1 >= self.run.n_samples() {
            self.fraction = 0.0;
        }
    }

    /// Returns the set point at this place, for a speed of `scale` along the path.
    pub fn setpoint(&mut self, scale: f64) -> Setpoint {
        let [from, to] = self.around;
        let mut now = if self.fraction <= 0.0 {
            from
        } else {
            let at = self.run.between(self.tick, self.fraction);
            at.unwrap_or_else(|| cubic(&from, &to, self.fraction, self.run.cycle_s()))
        };
        now.done = from.done;
        // A multiplication by 1 changes no bit.
        now.velocity_m_s = now.velocity_m_s.map(|velocity_m_s| velocity_m_s * scale);
        now
    }

    /// Returns the largest velocity of each axis on the path at scale 1. Cold.
    pub fn peak_velocity_m_s(&self) -> [f64; MAX_AXES] {
        let mut copy = self.run.clone();
        copy.restart();
        let mut peak_m_s = [0.0_f64; MAX_AXES];
        for _ in 0..copy.n_samples() {
            let now = copy.next();
            for (peak_m_s, velocity_m_s) in peak_m_s.iter_mut().zip(now.velocity_m_s) {
                *peak_m_s = peak_m_s.max(velocity_m_s.abs());
            }
        }
        peak_m_s
    }
}

/// Returns the cubic through two set points with their velocities, at a share of the way.
fn cubic(from: &Setpoint, to: &Setpoint, share: f64, dt_s: f64) -> Setpoint {
    let mut now = *from;
    let (t, t2) = (share, share * share);
    for axis in 0..MAX_AXES {
        let way_m = to.position_m[axis] - from.position_m[axis];
        let (leave_m, reach_m) = (from.velocity_m_s[axis] * dt_s, to.velocity_m_s[axis] * dt_s);
        // p = p0 + leave t + (3 way - 2 leave - reach) t² + (leave + reach - 2 way) t³
        let square = 3.0 * way_m - 2.0 * leave_m - reach_m;
        let cube = leave_m + reach_m - 2.0 * way_m;
        now.position_m[axis] = from.position_m[axis] + t * leave_m + t2 * (square + t * cube);
        now.velocity_m_s[axis] = (leave_m + 2.0 * t * square + 3.0 * t2 * cube) / dt_s;
    }
    now
}

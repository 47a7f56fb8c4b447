//! Tick of a precomputed motion: one row of set points per tick.

use super::MAX_AXES;
use super::setpoint::Setpoint;

/// Positions and velocities, with a dwell before them; the last row is held.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    rows: Box<[[[f64; MAX_AXES]; 2]]>,
    rest_ticks: usize,
}

impl Table {
    /// Copies positions and velocities, one row of `n_axes` per tick. Cold.
    pub(crate) fn new(
        position_m: &[f64],
        velocity_m_s: &[f64],
        n_axes: usize,
        rest_ticks: usize,
    ) -> Self {
        let n_axes = n_axes.clamp(1, MAX_AXES);
        let row = |(position_m, velocity_m_s): (&[f64], &[f64])| {
            let mut row = [[0.0; MAX_AXES]; 2];
            row[0][..position_m.len()].copy_from_slice(position_m);
            row[1][..velocity_m_s.len()].copy_from_slice(velocity_m_s);
            row
        };
        let rows = position_m.chunks_exact(n_axes).zip(velocity_m_s.chunks_exact(n_axes));
        Self { rows: rows.map(row).collect(), rest_ticks }
    }

    /// Returns the tick from which the motion is at rest at its end.
    pub(crate) fn rest_tick(&self) -> usize {
        self.rest_ticks + self.rows.len().saturating_sub(1)
    }

    /// Returns the set point of a tick.
    pub(crate) fn at(&self, tick: usize) -> Setpoint {
        let last = self.rows.len().saturating_sub(1);
        let Some([position_m, velocity_m_s]) =
            self.rows.get(tick.saturating_sub(self.rest_ticks).min(last))
        else {
            return Setpoint::at_rest([0.0; MAX_AXES]);
        };
        let resting = tick < self.rest_ticks || tick >= self.rest_tick();
        let velocity_m_s = if resting { [0.0; MAX_AXES] } else { *velocity_m_s };
        Setpoint { position_m: *position_m, velocity_m_s, done: false }
    }
}

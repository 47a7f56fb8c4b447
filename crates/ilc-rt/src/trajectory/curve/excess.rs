//! Excesses of a planned run over its limits, tick by tick, and the slow-down that removes them.

use std::collections::BTreeMap;

use super::frame::{Frame, norm};
use super::speed::RunLimits;
use super::time_law::Tick;
use crate::interpolate::{AxisLimits, Quantity};
use crate::trajectory::motion::SampledMotion;
use crate::trajectory::verify::Verification;

/// Shares of the limits for the search, on frames between the places, and for the proof, on exact ones;
/// the rest is for what lies between two ticks.
pub(super) const SOUGHT: f64 = 1.0 - 2e-3;
pub(super) const KEPT: f64 = 1.0 - 5e-4;

/// A value beyond its limit, and the factor on the speed that removes the excess.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excess {
    pub(super) slower: f64,
    pub(super) reached: f64,
    pub(super) limit: f64,
    pub(super) axis: usize,
    pub(super) quantity: Quantity,
}

/// Excesses by tick, in order: few, even in a run of millions of ticks.
pub(super) type Excesses = BTreeMap<usize, Excess>;

/// Returns the worst violations of a share of the limits; the frames are those of the ticks.
pub(super) fn of_ticks(
    ticks: &[Tick],
    frames: impl Iterator<Item = Frame>,
    limits: &RunLimits,
    kept: f64,
) -> Excesses {
    let mut before_j = 0.0;
    let quantities = [Quantity::Velocity, Quantity::Acceleration, Quantity::Jerk];
    ticks
        .iter()
        .zip(frames)
        .enumerate()
        .filter_map(|(row, (tick, frame))| {
            let mut worst: Option<Excess> = None;
            let mut note = |reached: f64, limit: f64, order: usize, axis: usize| {
                let ratio = reached / limit;
                let slower = (kept / ratio).powf(1.0 / (order + 1) as f64);
                if ratio > kept && worst.is_none_or(|worst| slower < worst.slower) {
                    let quantity = quantities[order];
                    worst = Some(Excess { slower, reached, limit, axis, quantity });
                }
            };
            for (axis, limit) in limits.axes.iter().enumerate() {
                for jerk in [before_j, tick.j] {
                    let values = frame.axis(axis, tick.v, tick.a, jerk);
                    for (order, (_, most)) in limit.named().into_iter().enumerate() {
                        note(values[order].abs(), most, order, axis);
                    }
                }
            }
            let across = tick.v * tick.v * norm(&frame.bend);
            note(across, limits.curvature_acceleration_max_m_s2, 1, 0);
            before_j = tick.j;
            worst.map(|worst| (row, worst))
        })
        .collect()
}

/// Returns the worst violations by the set points, from their differences.
pub(super) fn of_set_points(motion: &SampledMotion, limits: &[AxisLimits]) -> Excesses {
    let mut found = Excesses::new();
    let last = motion.n_samples() - 1;
    let rows = &motion.position_m;
    Verification::of_motion(rows, limits, motion.dt_s).each_excess(rows, |excess| {
        let order = match excess.quantity {
            Quantity::Velocity => 1.0,
            Quantity::Acceleration => 2.0,
            Quantity::Jerk => 3.0,
        };
        let worst = Excess {
            slower: (KEPT * excess.limit / excess.reached.abs()).powf(1.0 / order),
            reached: excess.reached.abs(),
            limit: excess.limit,
            axis: excess.axis,
            quantity: excess.quantity,
        };
        let here = found.entry(excess.row.min(last)).or_insert(worst);
        if worst.slower < here.slower {
            *here = worst;
        }
        true
    });
    found
}

/// Lowers the speed limit around every tick that is too fast.
pub(super) fn slow_down(
    speed: &mut [f64],
    ticks: &[Tick],
    found: &Excesses,
    step_m: f64,
    window: usize,
) {
    let mut factor = vec![1.0_f64; speed.len()];
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "places on the curve"
    )]
    let place = |s_m: f64| ((s_m / step_m).max(0.0) as usize).min(speed.len() - 1);
    for (&k, worst) in found {
        let from = place(ticks[k.saturating_sub(window)].s);
        let to = place(ticks[(k + window).min(ticks.len() - 1)].s + step_m);
        for factor in &mut factor[from..=to] {
            *factor = factor.min(worst.slower);
        }
    }
    for (speed, factor) in speed.iter_mut().zip(factor) {
        // Slightly more than required, as a slower point also needs a steeper approach.
        *speed *= if factor < 1.0 { factor * 0.995 } else { 1.0 };
    }
}

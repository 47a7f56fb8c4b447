//! The two sweeps with gains that vary along the run, several segments in parallel (SIMD).
//!
//! For a constant plant whose weights alone vary, as those of a contour do. The run is cut into
//! [`LANES`] segments. The costate at a cut is a sum over the errors after it, and the state one over
//! the `kappa` before it, whose factors fade: sums as long as double precision tells take the place of
//! the sweeps over the neighbours. Of each sample only `K`, `H^-1` and the weights are kept, side by
//! side for all segments: a quarter of what steps of several samples ([`super::general`]) would read.
//! The segments depend on the gains and the length of the run alone, never on the processor.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::factor::Gains;
use super::fading::{self, Sums};
use super::interleaved::Interleaved;
use super::side_by_side::Rows;
use super::tile::TILE;
use super::varying_step::{Entries, Model, backward, forward, is_apart};
use super::wide::{Instructions, LANES, Wide, Work};
use super::{Channels, Run, Stages, Sweep};

/// Returns the solver for these gains.
///
/// `None` unless they vary while the plant does not, for one of the sizes below, and fade within a
/// segment: the caller then uses [`super::General`], which is as quick.
pub(super) fn varying(
    gains: &Gains,
    stages: &impl Stages,
    channels: &Channels,
    how: Instructions,
) -> Option<Box<dyn Sweep>> {
    if gains.inverse(0).is_none() || gains.n_targets() != gains.n_inputs() {
        return None;
    }
    let is_apart = is_apart(&stages.stage(0));
    macro_rules! choose {
        ($($n:literal $m:literal $apart:literal)*) => {
            match (gains.n_states(), gains.n_inputs(), is_apart) {
                $(($n, $m, $apart) => Box::new(
                    Varying::<$n, $m, $apart>::new(gains, stages, channels, how)?
                ),)*
                _ => return None,
            }
        };
    }
    // Two axes of second order, coupled or not, or with a penalty on the rate; three of them.
    Some(choose!(4 2 true 4 2 false 6 2 false 6 3 true))
}

/// The solver for `N` states, `M` inputs and as many targets.
#[derive(Debug)]
struct Varying<const N: usize, const M: usize, const APART: bool> {
    model: Model<N, M, APART>,
    is_held: bool,
    channels: Channels,
    instructions: Instructions,
    /// Tiles of a segment. The last one may reach beyond the run, where all gains are zero.
    stretch: usize,
    /// The [`Entries`] of each sample of a segment.
    gains: Rows,
    /// Factors of error and input after each segment in the costate at its end.
    after: Sums,
    /// Factors of `kappa` before each segment in the state at its start.
    before: Sums,
    /// `M` rows for each sample of a segment.
    kappa: Rows,
}

impl<const N: usize, const M: usize, const APART: bool> Varying<N, M, APART> {
    fn new(
        gains: &Gains,
        stages: &impl Stages,
        channels: &Channels,
        instructions: Instructions,
    ) -> Option<Self> {
        let n_samples = gains.n_samples();
        let stretch = n_samples.div_ceil(LANES * TILE);
        let length = stretch * TILE;
        let (mut after, mut before) = (Vec::new(), Vec::new());
        for (lane, cut) in (1..LANES).map(|lane| (lane, lane * length)) {
            if cut < n_samples {
                after.push((lane - 1, fading::after::<N>(gains, cut, length)?));
                before.push((lane, fading::before::<N>(gains, cut, length)?));
            }
        }
        let mut stage = stages.stage(0);
        let is_held = gains.sizes().held > 0;
        let count = Entries::<N, M>::count(is_held);
        let mut solver = Self {
            model: Model::new(&stage),
            is_held,
            channels: channels.clone(),
            instructions,
            stretch,
            gains: Rows::new(length * count),
            after: Sums::new(&after, if is_held { 2 * M * N } else { M * N }),
            before: Sums::new(&before, M * N),
            kappa: Rows::new(length * M),
        };
        for k in 0..n_samples {
            stages.weights_into(k, &mut stage);
            let (lane, rows) = (k / length, solver.gains.at_mut(k % length * count));
            let (fore, inverse) = (gains.at(k).fore, gains.inverse(k)?);
            let feedback = (0..M * N).map(|i| fore[i % N * (N + M) + N + i / N]);
            let square = |i: usize| (i / M, i % M);
            let weight = (0..M * M).map(|i| stage.q[square(i)]);
            let held = (0..M * M).map(|i| -stage.s[square(i)]);
            let entries = feedback.chain(inverse.iter().copied()).chain(weight).chain(held);
            for (row, value) in rows[..count].iter_mut().zip(entries) {
                row[lane] = value;
            }
        }
        Some(solver)
    }

    #[inline(always)]
    fn sweep(&mut self, wide: impl Wide, run: &mut Run) {
        let Self { model, is_held, channels, stretch, gains, after, before, kappa, .. } = self;
        let (length, count) = (*stretch * TILE, Entries::<N, M>::count(*is_held));
        let errors = Interleaved::<M>::new(&channels.outputs, &channels.shifts, run.n_outputs);
        let inputs = Interleaved::<M>::new(&channels.inputs, &[], run.n_inputs);
        let starts: [usize; LANES] = std::array::from_fn(|lane| lane * length);
        let zero = wide.row(&[0.0; LANES]);

        let mut costate = [zero; N];
        // The factors of the last segment, which has no next one, are zero.
        let next: [usize; LANES] = std::array::from_fn(|lane| (lane + 1).min(LANES - 1) * length);
        for tile in 0..after.n_samples().div_ceil(TILE) {
            let error = errors.load(wide, run.error, &next, tile);
            let input = if *is_held { inputs.load(wide, run.input, &next, tile) } else { error };
            for s in 0..TILE {
                let factors = after.factors(tile * TILE + s);
                let [of_error, of_input] = [0, M * N].map(|first| factors.get(first..));
                add(wide, &mut costate, of_error, &error[s]);
                add(wide, &mut costate, of_input, &input[s]);
            }
        }
        for tile in (0..*stretch).rev() {
            let error = errors.load(wide, run.error, &starts, tile);
            let input = if *is_held { inputs.load(wide, run.input, &starts, tile) } else { error };
            for s in (0..TILE).rev() {
                let k = tile * TILE + s;
                let Some(entries) = Entries::new(&gains.at(k * count)[..count]) else { return };
                let found = backward(wide, model, entries, &mut costate, &error[s], &input[s]);
                for (row, found) in kappa.at_mut(k * M).iter_mut().zip(found) {
                    *row = wide.values(found);
                }
            }
        }

        let mut state = [zero; N];
        for j in 0..before.n_samples() {
            let kappa: [_; M] = read(wide, kappa.of_lane_before((length - 1 - j) * M));
            add(wide, &mut state, Some(before.factors(j)), &kappa);
        }
        for tile in 0..*stretch {
            let mut changes = [[zero; M]; TILE];
            for (s, change) in changes.iter_mut().enumerate() {
                let k = tile * TILE + s;
                let Some(entries) = Entries::new(&gains.at(k * count)[..count]) else { return };
                let kappa = read(wide, kappa.at(k * M));
                *change = forward(wide, model, entries, &mut state, &kappa);
            }
            inputs.store(wide, run, &starts, tile, changes);
        }
    }
}

/// Loads some rows.
#[inline(always)]
fn read<W: Wide, const M: usize>(wide: W, from: &[[f64; LANES]]) -> [W::Row; M] {
    let mut rows = [wide.row(&[0.0; LANES]); M];
    for (row, values) in rows.iter_mut().zip(from) {
        *row = wide.row(values);
    }
    rows
}

/// Adds multiples of `M` columns, if there are as many.
#[inline(always)]
fn add<W: Wide, const N: usize, const M: usize>(
    wide: W,
    sum: &mut [W::Row; N],
    columns: Option<&[[f64; LANES]]>,
    factors: &[W::Row; M],
) {
    let columns = columns.and_then(|rows| rows.as_chunks::<N>().0.first_chunk::<M>());
    let Some(columns) = columns else { return };
    for (column, factor) in columns.iter().zip(factors) {
        for (sum, entry) in sum.iter_mut().zip(column) {
            *sum = wide.add(*sum, wide.multiply(wide.row(entry), *factor));
        }
    }
}

/// The solver with the run to solve.
struct Solve<'a, 'r, const N: usize, const M: usize, const APART: bool>(
    &'a mut Varying<N, M, APART>,
    &'a mut Run<'r>,
);

impl<const N: usize, const M: usize, const APART: bool> Work for Solve<'_, '_, N, M, APART> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self(solver, run) = self;
        solver.sweep(wide, run);
    }
}

impl<const N: usize, const M: usize, const APART: bool> Sweep for Varying<N, M, APART> {
    fn solve(&mut self, run: &mut Run) {
        self.instructions.run(Solve(self, run));
    }
}

#[cfg(test)]
mod tests {
    use super::super::{General, Rate, Stage};
    use super::*;
    use nalgebra::DMatrix;

    /// Axes whose weights vary along the run, or not.
    struct Axes {
        stage: Stage,
        n_samples: usize,
        varies: bool,
    }

    impl Stages for Axes {
        fn n_samples(&self) -> usize {
            self.n_samples
        }

        fn n_targets(&self) -> usize {
            self.stage.n_inputs()
        }

        fn stage(&self, k: usize) -> Stage {
            if !self.varies {
                return self.stage.clone();
            }
            let m = self.stage.n_inputs();
            let normal = DMatrix::from_fn(m, 1, |i, _| (0.01 * k as f64 + i as f64).sin());
            let mut stage = self.stage.clone();
            // The last sample shows nothing, as that of a delayed target.
            stage.q = (&normal * normal.transpose() + stage.q)
                * f64::from(u8::from(k + 1 < self.n_samples));
            stage.s *= 1.0 + (k % 7) as f64;
            stage
        }

        fn constant(&self) -> std::ops::Range<usize> {
            if self.varies { 0..0 } else { 0..self.n_samples }
        }

        fn holds_input(&self) -> bool {
            self.stage.s[0] > 0.0
        }

        fn has_constant_plant(&self) -> bool {
            true
        }
    }

    /// Axes of `n / m` states each, coupled by the model as well or by the weights alone.
    fn axes(n: usize, m: usize, s: f64, is_apart: bool, n_samples: usize) -> Axes {
        let value = |i: usize, j: usize| (((i * 7 + j * 3 + n) as f64) * 1.7).sin();
        let matrix = |rows: usize, cols: usize, gain: f64| {
            let belongs = |i: usize, j: usize| i * m / rows == j * m / cols;
            DMatrix::from_fn(rows, cols, |i, j| {
                gain * f64::from(u8::from(!is_apart || belongs(i, j))) * value(i + rows, j + cols)
            })
        };
        let eye = |gain: f64| DMatrix::identity(m, m) * gain;
        let (a, b, c) = (matrix(n, n, 1.5 / n as f64), matrix(n, m, 1.0), matrix(m, n, 1.0));
        let stage = Stage { a, b, c, d: eye(0.7), q: eye(0.2), s: eye(s), r: eye(0.05) };
        Axes { stage, n_samples, varies: true }
    }

    #[test]
    fn segments_agree_with_the_plain_sweep_on_every_processor() {
        let lengths = [3000, 4000, 4003, 9999];
        for (n, m, is_apart) in [(4, 2, true), (4, 2, false), (6, 2, false), (6, 3, true)] {
            for (n_samples, s) in lengths.into_iter().zip([0.0, 0.2].into_iter().cycle()) {
                assert!(agree(&axes(n, m, s, is_apart, n_samples), m), "{n_samples} samples");
            }
            // So short that the whole run is near each cut, and a little longer.
            let short =
                (1..80).filter(|n_samples| agree(&axes(n, m, 0.2, is_apart, *n_samples), m));
            assert!((1..70).contains(&short.count()));
        }
        assert!(agree(&Rate { inner: axes(4, 2, 0.2, true, 4001), weight: 0.3 }, 2));
    }

    /// Solves a problem in segments, in portable instructions and sample by sample; returns false if
    /// it is left to the general way.
    fn agree(stages: &impl Stages, m: usize) -> bool {
        let gains = Gains::new(stages, 1).unwrap();
        let n_samples = gains.n_samples();
        // All channels of the machine, or those from the second on in another order, among one more.
        for (order, more) in [((0..m).collect::<Vec<_>>(), 0), ((1..=m).rev().collect(), 1)] {
            let shifts = (0..m).map(|i| 1 + more * i).collect();
            let channels = Channels { inputs: order.clone(), outputs: order, shifts };
            let width = m + more;
            let wave = |seed: usize| -> Vec<f64> {
                (0..width * n_samples).map(|k| ((k * k + seed) as f64).sin()).collect()
            };
            let (input, error) = (wave(1), wave(2));
            let solve = |sweep: &mut dyn Sweep| {
                let mut next = vec![0.0; input.len()];
                let (input, error) = (&input[..], &error[..]);
                let (n_inputs, n_outputs) = (width, width);
                sweep.solve(&mut Run { input, error, next: &mut next, n_inputs, n_outputs });
                next
            };
            let told =
                format!("{} states, {m} axes of {width}, {n_samples} samples", gains.n_states());
            let quick = |how| varying(&gains, stages, &channels, how);
            let (best, portable) = (quick(Instructions::best()), quick(Instructions::Portable));
            let (Some(mut best), Some(mut portable)) = (best, portable) else { return false };
            let best = solve(best.as_mut());
            assert!(best == solve(portable.as_mut()), "{told}");
            let plain = solve(&mut General::by_sample(&gains, channels.clone()));
            let scale = plain.iter().fold(1.0_f64, |scale, value| scale.max(value.abs()));
            for (k, (quick, plain)) in best.iter().zip(&plain).enumerate() {
                let told = format!("{told}, at {k}: {quick} and {plain}");
                assert!((quick - plain).abs() <= 1e-13 * scale, "{told}");
            }
        }
        true
    }

    #[test]
    fn what_is_not_forgotten_or_of_another_kind_is_left_to_the_general_way() {
        let found = |stages: &dyn Stages| {
            let m = stages.n_targets();
            let all: Vec<usize> = (0..m).collect();
            let channels = Channels { inputs: all.clone(), outputs: all, shifts: vec![0; m] };
            let gains = Gains::new(&stages, 1).unwrap();
            varying(&gains, &stages, &channels, Instructions::best()).is_some()
        };
        assert!(found(&axes(4, 2, 0.0, true, 4000)));
        // Short, slow, of other sizes, and with constant weights.
        assert!(!found(&axes(4, 2, 0.0, true, 100)));
        let mut slow = axes(4, 2, 0.0, true, 4000);
        slow.stage.a = DMatrix::identity(4, 4) * 0.999;
        slow.stage.r *= 1e12;
        assert!(!found(&slow));
        assert!(!found(&axes(8, 2, 0.0, true, 4000)));
        assert!(!found(&Axes { varies: false, ..axes(4, 2, 0.0, true, 4000) }));
    }
}

//! The two sweeps with constant gains, several segments of the run in parallel (SIMD).
//!
//! A sweep is a recursion: each sample waits for the one before, and the processor idles. But
//! samples far enough away have no influence within double precision, so the run may be cut
//! anywhere if each segment begins with a warm-up over its neighbour's samples. [`LANES`] segments
//! side by side keep the processor busy, and the run is processed in blocks so that the backward
//! sweep's results stay in the cache for the forward one. In a run too short for that, each segment
//! sweeps over the whole of its neighbour from zero, and what the neighbour's own start adds, which
//! is a power of the transition, is added at the cut. The cuts depend on the gains and the length of
//! the run alone, never on the processor.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::lane_step::{Fade, Fixed, STEP, backward, forward};
use super::tile::{Channel, Fetch, TILE};
use super::wide::{LANES, Lanes, Wide};
use super::{Channels, Run};

/// Samples per segment: with its `LANES` neighbours it fits the second-level cache.
const STRETCH: usize = 2048;

/// Position of a block's samples in the signals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    input: usize,
    output: usize,
    shift: usize,
    first: usize,
}

impl Place {
    /// Returns the position of the block that begins at sample `first`.
    #[inline(always)]
    pub(super) fn new(channels: &Channels, first: usize) -> Self {
        let Channels { inputs, outputs, shifts } = channels;
        Self { input: inputs[0], output: outputs[0], shift: shifts[0], first }
    }
}

/// The constant part of a run, cut into segments.
#[derive(Debug)]
pub(super) struct Cut<const N: usize> {
    /// Both in tiles.
    warm_up: usize,
    stretch: usize,
    /// Transition over a whole segment, if a state is not forgotten within one.
    across: Option<Across<N>>,
    /// `kappa` of one block, sample by sample, lane by lane, after one unused row.
    kappa: Vec<Lanes>,
}

impl<const N: usize> Cut<N> {
    /// Returns the cut of `n_samples` samples, or `None` if it does not pay.
    pub(super) fn new<const MODEL: usize>(
        gains: &Fixed<N, MODEL>,
        n_samples: usize,
    ) -> Option<Self> {
        let shortest = n_samples / (LANES * TILE);
        if shortest == 0 {
            return None;
        }
        // Eight segments at a time are worth a warm-up of up to their own length.
        let warm_up = match gains.fade(shortest * TILE / STEP) {
            Fade::Forgotten(steps) => (steps.max(1) * STEP).div_ceil(TILE),
            Fade::To(across) => return Some(Self::with(shortest, shortest, Some(Across(across)))),
            Fade::Never => return None,
        };
        // As few blocks as possible, of about equal size.
        let n_blocks = n_samples.div_ceil(LANES * STRETCH.max(4 * warm_up * TILE));
        let stretch = n_samples / (LANES * TILE * n_blocks);
        (stretch >= warm_up).then(|| Self::with(warm_up, stretch, None))
    }

    fn with(warm_up: usize, stretch: usize, across: Option<Across<N>>) -> Self {
        Self { warm_up, stretch, across, kappa: vec![Lanes::default(); 1 + stretch * TILE] }
    }

    /// Returns true if a state outlives its segment.
    #[cfg(test)]
    pub(super) fn carries(&self) -> bool {
        self.across.is_some()
    }

    /// Returns the number of samples per block.
    pub(super) fn block(&self) -> usize {
        self.stretch * TILE * LANES
    }

    /// Solves a block and returns the state after it.
    ///
    /// `last` is the costate after the last block; `meanwhile` receives the costate at the start of
    /// this one and returns the state there.
    #[inline(always)]
    pub(super) fn solve<const HELD: bool, const MODEL: usize>(
        &mut self,
        wide: impl Wide,
        gains: &Fixed<N, MODEL>,
        place: Place,
        run: &mut Run,
        last: Option<[f64; N]>,
        meanwhile: impl FnOnce(&mut Run, [f64; N]) -> [f64; N],
    ) -> [f64; N] {
        let Self { warm_up, stretch, across, kappa } = self;
        let length = *stretch * TILE;
        let firsts: [usize; LANES] = std::array::from_fn(|lane| place.first + lane * length);
        // Start of the warm-up segment of each lane; the very last one has none.
        let mut beyond = firsts.map(|first| first + length);
        if last.is_some() {
            beyond[LANES - 1] = firsts[LANES - 1];
        }
        let errors = Channel { offset: place.output, stride: run.n_outputs };
        let inputs = Channel { offset: place.input, stride: run.n_inputs };
        let zero = wide.row(&[0.0; LANES]);
        let fetch = Fetch::<HELD> { errors, inputs, shift: place.shift };

        let mut costate = [zero; N];
        for tile in (0..*warm_up).rev() {
            let (error, input) = fetch.tile(wide, run, &beyond, tile);
            for (error, input) in steps(&error).iter().zip(steps(&input)).rev() {
                backward::<HELD, N, MODEL, _>(wide, gains, &mut costate, input, error);
            }
        }
        let mut ends = values(wide, &costate);
        if let Some(exact) = last {
            replace(&mut ends, LANES - 1, exact);
        }
        if let Some(across) = across {
            across.costates(&mut ends);
        }
        let mut costate = rows(wide, &ends);
        for (tile, kappa) in kappa[1..].chunks_exact_mut(TILE).enumerate().rev() {
            let (error, input) = fetch.tile(wide, run, &firsts, tile);
            let kappa = kappa.as_chunks_mut::<STEP>().0.iter_mut();
            for ((error, input), kappa) in steps(&error).iter().zip(steps(&input)).zip(kappa).rev()
            {
                let rows = backward::<HELD, N, MODEL, _>(wide, gains, &mut costate, input, error);
                for s in 0..STEP {
                    kappa[s] = Lanes(wide.values(rows[s]));
                }
            }
        }
        let exact = meanwhile(run, lane(wide, &costate, 0));

        // Each lane warms up over the end of the previous lane, one place earlier in memory; what
        // the first one reads there is ignored.
        let mut state = [zero; N];
        let begin = length - *warm_up * TILE;
        for first in (begin..length).step_by(STEP) {
            let mut rows = [zero; STEP];
            for s in 0..STEP {
                let mut moved = [0.0; LANES];
                moved[0] = kappa[first + s].0[LANES - 1];
                moved[1..].copy_from_slice(&kappa[first + s + 1].0[..LANES - 1]);
                rows[s] = wide.row(&moved);
            }
            forward(wide, gains, &mut state, &rows);
        }
        let mut starts = values(wide, &state);
        replace(&mut starts, 0, exact);
        if let Some(across) = across {
            across.states(&mut starts);
        }
        let mut state = rows(wide, &starts);
        for (tile, kappa) in kappa[1..].chunks_exact(TILE).enumerate() {
            let mut change = [zero; TILE];
            let kappa = kappa.as_chunks::<STEP>().0;
            for (change, kappa) in change.as_chunks_mut::<STEP>().0.iter_mut().zip(kappa) {
                let mut rows = [zero; STEP];
                for s in 0..STEP {
                    rows[s] = wide.row(&kappa[s].0);
                }
                *change = forward(wide, gains, &mut state, &rows);
            }
            inputs.store(wide, run, &firsts, tile, change);
        }
        lane(wide, &state, LANES - 1)
    }
}

/// Transition over a whole segment, column by column.
#[derive(Debug)]
struct Across<const N: usize>([[f64; N]; N]);

impl<const N: usize> Across<N> {
    /// Adds to the costate at the end of each segment what comes from beyond the next one.
    #[inline(never)]
    fn costates(&self, costates: &mut [[f64; LANES]; N]) {
        for lane in (0..LANES - 1).rev() {
            for i in 0..N {
                for j in 0..N {
                    costates[i][lane] += self.0[i][j] * costates[j][lane + 1];
                }
            }
        }
    }

    /// Adds to the state at the start of each segment what comes from before the last one.
    #[inline(never)]
    fn states(&self, states: &mut [[f64; LANES]; N]) {
        for lane in 1..LANES {
            for j in 0..N {
                for i in 0..N {
                    states[i][lane] += self.0[j][i] * states[j][lane - 1];
                }
            }
        }
    }
}

/// Returns the values of some rows.
#[inline(always)]
fn values<W: Wide, const N: usize>(wide: W, rows: &[W::Row; N]) -> [[f64; LANES]; N] {
    let mut found = [[0.0; LANES]; N];
    for i in 0..N {
        found[i] = wide.values(rows[i]);
    }
    found
}

/// Returns rows of these values.
#[inline(always)]
fn rows<W: Wide, const N: usize>(wide: W, values: &[[f64; LANES]; N]) -> [W::Row; N] {
    let mut rows = [wide.row(&[0.0; LANES]); N];
    for i in 0..N {
        rows[i] = wide.row(&values[i]);
    }
    rows
}

/// Returns the values of one lane.
#[inline(always)]
fn lane<W: Wide, const N: usize>(wide: W, rows: &[W::Row; N], lane: usize) -> [f64; N] {
    let mut found = [0.0; N];
    for i in 0..N {
        found[i] = wide.values(rows[i])[lane];
    }
    found
}

/// Replaces the values of one lane.
fn replace<const N: usize>(values: &mut [[f64; LANES]; N], lane: usize, exact: [f64; N]) {
    for i in 0..N {
        values[i][lane] = exact[i];
    }
}

/// Returns the steps of a tile.
#[inline(always)]
fn steps<R>(tile: &[R; TILE]) -> &[[R; STEP]] {
    tile.as_chunks().0
}

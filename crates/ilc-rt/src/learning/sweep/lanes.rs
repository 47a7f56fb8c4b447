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

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "compiled anew for the instructions of each processor, which closures are not"
)]

use super::Run;
use super::single::Fixed;
use super::wide::{LANES, Lanes, Wide};

/// Samples fetched at a time: one cache line per lane.
const TILE: usize = LANES;
/// Remainder of a state after the warm-up.
const FORGOTTEN: f64 = 1e-18;
/// Largest remainder of a state after a whole segment: rounding errors must fade from cut to cut.
const FADED: f64 = 0.1;
/// Samples per segment: with its `LANES` neighbours it fits the second-level cache.
const STRETCH: usize = 2048;

/// Position of the channel's samples in the signals.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) shift: usize,
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
    pub(super) fn new(gains: &Fixed<N>, n_samples: usize) -> Option<Self> {
        let shortest = n_samples / (LANES * TILE);
        if shortest == 0 {
            return None;
        }
        // Eight segments at a time are worth a warm-up of up to their own length.
        let warm_up = match gains.fade(shortest * TILE) {
            Fade::Forgotten(k) => k.max(1).div_ceil(TILE),
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

    /// Solves the block that begins at sample `first` and returns the state after it.
    ///
    /// `last` is the costate after the last block; `meanwhile` receives the costate at the start of
    /// this one and returns the state there.
    #[inline(always)]
    pub(super) fn solve<const HELD: bool>(
        &mut self,
        wide: impl Wide,
        gains: &Fixed<N>,
        (place, first): (Place, usize),
        run: &mut Run,
        last: Option<[f64; N]>,
        meanwhile: impl FnOnce(&mut Run, [f64; N]) -> [f64; N],
    ) -> [f64; N] {
        let Self { warm_up, stretch, across, kappa } = self;
        let length = *stretch * TILE;
        let firsts: [usize; LANES] = std::array::from_fn(|lane| first + lane * length);
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
            for i in (0..TILE).rev() {
                backward::<HELD, N, _>(wide, gains, &mut costate, input[i], error[i]);
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
            for i in (0..TILE).rev() {
                let row = backward::<HELD, N, _>(wide, gains, &mut costate, input[i], error[i]);
                kappa[i] = Lanes(wide.values(row));
            }
        }
        let exact = meanwhile(run, lane(wide, &costate, 0));

        // Each lane warms up over the end of the previous lane, one place earlier in memory; what
        // the first one reads there is ignored.
        let mut state = [zero; N];
        for pair in kappa[length - *warm_up * TILE..].windows(2) {
            let [before, now] = pair else { break };
            let mut kappa = [0.0; LANES];
            kappa[0] = before.0[LANES - 1];
            kappa[1..].copy_from_slice(&now.0[..LANES - 1]);
            forward(wide, gains, &mut state, wide.row(&kappa));
        }
        let mut starts = values(wide, &state);
        replace(&mut starts, 0, exact);
        if let Some(across) = across {
            across.states(&mut starts);
        }
        let mut state = rows(wide, &starts);
        for (tile, kappa) in kappa[1..].chunks_exact(TILE).enumerate() {
            let mut change = [zero; TILE];
            for i in 0..TILE {
                change[i] = forward(wide, gains, &mut state, wide.row(&kappa[i].0));
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

/// Inputs of the backward sweep.
#[derive(Clone, Copy)]
struct Fetch<const HELD: bool> {
    errors: Channel,
    inputs: Channel,
    shift: usize,
}

impl<const HELD: bool> Fetch<HELD> {
    /// Fetches a tile of error and input, sample by sample.
    #[inline(always)]
    fn tile<W: Wide>(
        self,
        wide: W,
        run: &Run,
        starts: &[usize; LANES],
        tile: usize,
    ) -> ([W::Row; TILE], [W::Row; TILE]) {
        let error = self.errors.load(wide, run.error, starts, tile * TILE + self.shift);
        let input =
            if HELD { self.inputs.load(wide, run.input, starts, tile * TILE) } else { error };
        (error, input)
    }
}

/// One channel of a time-first signal.
#[derive(Clone, Copy)]
struct Channel {
    offset: usize,
    stride: usize,
}

impl Channel {
    /// Fetches a tile per lane, `ahead` of its start; returns it sample by sample.
    #[inline(always)]
    fn load<W: Wide>(
        self,
        wide: W,
        signal: &[f64],
        starts: &[usize; LANES],
        ahead: usize,
    ) -> [W::Row; TILE] {
        let mut rows = [wide.row(&[0.0; TILE]); LANES];
        if self.stride == 1 {
            for lane in 0..LANES {
                let begin = starts[lane] + ahead + self.offset;
                if let Some(values) = signal[begin..].first_chunk() {
                    rows[lane] = wide.row(values);
                }
            }
            return wide.transpose(rows);
        }
        for lane in 0..LANES {
            let from = &signal[(starts[lane] + ahead) * self.stride + self.offset..];
            let mut values = [0.0; TILE];
            for (to, value) in values.iter_mut().zip(from.iter().step_by(self.stride)) {
                *to = *value;
            }
            rows[lane] = wide.row(&values);
        }
        wide.transpose(rows)
    }

    /// Writes the input plus its change, given sample by sample.
    #[inline(always)]
    fn store<W: Wide>(
        self,
        wide: W,
        run: &mut Run,
        starts: &[usize; LANES],
        tile: usize,
        change: [W::Row; TILE],
    ) {
        let change = wide.transpose(change);
        if self.stride == 1 {
            for lane in 0..LANES {
                let begin = starts[lane] + tile * TILE + self.offset;
                let place = (run.input[begin..].first_chunk(), run.next[begin..].first_chunk_mut());
                if let (Some(input), Some(next)) = place {
                    *next = wide.values(wide.add(wide.row(input), change[lane]));
                }
            }
            return;
        }
        for lane in 0..LANES {
            let begin = (starts[lane] + tile * TILE) * self.stride + self.offset;
            let inputs = run.input[begin..].iter().step_by(self.stride);
            let nexts = run.next[begin..].iter_mut().step_by(self.stride);
            for ((next, input), change) in nexts.zip(inputs).zip(wide.values(change[lane])) {
                *next = input + change;
            }
        }
    }
}

#[inline(always)]
fn backward<const HELD: bool, const N: usize, W: Wide>(
    wide: W,
    gains: &Fixed<N>,
    costate: &mut [W::Row; N],
    input: W::Row,
    error: W::Row,
) -> W::Row {
    let mut kappa = wide.scale(gains.error, error);
    let mut earlier = *costate;
    for i in 0..N {
        earlier[i] = wide.scale(gains.from_error[i], error);
    }
    if HELD {
        kappa = wide.subtract(kappa, wide.scale(gains.input, input));
        for (earlier, gain) in earlier.iter_mut().zip(gains.from_input) {
            *earlier = wide.add(*earlier, wide.scale(gain, input));
        }
    }
    for (j, value) in costate.iter().enumerate() {
        kappa = wide.add(kappa, wide.scale(gains.costate[j], *value));
        for (earlier, gains) in earlier.iter_mut().zip(&gains.transition) {
            *earlier = wide.add(*earlier, wide.scale(gains[j], *value));
        }
    }
    *costate = earlier;
    kappa
}

#[inline(always)]
fn forward<const N: usize, W: Wide>(
    wide: W,
    gains: &Fixed<N>,
    state: &mut [W::Row; N],
    kappa: W::Row,
) -> W::Row {
    let mut change = kappa;
    let mut later = *state;
    for i in 0..N {
        later[i] = wide.scale(gains.b[i], kappa);
    }
    for ((value, column), feedback) in state.iter().zip(&gains.transition).zip(gains.feedback) {
        change = wide.subtract(change, wide.scale(feedback, *value));
        for (later, gain) in later.iter_mut().zip(column) {
            *later = wide.add(*later, wide.scale(*gain, *value));
        }
    }
    *state = later;
    change
}

/// Remainder of a state after some time.
enum Fade<const N: usize> {
    /// Nothing in double precision, after so many samples.
    Forgotten(usize),
    /// This transition after the whole time.
    To([[f64; N]; N]),
    /// Too much of it.
    Never,
}

impl<const N: usize> Fixed<N> {
    /// Returns the remainder of a state after `longest` samples.
    fn fade(&self, longest: usize) -> Fade<N> {
        let mut power: [[f64; N]; N] =
            std::array::from_fn(|col| std::array::from_fn(|row| f64::from(u8::from(row == col))));
        // Relative to the largest so far, as the states may have different units.
        let mut largest = 0.0_f64;
        for k in 0..=longest {
            let size = power.iter().flatten().fold(0.0_f64, |size, value| size.max(value.abs()));
            largest = largest.max(size);
            if size < FORGOTTEN * largest {
                return Fade::Forgotten(k);
            }
            if k == longest {
                return if size <= FADED * largest { Fade::To(power) } else { Fade::Never };
            }
            power = std::array::from_fn(|col| {
                std::array::from_fn(|row| {
                    (0..N).map(|i| self.transition[i][row] * power[col][i]).sum()
                })
            });
        }
        Fade::Never
    }
}

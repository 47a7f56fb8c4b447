//! The two sweeps with constant gains, several stretches of the run at a time.
//!
//! A sweep is a recursion: each sample waits for the one before, and the processor with it. But what
//! lies far enough away along the run has no influence that could be seen in a double, so the run may
//! be cut anywhere if each stretch begins with a warm-up over its neighbour's samples. [`LANES`]
//! stretches side by side keep the processor busy, and the run is taken a block at a time so that
//! what the backward sweep leaves for the forward one stays in the cache.

use super::Run;
use super::single::Fixed;

/// Stretches side by side.
const LANES: usize = 8;
/// Samples that are fetched at a time.
const TILE: usize = 8;
/// What is left of a state after the warm-up.
const FORGOTTEN: f64 = 1e-20;
/// A stretch is at least this many times as long as its warm-up.
const WORTHWHILE: usize = 4;
/// Samples of a stretch: with its `LANES` neighbours it fits the second cache.
const STRETCH: usize = 2048;

type Lanes = [f64; LANES];
type Tile = [Lanes; TILE];

/// Where the channel's samples lie.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) input: usize,
    pub(super) output: usize,
    pub(super) shift: usize,
}

/// The constant part of a run, cut into stretches.
#[derive(Debug)]
pub(super) struct Cut {
    /// Both in tiles.
    warm_up: usize,
    stretch: usize,
    /// `kappa` of one block: sample by sample, lane by lane.
    kappa: Vec<Tile>,
}

impl Cut {
    /// Returns how to cut `n_samples` samples, or `None` if that is not worthwhile.
    pub(super) fn new<const N: usize>(gains: &Fixed<N>, n_samples: usize) -> Option<Self> {
        let longest = n_samples / (LANES * WORTHWHILE);
        let warm_up = gains.memory(longest)?.max(1).div_ceil(TILE);
        // As few blocks as possible, all of about the same size.
        let n_blocks = n_samples.div_ceil(LANES * STRETCH.max(WORTHWHILE * warm_up * TILE));
        let stretch = n_samples / (LANES * TILE * n_blocks);
        (stretch >= warm_up).then(|| Self {
            warm_up,
            stretch,
            kappa: vec![[[0.0; LANES]; TILE]; stretch],
        })
    }

    /// Samples of one block.
    pub(super) fn block(&self) -> usize {
        self.stretch * TILE * LANES
    }

    /// Solves the block that begins at sample `first` and returns the state after it.
    ///
    /// `last` is the costate after the last block; `meanwhile` is told the costate at the start of
    /// this one and returns the state there.
    #[inline]
    pub(super) fn solve<const HELD: bool, const N: usize>(
        &mut self,
        gains: &Fixed<N>,
        (place, first): (Place, usize),
        run: &mut Run,
        last: Option<[f64; N]>,
        meanwhile: impl FnOnce(&mut Run, [f64; N]) -> [f64; N],
    ) -> [f64; N] {
        let Self { warm_up, stretch, kappa } = self;
        let start = |lane: usize| first + lane * *stretch * TILE;
        // Where the stretch that a lane warms up over begins; the very last one has none.
        let beyond =
            |lane: usize| start(if lane + 1 == LANES && last.is_some() { lane } else { lane + 1 });
        let errors = Channel { offset: place.output, stride: run.n_outputs };
        let inputs = Channel { offset: place.input, stride: run.n_inputs };

        let mut costate = [[0.0; LANES]; N];
        let gather = |run: &Run, tile: usize, from: &dyn Fn(usize) -> usize| {
            let at: [usize; LANES] = std::array::from_fn(|lane| from(lane) + tile * TILE);
            let (mut error, mut input) = (NONE, NONE);
            errors.load(run.error, at.map(|at| at + place.shift), &mut error);
            if HELD {
                inputs.load(run.input, at, &mut input);
            }
            (error, input)
        };
        for tile in (0..*warm_up).rev() {
            let (error, input) = gather(run, tile, &beyond);
            for (error, input) in error.iter().zip(&input).rev() {
                backward::<HELD, N>(gains, &mut costate, input, error);
            }
        }
        if let Some(exact) = last {
            for (lanes, value) in costate.iter_mut().zip(exact) {
                lanes[LANES - 1] = value;
            }
        }
        for (tile, kappa) in kappa.iter_mut().enumerate().rev() {
            let (error, input) = gather(run, tile, &start);
            for (kappa, (error, input)) in kappa.iter_mut().zip(error.iter().zip(&input)).rev() {
                *kappa = backward::<HELD, N>(gains, &mut costate, input, error);
            }
        }
        let exact = meanwhile(run, std::array::from_fn(|i| costate[i][0]));

        let mut state = [[0.0; LANES]; N];
        for kappa in kappa[*stretch - *warm_up..].iter().flatten() {
            // Each lane warms up over the end of the lane before.
            let before = std::array::from_fn(|lane| if lane > 0 { kappa[lane - 1] } else { 0.0 });
            forward(gains, &mut state, &before);
        }
        for (lanes, value) in state.iter_mut().zip(exact) {
            lanes[0] = value;
        }
        for (tile, kappa) in kappa.iter().enumerate() {
            let at: [usize; LANES] = std::array::from_fn(|lane| start(lane) + tile * TILE);
            let mut change = NONE;
            for (change, kappa) in change.iter_mut().zip(kappa) {
                *change = forward(gains, &mut state, kappa);
            }
            inputs.store(run, at, &change);
        }
        std::array::from_fn(|i| state[i][LANES - 1])
    }
}

const NONE: Tile = [[0.0; LANES]; TILE];

/// One channel of a time-first signal.
#[derive(Clone, Copy)]
struct Channel {
    offset: usize,
    stride: usize,
}

impl Channel {
    /// Fetches a tile for each lane, from the samples `at`.
    #[inline]
    fn load(self, signal: &[f64], at: [usize; LANES], tile: &mut Tile) {
        for lane in 0..LANES {
            let from = &signal[at[lane] * self.stride + self.offset..];
            if self.stride == 1
                && let Some(chunk) = from.first_chunk::<TILE>()
            {
                for i in 0..TILE {
                    tile[i][lane] = chunk[i];
                }
            } else {
                for (row, value) in tile.iter_mut().zip(from.iter().step_by(self.stride)) {
                    row[lane] = *value;
                }
            }
        }
    }

    /// Writes the input plus its change.
    #[inline]
    fn store(self, run: &mut Run, at: [usize; LANES], change: &Tile) {
        for lane in 0..LANES {
            let begin = at[lane] * self.stride + self.offset;
            let (input, next) = (&run.input[begin..], &mut run.next[begin..]);
            if self.stride == 1
                && let (Some(input), Some(next)) =
                    (input.first_chunk::<TILE>(), next.first_chunk_mut::<TILE>())
            {
                for i in 0..TILE {
                    next[i] = input[i] + change[i][lane];
                }
            } else {
                let pairs =
                    next.iter_mut().step_by(self.stride).zip(input.iter().step_by(self.stride));
                for ((next, input), row) in pairs.zip(change) {
                    *next = input + row[lane];
                }
            }
        }
    }
}

#[inline]
fn backward<const HELD: bool, const N: usize>(
    gains: &Fixed<N>,
    costate: &mut [Lanes; N],
    input: &Lanes,
    error: &Lanes,
) -> Lanes {
    let mut kappa = [0.0; LANES];
    let mut earlier = [[0.0; LANES]; N];
    for lane in 0..LANES {
        kappa[lane] = gains.error * error[lane];
        if HELD {
            kappa[lane] -= gains.input * input[lane];
        }
    }
    for i in 0..N {
        for lane in 0..LANES {
            earlier[i][lane] = gains.from_error[i] * error[lane];
            if HELD {
                earlier[i][lane] += gains.from_input[i] * input[lane];
            }
        }
    }
    for j in 0..N {
        for lane in 0..LANES {
            kappa[lane] += gains.costate[j] * costate[j][lane];
        }
        for i in 0..N {
            for lane in 0..LANES {
                earlier[i][lane] += gains.transition[i][j] * costate[j][lane];
            }
        }
    }
    *costate = earlier;
    kappa
}

#[inline]
fn forward<const N: usize>(gains: &Fixed<N>, state: &mut [Lanes; N], kappa: &Lanes) -> Lanes {
    let mut change = *kappa;
    let mut later = [[0.0; LANES]; N];
    for i in 0..N {
        for lane in 0..LANES {
            later[i][lane] = gains.b[i] * kappa[lane];
        }
    }
    for j in 0..N {
        for lane in 0..LANES {
            change[lane] -= gains.feedback[j] * state[j][lane];
        }
        for i in 0..N {
            for lane in 0..LANES {
                later[i][lane] += gains.transition[j][i] * state[j][lane];
            }
        }
    }
    *state = later;
    change
}

impl<const N: usize> Fixed<N> {
    /// Returns after how many samples a state is forgotten, if at most `longest`.
    fn memory(&self, longest: usize) -> Option<usize> {
        let mut power: [[f64; N]; N] =
            std::array::from_fn(|col| std::array::from_fn(|row| f64::from(u8::from(row == col))));
        for k in 0..=longest {
            let size = power.iter().flatten().fold(0.0_f64, |size, value| size.max(value.abs()));
            if size < FORGOTTEN {
                return Some(k);
            }
            power = std::array::from_fn(|col| {
                std::array::from_fn(|row| {
                    (0..N).map(|i| self.transition[i][row] * power[col][i]).sum()
                })
            });
        }
        None
    }
}

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
pub(super) const LANES: usize = 8;
/// What is left of a state after the warm-up.
const FORGOTTEN: f64 = 1e-20;
/// A stretch is at least this many times as long as its warm-up.
const WORTHWHILE: usize = 4;
/// Samples of a stretch: with its `LANES` neighbours it fits the second cache.
const STRETCH: usize = 2048;

type Lanes = [f64; LANES];
const NONE: Lanes = [0.0; LANES];

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
    warm_up: usize,
    stretch: usize,
    /// `kappa` of one block: sample by sample, lane by lane.
    kappa: Vec<Lanes>,
}

impl Cut {
    /// Returns how to cut `n_samples` samples, or `None` if that is not worthwhile.
    pub(super) fn new<const N: usize>(gains: &Fixed<N>, n_samples: usize) -> Option<Self> {
        let longest = n_samples / (LANES * WORTHWHILE);
        let warm_up = gains.memory(longest)?.max(1);
        // As few blocks as possible, all of about the same size.
        let n_blocks = n_samples.div_ceil(LANES * STRETCH.max(WORTHWHILE * warm_up));
        let stretch = n_samples / (LANES * n_blocks);
        (stretch >= warm_up).then(|| Self { warm_up, stretch, kappa: vec![[0.0; LANES]; stretch] })
    }

    /// Samples of one block.
    pub(super) fn block(&self) -> usize {
        self.stretch * LANES
    }

    /// Solves the block that begins at sample `first` and returns the state after it.
    ///
    /// `last` is the costate after the last block; `meanwhile` is told the costate at the start of
    /// this one and returns the state there.
    #[inline(always)]
    pub(super) fn solve<const HELD: bool, const N: usize>(
        &mut self,
        gains: &Fixed<N>,
        (place, first): (Place, usize),
        run: &mut Run,
        last: Option<[f64; N]>,
        meanwhile: impl FnOnce(&mut Run, [f64; N]) -> [f64; N],
    ) -> [f64; N] {
        let Self { warm_up, stretch, kappa } = self;
        let (stretch, warm_up) = (*stretch, *warm_up);
        let starts: [usize; LANES] = std::array::from_fn(|lane| first + lane * stretch);
        let (n_inputs, n_outputs) = (run.n_inputs, run.n_outputs);
        let error_at = |k: usize| (k + place.shift) * n_outputs + place.output;
        let input_at = |k: usize| k * n_inputs + place.input;

        let mut costate = [[0.0; LANES]; N];
        let end = (run.input.len() / n_inputs).saturating_sub(1);
        for k in (stretch..stretch + warm_up).rev() {
            let sample = |lane: usize| (starts[lane] + k).min(end.saturating_sub(place.shift));
            let error = std::array::from_fn(|lane| run.error[error_at(sample(lane))]);
            let input = if HELD {
                std::array::from_fn(|lane| run.input[input_at(sample(lane))])
            } else {
                NONE
            };
            backward::<HELD, N>(gains, &mut costate, &input, &error);
        }
        if let Some(exact) = last {
            for (lanes, value) in costate.iter_mut().zip(exact) {
                lanes[LANES - 1] = value;
            }
        }
        for (k, kappa) in kappa.iter_mut().enumerate().rev() {
            let error = std::array::from_fn(|lane| run.error[error_at(starts[lane] + k)]);
            let input = if HELD {
                std::array::from_fn(|lane| run.input[input_at(starts[lane] + k)])
            } else {
                NONE
            };
            *kappa = backward::<HELD, N>(gains, &mut costate, &input, &error);
        }
        let exact = meanwhile(run, std::array::from_fn(|i| costate[i][0]));

        let mut state = [[0.0; LANES]; N];
        for kappa in &kappa[stretch - warm_up..] {
            // Each lane warms up over the end of the lane before.
            let before = std::array::from_fn(|lane| if lane > 0 { kappa[lane - 1] } else { 0.0 });
            forward(gains, &mut state, &before);
        }
        for (lanes, value) in state.iter_mut().zip(exact) {
            lanes[0] = value;
        }
        for (k, kappa) in kappa.iter().enumerate() {
            let change = forward(gains, &mut state, kappa);
            for lane in 0..LANES {
                let index = input_at(starts[lane] + k);
                run.next[index] = run.input[index] + change[lane];
            }
        }
        std::array::from_fn(|i| state[i][LANES - 1])
    }
}

#[inline(always)]
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

#[inline(always)]
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

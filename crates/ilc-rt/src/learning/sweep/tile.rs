//! Signals tile by tile: some samples of eight segments at a time. For [`super::lanes`]; the length
//! of a tile for [`super::varying`], too.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::Run;
use super::wide::{LANES, Wide};

/// Samples fetched at a time: one cache line per lane.
pub(super) const TILE: usize = LANES;

/// Inputs of the backward sweep.
#[derive(Clone, Copy)]
pub(super) struct Fetch<const HELD: bool> {
    pub(super) errors: Channel,
    pub(super) inputs: Channel,
    pub(super) shift: usize,
}

impl<const HELD: bool> Fetch<HELD> {
    /// Fetches a tile of error and input, sample by sample.
    #[inline(always)]
    pub(super) fn tile<W: Wide>(
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
pub(super) struct Channel {
    pub(super) offset: usize,
    pub(super) stride: usize,
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
    pub(super) fn store<W: Wide>(
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

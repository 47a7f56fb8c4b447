//! Signals of several channels tile by tile: some samples of eight segments at a time. For
//! [`super::varying`] only.

#![expect(clippy::inline_always, reason = "compiled anew for the instructions of each processor")]

use super::Run;
use super::tile::TILE;
use super::wide::{LANES, Wide};

/// `M` channels of a time-first signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interleaved<const M: usize> {
    /// Place of the first sample of each.
    first: [usize; M],
    /// Numbers from sample to sample.
    stride: usize,
    /// True if they are all that the signal has, in this order and not shifted against each other.
    are_all: bool,
}

impl<const M: usize> Interleaved<M> {
    /// Chooses some channels of a signal that has `stride` of them, each from a sample on.
    pub(super) fn new(channels: &[usize], shifts: &[usize], stride: usize) -> Self {
        let place = |i: usize| {
            shifts.get(i).copied().unwrap_or_default() * stride
                + channels.get(i).copied().unwrap_or_default()
        };
        let first: [usize; M] = std::array::from_fn(place);
        let are_all = stride == M && first.windows(2).all(|pair| pair[0] + 1 == pair[1]);
        Self { first, stride, are_all }
    }

    /// Fetches a tile of each segment, sample by sample; zeros beyond the end of the signal.
    #[inline(always)]
    pub(super) fn load<W: Wide>(
        &self,
        wide: W,
        signal: &[f64],
        starts: &[usize; LANES],
        tile: usize,
    ) -> [[W::Row; M]; TILE] {
        let mut rows = [[wide.row(&[0.0; LANES]); M]; TILE];
        for (part, block) in rows.as_flattened_mut().as_chunks_mut().0.iter_mut().enumerate() {
            let mut lanes = *block;
            for lane in 0..LANES {
                lanes[lane] = wide.row(&self.part(signal, starts[lane] + tile * TILE, part));
            }
            *block = wide.transpose(lanes);
        }
        rows
    }

    /// Returns eight numbers of a tile, which begins at sample `begin`.
    #[inline(always)]
    fn part(&self, signal: &[f64], begin: usize, part: usize) -> [f64; LANES] {
        if self.are_all
            && let Some(from) = signal.get(begin * M + self.first[0] + part * LANES..)
            && let Some(values) = from.first_chunk()
        {
            return *values;
        }
        let mut values = [0.0; LANES];
        for (i, value) in values.iter_mut().enumerate() {
            *value = signal.get(self.place(begin, part * LANES + i)).copied().unwrap_or_default();
        }
        values
    }

    /// Returns the place of a number of a tile.
    fn place(&self, begin: usize, number: usize) -> usize {
        (begin + number / M) * self.stride + self.first[number % M]
    }

    /// Writes the input plus its change, as far as the run goes.
    #[inline(always)]
    pub(super) fn store<W: Wide>(
        &self,
        wide: W,
        run: &mut Run,
        starts: &[usize; LANES],
        tile: usize,
        changes: [[W::Row; M]; TILE],
    ) {
        for (part, block) in changes.as_flattened().as_chunks().0.iter().enumerate() {
            let lanes = wide.transpose(*block);
            for lane in 0..LANES {
                self.store_part(wide, run, starts[lane] + tile * TILE, part, lanes[lane]);
            }
        }
    }

    /// Writes eight numbers of a tile.
    #[inline(always)]
    fn store_part<W: Wide>(
        &self,
        wide: W,
        run: &mut Run,
        begin: usize,
        part: usize,
        change: W::Row,
    ) {
        let at = begin * M + self.first[0] + part * LANES;
        if self.are_all
            && let Some(input) = run.input.get(at..).and_then(<[f64]>::first_chunk)
            && let Some(next) = run.next.get_mut(at..).and_then(<[f64]>::first_chunk_mut)
        {
            *next = wide.values(wide.add(wide.row(input), change));
            return;
        }
        for (i, change) in wide.values(change).into_iter().enumerate() {
            let place = self.place(begin, part * LANES + i);
            if let (Some(input), Some(next)) = (run.input.get(place), run.next.get_mut(place)) {
                *next = input + change;
            }
        }
    }
}

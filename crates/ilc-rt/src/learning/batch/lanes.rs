//! Simulation of up to eight plants of one order side by side (SIMD).
//!
//! A simulation is a recursion, in which each sample waits for the one before and the processor idles; plants do
//! not wait for each other. Every plant's sums are in the order of [`StateSpace::simulate`], so that its
//! output is the same bit by bit, and a plant that overflows does not affect its neighbours.

#![expect(
    clippy::inline_always,
    clippy::needless_range_loop,
    reason = "compiled anew for the instructions of each processor, which closures are not"
)]

use crate::learning::sweep::wide::{Instructions, Lanes, Wide, Work};
use crate::model::StateSpace;

pub(super) use crate::learning::sweep::wide::LANES;

/// Plants side by side, a matrix entry being a row of all plants; unused lanes are zero.
#[derive(Debug)]
pub(super) struct Abreast {
    n_states: usize,
    n_inputs: usize,
    n_outputs: usize,
    /// Columns of C above A, then those of D above B, in which order the samples need them.
    columns: Vec<Lanes>,
    /// State, next state and output of a sample.
    rows: Vec<Lanes>,
    instructions: Instructions,
}

/// Signals of the lanes, time first, padded to whole tiles of eight samples.
pub(super) type Signals = [Vec<f64>; LANES];

/// Returns signals of `n_samples` x `n_channels` zeros.
pub(super) fn silence(n_samples: usize, n_channels: usize) -> Signals {
    std::array::from_fn(|_| vec![0.0; n_samples.next_multiple_of(LANES) * n_channels])
}

impl Abreast {
    /// Puts plants of the same shape side by side.
    pub(super) fn new(plants: &[&StateSpace]) -> Self {
        let (n_states, n_inputs, n_outputs) = plants
            .first()
            .map_or((0, 0, 0), |plant| (plant.n_states(), plant.n_inputs(), plant.n_outputs()));
        let mut columns = Vec::with_capacity((n_states + n_inputs) * (n_outputs + n_states));
        let mut add = |entry: &dyn Fn(&StateSpace) -> f64| {
            let value = |lane: usize| plants.get(lane).map_or(0.0, |plant| entry(plant));
            columns.push(Lanes(std::array::from_fn(value)));
        };
        for col in 0..n_states {
            (0..n_outputs).for_each(|row| add(&|plant| plant.c()[(row, col)]));
            (0..n_states).for_each(|row| add(&|plant| plant.a()[(row, col)]));
        }
        for col in 0..n_inputs {
            (0..n_outputs).for_each(|row| add(&|plant| plant.d()[(row, col)]));
            (0..n_states).for_each(|row| add(&|plant| plant.b()[(row, col)]));
        }
        let rows = vec![Lanes::default(); 2 * n_states + n_outputs];
        Self { n_states, n_inputs, n_outputs, columns, rows, instructions: Instructions::best() }
    }

    /// Writes the outputs for the inputs, from rest. What is written beyond the last sample has no meaning.
    pub(super) fn simulate(&mut self, inputs: &Signals, outputs: &mut Signals) {
        let instructions = self.instructions;
        if (self.n_inputs, self.n_outputs) != (1, 1) {
            return instructions.run(Several { plants: self, inputs, outputs });
        }
        let columns = &self.columns;
        match self.n_states {
            1 => instructions.run(Single::<1> { columns, inputs, outputs }),
            2 => instructions.run(Single::<2> { columns, inputs, outputs }),
            3 => instructions.run(Single::<3> { columns, inputs, outputs }),
            4 => instructions.run(Single::<4> { columns, inputs, outputs }),
            5 => instructions.run(Single::<5> { columns, inputs, outputs }),
            6 => instructions.run(Single::<6> { columns, inputs, outputs }),
            _ => instructions.run(Several { plants: self, inputs, outputs }),
        }
    }
}

/// Plants with one input, one output and `N` states, which stay in registers.
struct Single<'a, const N: usize> {
    columns: &'a [Lanes],
    inputs: &'a Signals,
    outputs: &'a mut Signals,
}

impl<const N: usize> Work for Single<'_, N> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Self { columns, inputs, outputs } = self;
        let zero = wide.row(&[0.0; LANES]);
        let mut x = [zero; N];
        for tile in 0..inputs[0].len() / LANES {
            let mut rows = [zero; LANES];
            for lane in 0..LANES {
                if let Some(samples) = inputs[lane][tile * LANES..].first_chunk() {
                    rows[lane] = wide.row(samples);
                }
            }
            let u = wide.transpose(rows);
            for k in 0..LANES {
                let mut columns = columns.chunks_exact(1 + N);
                let mut y = zero;
                let mut later = [zero; N];
                for j in 0..N {
                    let Some(column) = columns.next() else { break };
                    y = accumulated(wide, y, column[0], x[j], j == 0);
                    for i in 0..N {
                        later[i] = accumulated(wide, later[i], column[1 + i], x[j], j == 0);
                    }
                }
                if let Some(column) = columns.next() {
                    y = accumulated(wide, y, column[0], u[k], false);
                    for i in 0..N {
                        later[i] = accumulated(wide, later[i], column[1 + i], u[k], false);
                    }
                }
                rows[k] = y;
                x = later;
            }
            let y = wide.transpose(rows);
            for lane in 0..LANES {
                if let Some(samples) = outputs[lane][tile * LANES..].first_chunk_mut() {
                    *samples = wide.values(y[lane]);
                }
            }
        }
    }
}

/// Plants of any shape.
struct Several<'a> {
    plants: &'a mut Abreast,
    inputs: &'a Signals,
    outputs: &'a mut Signals,
}

impl Work for Several<'_> {
    type Output = ();

    #[inline(always)]
    fn with(self, wide: impl Wide) {
        let Abreast { n_states, n_inputs, n_outputs, ref columns, ref mut rows, .. } = *self.plants;
        rows.fill(Lanes::default());
        // State; output above next state, as the columns have them.
        let (x, later) = rows.split_at_mut(n_states);
        for k in 0..self.inputs[0].len() / n_inputs.max(1) {
            let mut columns = columns.chunks_exact(n_outputs + n_states);
            later.fill(Lanes::default());
            for j in 0..n_states {
                let Some(column) = columns.next() else { break };
                let value = wide.row(&x[j].0);
                for (sum, entry) in later.iter_mut().zip(column) {
                    let found = accumulated(wide, wide.row(&sum.0), *entry, value, j == 0);
                    *sum = Lanes(wide.values(found));
                }
            }
            for i in 0..n_inputs {
                let Some(column) = columns.next() else { break };
                let mut values = [0.0; LANES];
                for lane in 0..LANES {
                    values[lane] = self.inputs[lane][k * n_inputs + i];
                }
                let value = wide.row(&values);
                for (sum, entry) in later.iter_mut().zip(column) {
                    let found = accumulated(wide, wide.row(&sum.0), *entry, value, false);
                    *sum = Lanes(wide.values(found));
                }
            }
            for i in 0..n_outputs {
                for lane in 0..LANES {
                    self.outputs[lane][k * n_outputs + i] = later[i].0[lane];
                }
            }
            x.copy_from_slice(&later[n_outputs..]);
        }
    }
}

/// Returns `sum + entry value`; without the sum if this is its first term.
#[inline(always)]
fn accumulated<W: Wide>(wide: W, sum: W::Row, entry: Lanes, value: W::Row, first: bool) -> W::Row {
    let product = wide.multiply(wide.row(&entry.0), value);
    if first { product } else { wide.add(sum, product) }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    /// Returns a plant with entries that depend on a number.
    fn plant((n, m, p): (usize, usize, usize), number: usize) -> StateSpace {
        let matrix = |rows, cols, scale: f64, phase: f64| {
            DMatrix::from_fn(rows, cols, |row, col| {
                scale * ((row * 7 + col * 3 + number * 5) as f64 * 0.37 + phase).sin()
            })
        };
        let scale = 0.9 / n.max(1) as f64;
        StateSpace::discrete(
            matrix(n, n, scale, 0.1),
            matrix(n, m, 1.0, 0.2),
            matrix(p, n, 1.0, 0.3),
            matrix(p, m, 0.5, 0.4),
            0.001,
        )
        .unwrap()
    }

    #[test]
    fn every_lane_is_the_simulation_of_its_plant_bit_by_bit() {
        let n_samples = 21;
        for n in 0..9 {
            for (m, p) in [(1, 1), (2, 2), (1, 3), (3, 1)] {
                let plants: Vec<StateSpace> = (0..5).map(|i| plant((n, m, p), i)).collect();
                let mut inputs = silence(n_samples, m);
                for (lane, input) in inputs.iter_mut().enumerate().take(5) {
                    for (k, value) in input.iter_mut().enumerate().take(n_samples * m) {
                        *value = ((k * k + lane) as f64 * 0.21).cos();
                    }
                }
                // A neighbour that overflows.
                inputs[3][0] = f64::INFINITY;
                let mut outputs = silence(n_samples, p);
                Abreast::new(&plants.iter().collect::<Vec<_>>()).simulate(&inputs, &mut outputs);
                for lane in [0, 1, 2, 4] {
                    let input = &inputs[lane][..n_samples * m];
                    let expected = plants[lane].simulate(input, None).unwrap();
                    let found = &outputs[lane][..n_samples * p];
                    let bits = |y: &[f64]| y.iter().map(|y| y.to_bits()).collect::<Vec<_>>();
                    assert_eq!(bits(found), bits(&expected), "{n} {m} {p} {lane}");
                }
                assert!(n == 0 || outputs[3].iter().any(|y| !y.is_finite()));
            }
        }
    }
}

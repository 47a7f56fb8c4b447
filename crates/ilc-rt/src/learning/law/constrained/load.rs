//! From the signals of a run to the interior-point problem, and from its solution to an input
//! within all bounds.

#![expect(clippy::needless_range_loop, reason = "channels are written with their indices")]

use super::interior::Interior;
use super::rows::{BEND, CHANGE, OUTPUT, STEP};
use super::solver::Band;
use crate::learning::sweep::Run;

/// Relative tolerance on bound violation.
const EXCESS: f64 = 1e-9;

impl<const N: usize, const M: usize, const P: usize, const NS: usize> Interior<N, M, P, NS> {
    /// Loads the signals of a run: the gradient, and the limits relative to the current input.
    pub(super) fn load(&mut self, run: &Run) {
        let n_samples = self.which.len();
        self.cost_before = 0.0;
        for k in 0..n_samples {
            for (i, channel) in self.places.inputs.iter().enumerate() {
                self.input[k][i] = run.input[k * run.n_inputs + channel];
            }
            for (i, channel) in self.places.outputs.iter().enumerate() {
                let sample = k + self.places.shifts[i];
                let is_inside = sample < n_samples;
                let error =
                    if is_inside { run.error[sample * run.n_outputs + channel] } else { 0.0 };
                self.error[k][i] = error;
            }
            let place = self.which[k];
            let (weighing, hold) = (&self.weighings[place], &self.holds[place]);
            for i in 0..P {
                self.weighted[k][i] =
                    (0..P).map(|j| weighing.output[i][j] * self.error[k][j]).sum();
                self.cost_before += 0.5 * self.weighted[k][i] * self.error[k][i];
            }
            for i in 0..M {
                self.hold[k][i] = -(0..M).map(|j| hold[i][j] * self.input[k][j]).sum::<f64>();
                self.cost_before -= 0.5 * self.hold[k][i] * self.input[k][i];
            }
        }
        self.limit();
    }

    /// Sets the limits of all rows for the current input.
    fn limit(&mut self) {
        let Self { rows, bands, input, error, .. } = self;
        let zero = [0.0; M];
        let at = |k: usize, back: usize| if k < back { &zero } else { &input[k - back] };
        for k in 0..input.len() {
            for i in 0..M {
                let here = k * M + i;
                let u = input[k][i];
                let (first, second) = (at(k, 1)[i], at(k, 2)[i]);
                if let Some(begin) = rows.begin[CHANGE] {
                    let free = (f64::NEG_INFINITY, f64::INFINITY);
                    let (low, high) = bands.input.as_ref().map_or(free, |band| band.at(here));
                    let (least, most) = bands.change.as_ref().map_or(free, |band| band.at(here));
                    rows.lower.set(begin + here, least.max(low - u));
                    rows.upper.set(begin + here, most.min(high - u));
                }
                for (kind, band, offset) in [
                    (STEP, &bands.step, u - first),
                    (BEND, &bands.bend, (u - first) - (first - second)),
                ] {
                    if let (Some(begin), Some(band)) = (rows.begin[kind], band) {
                        let (low, high) = band.at(here);
                        rows.lower.set(begin + here, low - offset);
                        rows.upper.set(begin + here, high - offset);
                    }
                }
            }
            if let (Some(begin), Some(band)) = (rows.begin[OUTPUT], &bands.output) {
                for i in 0..P {
                    let (low, high) = band.at(k * P + i);
                    rows.lower.set(begin + k * P + i, low + error[k][i]);
                    rows.upper.set(begin + k * P + i, high + error[k][i]);
                }
            }
        }
    }

    /// Clips rounding errors at the bounds of input and change; returns true if all bounds hold
    /// then.
    pub(super) fn vet(&mut self) -> bool {
        for (k, v) in self.v.iter_mut().enumerate() {
            for (i, v) in v.iter_mut().enumerate() {
                let u = self.input[k][i];
                if let Some(band) = &self.bands.input {
                    let (low, high) = band.at(k * M + i);
                    *v = v.max(low - u).min(high - u);
                }
            }
        }
        self.roll();
        self.rows.overshoot(&self.sizes()) <= EXCESS
    }

    /// Returns the size of the limits of each kind as they were given, or that of the input.
    #[inline(never)]
    pub(super) fn sizes(&self) -> [f64; 4] {
        let largest = |most: f64, k: usize| {
            let next = |i: usize| (self.input[k][i] + self.v[k][i]).abs();
            (0..M).map(next).fold(most, f64::max)
        };
        let largest = (0..self.v.len()).fold(0.0, largest);
        let size = |band: &Option<Band>| {
            let size = band.as_ref().map_or(0.0, |band| band.size);
            if size > 0.0 { size } else { largest }
        };
        [
            size(&self.bands.input).max(size(&self.bands.change)),
            size(&self.bands.step),
            size(&self.bands.bend),
            size(&self.bands.output),
        ]
    }
}

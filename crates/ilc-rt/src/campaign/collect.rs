//! Gathers the samples of a run into its record.

use crate::config::Measure;
use crate::record::{AxisKinds, Figures, IterationRecord, distances_m};
use crate::servo::Sample;

/// The current run.
#[derive(Debug)]
pub(super) struct Collector {
    n_samples: usize,
    n_axes: usize,
    measure: Measure,
    has_tool: bool,
    kinds: AxisKinds,
    cycle_s: f64,
    record: IterationRecord,
    n_collected: usize,
    n_missing: u32,
}

impl Collector {
    pub(super) fn new(
        n_samples: usize,
        kinds: AxisKinds,
        measure: Measure,
        has_tool: bool,
        cycle_s: f64,
    ) -> Self {
        Self {
            n_samples,
            n_axes: kinds.n_axes(),
            measure,
            has_tool,
            kinds,
            cycle_s,
            record: IterationRecord::default(),
            n_collected: 0,
            n_missing: 0,
        }
    }

    /// Prepares the record of a run.
    pub(super) fn begin(&mut self, index: u32) {
        let zeros = vec![0.0; self.n_samples * self.n_axes];
        self.record = IterationRecord {
            index,
            reference_m: zeros.clone(),
            input: zeros.clone(),
            encoder_m: zeros.clone(),
            tool_m: if self.has_tool { zeros } else { Vec::new() },
            ..IterationRecord::default()
        };
        (self.n_collected, self.n_missing) = (0, 0);
    }

    /// Adds a sample of the run.
    pub(super) fn take(&mut self, index: u32, k: u32, sample: &Sample) {
        let row = k as usize * self.n_axes;
        let record = &mut self.record;
        if record.index != index || row + self.n_axes > record.input.len() {
            return;
        }
        let rows = row..row + self.n_axes;
        record.reference_m[rows.clone()].copy_from_slice(&sample.reference_m[..self.n_axes]);
        record.input[rows.clone()].copy_from_slice(&sample.input[..self.n_axes]);
        record.encoder_m[rows.clone()].copy_from_slice(&sample.encoder_m[..self.n_axes]);
        if self.has_tool {
            record.tool_m[rows].copy_from_slice(&sample.tool_m[..self.n_axes]);
        }
        self.n_collected += 1;
        self.n_missing += u32::from(sample.missing);
    }

    /// Completes the record; `None` if samples were lost on the way, as then nothing may be learned
    /// from it.
    pub(super) fn end(&mut self) -> Option<IterationRecord> {
        if self.n_collected != self.n_samples {
            return None;
        }
        let mut record = std::mem::take(&mut self.record);
        let difference = |measured: &[f64]| -> Vec<f64> {
            record.reference_m.iter().zip(measured).map(|(r, y)| r - y).collect()
        };
        let encoder_error_m = difference(&record.encoder_m);
        let tool_error_m = difference(&record.tool_m);
        let seen = if self.has_tool { &record.tool_m } else { &record.encoder_m };
        record.contour_m = distances_m(&record.reference_m, seen, &self.kinds, self.cycle_s);
        record.error_m = match self.measure {
            Measure::Tcp if self.has_tool => tool_error_m,
            Measure::Tcp | Measure::Encoder => encoder_error_m,
        };
        let mut figures = Figures { missing_samples: self.n_missing, ..Figures::default() };
        figures.set_places(&record.reference_m, &record.encoder_m, &record.tool_m, &self.kinds);
        figures.set_tracking(&record.error_m, &self.kinds);
        figures.set_contour(&record.contour_m);
        record.figures = figures;
        Some(record)
    }
}

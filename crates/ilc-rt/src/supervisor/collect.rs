//! Gathers the samples of a run into its record.

use crate::config::Measure;
use crate::record::{Figures, IterationRecord, infinity_norm, rms};
use crate::servo::Sample;
use crate::trajectory::contour_error_m;

/// Farthest that a tool is looked for along the path, before or after its own time.
const CONTOUR_WINDOW_S: f64 = 0.25;

/// The run that is on.
#[derive(Debug)]
pub(super) struct Collector {
    n_samples: usize,
    n_axes: usize,
    measure: Measure,
    has_tool: bool,
    window: usize,
    record: IterationRecord,
    n_collected: usize,
    n_missing: u32,
}

impl Collector {
    pub(super) fn new(
        n_samples: usize,
        n_axes: usize,
        measure: Measure,
        has_tool: bool,
        cycle_s: f64,
    ) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0.25 s")]
        let window = (CONTOUR_WINDOW_S / cycle_s) as usize;
        Self {
            n_samples,
            n_axes,
            measure,
            has_tool,
            window,
            record: IterationRecord::default(),
            n_collected: 0,
            n_missing: 0,
        }
    }

    /// Makes room for a run.
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

    /// Takes a sample of the run.
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

    /// Completes the record; `None` if samples were lost on the way here, as then nothing may be
    /// learned from it.
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
        record.contour_m = contour_error_m(&record.reference_m, seen, self.n_axes, self.window);
        record.figures.encoder_tracking_inf_m = infinity_norm(&encoder_error_m);
        record.figures.tool_tracking_inf_m = self.has_tool.then(|| infinity_norm(&tool_error_m));
        record.error_m = match self.measure {
            Measure::Tcp if self.has_tool => tool_error_m,
            Measure::Tcp | Measure::Encoder => encoder_error_m,
        };
        record.figures = Figures {
            tracking_inf_m: infinity_norm(&record.error_m),
            tracking_rms_m: rms(&record.error_m, self.n_axes),
            contour_inf_m: infinity_norm(&record.contour_m),
            contour_rms_m: rms(&record.contour_m, 1),
            missing_samples: self.n_missing,
            ..record.figures
        };
        Some(record)
    }
}

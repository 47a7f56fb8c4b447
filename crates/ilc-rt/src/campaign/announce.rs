//! Publishing of events: to the caller at once, and to the network through the telemetry thread.

use std::sync::Arc;

use serde_json::json;

use super::control::{Shared, Status};
use super::telemetry::{Kept, Telemetry};
use crate::record::{Event, SCHEMA};
use crate::recording::Notes;
use crate::servo::Sample;

/// Duration of a batch on the network.
const BATCH_S: f64 = 0.05;

/// Receivers of the events: an observer, and the network.
pub(super) struct Announcer<'a> {
    observe: &'a mut dyn FnMut(&Event),
    telemetry: Option<Telemetry>,
    /// State for clients of the control.
    shared: Arc<Shared>,
    batch: Vec<Sample>,
    batch_size: usize,
    n_axes: usize,
    notes: Notes,
}

impl<'a> Announcer<'a> {
    pub(super) fn new(
        observe: &'a mut dyn FnMut(&Event),
        telemetry: Option<Telemetry>,
        shared: Arc<Shared>,
        notes: Notes,
        (cycle_s, n_axes): (f64, usize),
    ) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small, positive"
        )]
        let batch_size = ((BATCH_S / cycle_s) as usize).max(1);
        Self {
            observe,
            telemetry,
            shared,
            batch: Vec::with_capacity(batch_size),
            batch_size,
            n_axes,
            notes,
        }
    }

    /// Records the run that the loop is about to make.
    pub(super) fn set_waiting_run(&self, run: u32) {
        self.shared.set_waiting_run(run);
    }

    /// Publishes an event.
    pub(super) fn publish(&mut self, event: &Event) {
        self.shared.update(|status: &mut Status| status.follow(event));
        (self.observe)(event);
        self.notes.event(event);
        let Some(telemetry) = &mut self.telemetry else { return };
        let key = match event {
            Event::Iteration { .. } | Event::Judged { .. } | Event::Drift { .. } => "iteration",
            Event::Fault { .. } => "fault",
            Event::Latency { .. } | Event::Late { .. } => "latency",
            Event::Inputs { .. } => "inputs",
            Event::Drives { .. } => "drives",
            Event::Start { .. }
            | Event::State { .. }
            | Event::Progress { .. }
            | Event::Recording { .. }
            | Event::End { .. } => "state",
        };
        let kept = match event {
            Event::Start { .. } => Kept::Start,
            Event::State { .. } | Event::End { .. } => Kept::State,
            Event::Iteration { .. }
            | Event::Judged { .. }
            | Event::Drift { .. }
            | Event::Fault { .. } => Kept::Past,
            Event::Inputs { .. } | Event::Drives { .. } => Kept::Latest,
            Event::Progress { .. }
            | Event::Recording { .. }
            | Event::Latency { .. }
            | Event::Late { .. } => Kept::No,
        };
        if let Ok(text) = serde_json::to_string(event) {
            telemetry.send(key, text, kept);
        }
    }

    /// Publishes a servo cycle; cycles go out in batches.
    pub(super) fn sample(&mut self, sample: &Sample) {
        let Some(telemetry) = &mut self.telemetry else { return };
        self.batch.push(*sample);
        if self.batch.len() < self.batch_size {
            return;
        }
        let rows = |of: fn(&Sample) -> &[f64; crate::trajectory::MAX_AXES]| -> Vec<&[f64]> {
            self.batch.iter().map(|sample| &of(sample)[..self.n_axes]).collect()
        };
        let at: Vec<_> = self.batch.iter().map(|sample| sample.at).collect();
        let text = json!({
            "event": "servo",
            "schema": SCHEMA,
            "first_sync": self.batch.first().map(|sample| sample.sync),
            "iteration_and_sample": at,
            "reference_m": rows(|sample| &sample.reference_m),
            "input": rows(|sample| &sample.input),
            "encoder_m": rows(|sample| &sample.encoder_m),
            "tool_m": rows(|sample| &sample.tool_m),
        })
        .to_string();
        telemetry.send("servo", text, Kept::No);
        self.batch.clear();
    }
}

//! State that campaign, control and loop share.

use std::sync::atomic::{AtomicI32, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use crate::record::{Event, InputState, StateName};
use crate::servo::Orders;

/// State of a campaign.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Cell.
    pub cell: String,
    /// Campaign in the library.
    pub campaign: String,
    /// Law; `frozen` for a frozen input.
    pub law: String,
    /// State, as in the events.
    pub state: String,
    /// Run of the state.
    pub iteration: u32,
    /// Runs in the whole campaign; absent if it runs until stopped.
    pub iterations: Option<u32>,
    /// Feed override.
    pub feed_percent: u32,
    /// True if path and starts are held.
    pub paused: bool,
    /// Number of the last run that is stored.
    pub last_index: Option<u32>,
    /// Its RMS error.
    pub last_tracking_rms_m: Option<f64>,
    /// Its error over that of the run a frozen input was taken from.
    pub last_frozen_ratio: Option<f64>,
    /// Digital inputs.
    #[serde(default)]
    pub inputs: Vec<InputState>,
}

impl Status {
    /// Adds an event.
    pub(in crate::campaign) fn follow(&mut self, event: &Event) {
        match event {
            Event::Start { cell, campaign, law, iterations, .. } => {
                self.cell.clone_from(cell);
                self.campaign.clone_from(campaign);
                self.law.clone_from(law);
                self.iterations = Some(*iterations).filter(|n| *n != u32::MAX);
            }
            Event::State { state, iteration } => {
                self.state = name(*state);
                self.iteration = *iteration;
            }
            Event::Inputs { inputs } => self.inputs.clone_from(inputs),
            Event::Iteration { index, figures, .. } => {
                self.last_index = Some(*index);
                self.last_tracking_rms_m = Some(figures.tracking_rms_m);
                self.last_frozen_ratio = figures.frozen_ratio;
            }
            _ => {}
        }
    }
}

fn name(state: StateName) -> String {
    let text = serde_json::to_value(state).ok();
    text.and_then(|text| text.as_str().map(str::to_owned)).unwrap_or_default()
}

/// State shared by campaign, server and loop.
#[derive(Debug)]
pub struct Shared {
    pub(crate) orders: Arc<Orders>,
    stop: Arc<AtomicI32>,
    status: Mutex<Status>,
    /// Run that the loop waits with, which a resumed campaign does not count.
    waiting_run: AtomicU32,
    /// True if runs wait for commands.
    pub(super) starts_by_command: bool,
}

impl Shared {
    /// Creates it for a loop that follows `orders`, and stops at a number in `stop`.
    pub fn new(orders: Arc<Orders>, stop: Arc<AtomicI32>) -> Self {
        let (status, waiting_run) = (Mutex::new(Status::default()), AtomicU32::new(0));
        Self { orders, stop, status, waiting_run, starts_by_command: true }
    }

    /// Sets whether runs wait for commands; otherwise one to start is refused.
    #[must_use]
    pub fn starting(self, starts_by_command: bool) -> Self {
        Self { starts_by_command, ..self }
    }

    /// Changes the published state.
    pub(crate) fn update(&self, change: impl FnOnce(&mut Status)) {
        change(&mut self.status.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Records the run that the loop waits with.
    pub(crate) fn set_waiting_run(&self, run: u32) {
        self.waiting_run.store(run, Ordering::Relaxed);
    }

    pub(super) fn waiting_run(&self) -> u32 {
        self.waiting_run.load(Ordering::Relaxed)
    }

    pub(super) fn stop(&self, number: i32) {
        self.stop.store(number, Ordering::Relaxed);
    }

    /// Returns the number of the stop request, or 0.
    #[cfg(test)]
    pub(super) fn stop_number(&self) -> i32 {
        self.stop.load(Ordering::Relaxed)
    }

    pub(super) fn status(&self) -> Status {
        let status = self.status.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let (feed_percent, paused) = (self.orders.feed_percent(), self.orders.is_paused());
        Status { feed_percent, paused, ..status }
    }
}

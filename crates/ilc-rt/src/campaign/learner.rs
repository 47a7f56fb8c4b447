//! The learning between two runs: on its own thread in real time, in line in lock-step.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::error::CampaignError;
use crate::learning::{Law, LearningError, Purpose, Standing};
use crate::record::Figures;

/// Time that the end of a campaign waits for the update from the last run.
const LAST_UPDATE: Duration = Duration::from_millis(500);

/// Update of a law from one run.
#[derive(Debug)]
pub(super) struct UpdateResult {
    /// Input of the next run.
    pub(super) input: Result<Vec<f64>, LearningError>,
    /// Computing time.
    pub(super) update_ms: f64,
    /// Status message of the law.
    pub(super) remark: Option<String>,
    /// State of the law: learning, paused, or rolling back.
    pub(super) standing: Standing,
    /// Purpose of the next run.
    pub(super) purpose: Purpose,
}

impl UpdateResult {
    /// Writes the law's decision into the figures of the run that it learned from.
    pub(super) fn annotate(&self, figures: &mut Figures) {
        figures.rolled_back |= self.standing == Standing::GoesBack;
        figures.learning_off |= matches!(self.standing, Standing::GoesBack | Standing::Rests);
        if figures.remark.is_none() {
            figures.remark.clone_from(&self.remark);
        }
    }
}

/// Request to the law.
pub(super) enum LearningRequest {
    /// Learn from the input and the error of a run; the next run has this disturbance.
    Learn { input: Vec<f64>, error: Vec<f64>, next_disturbance: Vec<f64> },
    /// Nothing is to be learned from the last run; the next one has this disturbance.
    SetDisturbance { next_disturbance: Vec<f64> },
    /// The last input is rolled back.
    RollBack,
}

/// A law, with the thread that it computes on.
pub(super) enum Learner {
    /// In the caller's thread: the result is available at once, always at the same tick.
    InLine { law: Box<dyn Law>, done: Option<UpdateResult> },
    /// On its own thread: the loop's thread and the caller's continue meanwhile.
    Thread {
        requests: Option<Sender<LearningRequest>>,
        results: Receiver<UpdateResult>,
        thread: Option<JoinHandle<()>>,
    },
}

impl Learner {
    pub(super) fn in_line(law: Box<dyn Law>) -> Self {
        Self::InLine { law, done: None }
    }

    pub(super) fn on_thread(mut law: Box<dyn Law>) -> Result<Self, CampaignError> {
        let (requests, received) = channel::<LearningRequest>();
        let (done, results) = channel();
        let thread = std::thread::Builder::new()
            .name("ilc-learn".to_owned())
            .spawn(move || {
                for request in received {
                    match request {
                        LearningRequest::RollBack => law.on_rollback(),
                        LearningRequest::SetDisturbance { next_disturbance } => {
                            set_disturbance(law.as_mut(), &next_disturbance);
                        }
                        LearningRequest::Learn { input, error, next_disturbance } => {
                            set_disturbance(law.as_mut(), &next_disturbance);
                            if done.send(learn(law.as_mut(), &input, &error)).is_err() {
                                return;
                            }
                        }
                    }
                }
            })
            .map_err(|source| CampaignError::Thread { what: "learning", source })?;
        Ok(Self::Thread { requests: Some(requests), results, thread: Some(thread) })
    }

    /// Returns whether updates are available at once.
    pub(super) fn is_in_line(&self) -> bool {
        matches!(self, Self::InLine { .. })
    }

    /// Begins to learn from a run; the next one has this disturbance.
    pub(super) fn begin(&mut self, input: &[f64], error: &[f64], next_disturbance: &[f64]) {
        match self {
            Self::InLine { law, done } => {
                set_disturbance(law.as_mut(), next_disturbance);
                *done = Some(learn(law.as_mut(), input, error));
            }
            Self::Thread { requests: Some(requests), .. } => {
                let (input, error, next_disturbance) =
                    (input.to_vec(), error.to_vec(), next_disturbance.to_vec());
                // A thread that has died never answers; the old input is then repeated and counted.
                let _ = requests.send(LearningRequest::Learn { input, error, next_disturbance });
            }
            Self::Thread { .. } => {}
        }
    }

    /// Sets the disturbance of the next run if there is nothing to learn from the last one.
    pub(super) fn set_disturbance(&mut self, next_disturbance: &[f64]) {
        match self {
            Self::InLine { law, .. } => set_disturbance(law.as_mut(), next_disturbance),
            Self::Thread { requests: Some(requests), .. } => {
                let _ = requests.send(LearningRequest::SetDisturbance {
                    next_disturbance: next_disturbance.to_vec(),
                });
            }
            Self::Thread { .. } => {}
        }
    }

    /// Notifies the law that its last input is rolled back, as the error grew with it.
    pub(super) fn roll_back(&mut self) {
        match self {
            Self::InLine { law, .. } => law.on_rollback(),
            Self::Thread { requests: Some(requests), .. } => {
                let _ = requests.send(LearningRequest::RollBack);
            }
            Self::Thread { .. } => {}
        }
    }

    /// Returns the oldest finished update.
    pub(super) fn take(&mut self) -> Option<UpdateResult> {
        match self {
            Self::InLine { done, .. } => done.take(),
            Self::Thread { results, .. } => results.try_recv().ok(),
        }
    }
}

impl Learner {
    /// Waits for the update from the last run, so that the run's record states a rollback.
    pub(super) fn take_last(&mut self) -> Option<UpdateResult> {
        match self {
            Self::InLine { done, .. } => done.take(),
            Self::Thread { requests, results, .. } => {
                drop(requests.take());
                results.recv_timeout(LAST_UPDATE).ok()
            }
        }
    }
}

impl Drop for Learner {
    fn drop(&mut self) {
        if let Self::Thread { requests, thread, .. } = self {
            drop(requests.take());
            if let Some(thread) = thread.take() {
                let _ = thread.join();
            }
        }
    }
}

/// Sets the disturbance of the next run, if one is measured.
pub(super) fn set_disturbance(law: &mut dyn Law, next_disturbance: &[f64]) {
    if !next_disturbance.is_empty() {
        law.set_disturbance(next_disturbance);
    }
}

/// Learns from a run on the calling thread.
pub(super) fn learn(law: &mut dyn Law, input: &[f64], error: &[f64]) -> UpdateResult {
    let began = Instant::now();
    let mut next = vec![0.0; input.len()];
    let result = law.update(input, error, &mut next);
    let update_ms = began.elapsed().as_secs_f64() * 1e3;
    let (remark, standing, purpose) = (law.status(), law.standing(), law.purpose());
    UpdateResult { input: result.map(|()| next), update_ms, remark, standing, purpose }
}

//! The learning between two runs: on its own thread in real time, in line in lock-step.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::error::CampaignError;
use crate::learning::{Law, LearningError, Standing};
use crate::record::Figures;

/// How long the end of a campaign waits for what the law makes of the last run.
const LAST_LESSON: Duration = Duration::from_millis(500);

/// What a law made of a run.
#[derive(Debug)]
pub(super) struct Lesson {
    /// Input of the next run.
    pub(super) input: Result<Vec<f64>, LearningError>,
    /// How long it took.
    pub(super) update_ms: f64,
    /// What a person should know of it.
    pub(super) remark: Option<String>,
    /// Whether the law goes on learning.
    pub(super) standing: Standing,
}

impl Lesson {
    /// Writes what the law decided into the figures of the run that it learned from.
    pub(super) fn note(&self, figures: &mut Figures) {
        figures.rolled_back |= self.standing == Standing::GoesBack;
        figures.learning_off |= matches!(self.standing, Standing::GoesBack | Standing::Rests);
        if figures.remark.is_none() {
            figures.remark.clone_from(&self.remark);
        }
    }
}

/// What a law is to do.
pub(super) enum Job {
    /// Learn from the input and the error of a run, for one with this disturbance.
    Learn { input: Vec<f64>, error: Vec<f64>, coming: Vec<f64> },
    /// Nothing is to be learned from the last run, but the one to come has this disturbance.
    Pass { coming: Vec<f64> },
    /// Its last input is taken back.
    TakeBack,
}

/// A law, and where it computes.
pub(super) enum Learner {
    /// In the caller's thread: the result is there at once, always at the same tick.
    InLine { law: Box<dyn Law>, done: Option<Lesson> },
    /// On a thread of its own: the loop's thread and the caller's go on meanwhile.
    Thread { jobs: Option<Sender<Job>>, lessons: Receiver<Lesson>, thread: Option<JoinHandle<()>> },
}

impl Learner {
    pub(super) fn in_line(law: Box<dyn Law>) -> Self {
        Self::InLine { law, done: None }
    }

    pub(super) fn on_thread(mut law: Box<dyn Law>) -> Result<Self, CampaignError> {
        let (jobs, todo) = channel::<Job>();
        let (done, lessons) = channel();
        let thread = std::thread::Builder::new()
            .name("ilc-learn".to_owned())
            .spawn(move || {
                for job in todo {
                    match job {
                        Job::TakeBack => law.on_rollback(),
                        Job::Pass { coming } => set_disturbance(law.as_mut(), &coming),
                        Job::Learn { input, error, coming } => {
                            set_disturbance(law.as_mut(), &coming);
                            if done.send(learn(law.as_mut(), &input, &error)).is_err() {
                                return;
                            }
                        }
                    }
                }
            })
            .map_err(|source| CampaignError::Thread { what: "learning", source })?;
        Ok(Self::Thread { jobs: Some(jobs), lessons, thread: Some(thread) })
    }

    /// Whether a lesson is there at once.
    pub(super) fn is_in_line(&self) -> bool {
        matches!(self, Self::InLine { .. })
    }

    /// Begins to learn from a run, for the one to come under this disturbance.
    pub(super) fn begin(&mut self, input: &[f64], error: &[f64], coming: &[f64]) {
        match self {
            Self::InLine { law, done } => {
                set_disturbance(law.as_mut(), coming);
                *done = Some(learn(law.as_mut(), input, error));
            }
            Self::Thread { jobs: Some(jobs), .. } => {
                let (input, error, coming) = (input.to_vec(), error.to_vec(), coming.to_vec());
                // A thread that is gone never answers; the old input is then repeated and counted.
                let _ = jobs.send(Job::Learn { input, error, coming });
            }
            Self::Thread { .. } => {}
        }
    }

    /// Tells the law of the run to come when there is nothing to learn from the last one.
    pub(super) fn pass(&mut self, coming: &[f64]) {
        match self {
            Self::InLine { law, .. } => set_disturbance(law.as_mut(), coming),
            Self::Thread { jobs: Some(jobs), .. } => {
                let _ = jobs.send(Job::Pass { coming: coming.to_vec() });
            }
            Self::Thread { .. } => {}
        }
    }

    /// Tells the law that its last input is taken back, as the error grew with it.
    pub(super) fn take_back(&mut self) {
        match self {
            Self::InLine { law, .. } => law.on_rollback(),
            Self::Thread { jobs: Some(jobs), .. } => {
                let _ = jobs.send(Job::TakeBack);
            }
            Self::Thread { .. } => {}
        }
    }

    /// What was learned, once it is there.
    pub(super) fn take(&mut self) -> Option<Lesson> {
        match self {
            Self::InLine { done, .. } => done.take(),
            Self::Thread { lessons, .. } => lessons.try_recv().ok(),
        }
    }
}

impl Learner {
    /// What a law that computes on a thread makes of the last run, if it is there in time: so that the
    /// run's record says if it went back.
    pub(super) fn take_last(&mut self) -> Option<Lesson> {
        match self {
            Self::InLine { done, .. } => done.take(),
            Self::Thread { jobs, lessons, .. } => {
                drop(jobs.take());
                lessons.recv_timeout(LAST_LESSON).ok()
            }
        }
    }
}

impl Drop for Learner {
    fn drop(&mut self) {
        if let Self::Thread { jobs, thread, .. } = self {
            drop(jobs.take());
            if let Some(thread) = thread.take() {
                let _ = thread.join();
            }
        }
    }
}

/// Tells a law of the run to come, if there is something to tell.
pub(super) fn set_disturbance(law: &mut dyn Law, coming: &[f64]) {
    if !coming.is_empty() {
        law.set_disturbance(coming);
    }
}

/// Learns from a run, here and now.
pub(super) fn learn(law: &mut dyn Law, input: &[f64], error: &[f64]) -> Lesson {
    let began = Instant::now();
    let mut next = vec![0.0; input.len()];
    let result = law.update(input, error, &mut next);
    let update_ms = began.elapsed().as_secs_f64() * 1e3;
    let (remark, standing) = (law.status(), law.standing());
    Lesson { input: result.map(|()| next), update_ms, remark, standing }
}

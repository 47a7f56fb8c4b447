//! A campaign while its loop runs: messages of the loop, learning, records.

use std::collections::VecDeque;

use super::announce::Announcer;
use super::claim::Claim;
use super::collect::Collector;
use super::disturbance::Disturbance;
use super::frozen::Frozen;
use super::inputs;
use super::keeper::Keeper;
use super::late::LateLog;
use super::learner::{Learner, UpdateResult};
use super::options::Options;
use super::recording;
use super::resume::Resumed;
use super::rollback::{Decision, RollbackPolicy};
use super::runs::Runs;
use crate::config::Cell;
use crate::design::Plan;
use crate::learning::Purpose;
use crate::record::{AxisKinds, Event, FaultKind, IterationRecord, StateName};
use crate::recording::Recorder;
use crate::servo::{Mailbox, Message, PhaseName, Sample, StopReason};

/// Time between two progress events.
const PROGRESS_S: f64 = 0.1;

/// A campaign whose loop runs.
pub(super) struct Running<'a> {
    cell: &'a Cell,
    pub(super) collector: Collector,
    pub(super) announcer: Announcer<'a>,
    pub(super) keeper: Keeper,
    /// Name of the campaign.
    pub(super) campaign: String,
    /// Runs that could not be stored, oldest first.
    pub(super) unkept: Vec<IterationRecord>,
    pub(super) claim: Claim,
    pub(super) policy: RollbackPolicy,
    pub(super) learner: Option<Learner>,
    /// Drift of a frozen input; `None` while the law learns.
    pub(super) frozen: Option<Frozen>,
    /// Event at the start of the campaign.
    pub(super) start: Event,
    pub(super) runs: Runs,
    disturbance: Disturbance,
    /// Disturbance of the current run, or of the next one between two runs.
    pub(super) current_disturbance: Vec<f64>,
    /// First run that counts.
    first: u32,
    pub(super) iterations: u32,
    pub(super) mail: Mailbox,
    pub(super) stopping: Option<StopReason>,
    /// Last cycles before the stop.
    pub(super) before: Vec<Sample>,
    /// Cycles of the loop that were late.
    pub(super) late: LateLog,
    /// Runs that the law was asked about and has not answered yet, oldest first: key and place.
    pub(super) unjudged: VecDeque<(i64, usize)>,
    /// Updates from runs that are not stored yet, oldest first.
    pub(super) updates: VecDeque<UpdateResult>,
    /// Number of updates that the law's thread has not delivered yet.
    pub(super) awaited: u32,
    /// Latest remark of the law.
    remark: Option<String>,
    /// Reason why no more runs can be stored: the axes are stopped, so that no run is lost.
    pub(super) failure: Option<(FaultKind, String)>,
    pub(super) phase_iteration: u32,
    progress_every: u32,
    n_samples: usize,
}

/// Parts of a campaign that are created before its loop runs.
pub(super) struct Parts<'a> {
    pub(super) announcer: Announcer<'a>,
    pub(super) keeper: Keeper,
    pub(super) claim: Claim,
    pub(super) policy: RollbackPolicy,
    pub(super) learner: Option<Learner>,
    pub(super) mail: Mailbox,
    pub(super) frozen: Option<Frozen>,
    pub(super) start: Event,
}

impl<'a> Running<'a> {
    pub(super) fn new(
        cell: &'a Cell,
        options: &Options,
        plan: Plan,
        parts: Parts<'a>,
        resumed: Resumed,
    ) -> Self {
        let first = resumed.next_index();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small, positive"
        )]
        let progress_every = ((PROGRESS_S / cell.cycle_s()) as u32).max(1);
        Self {
            cell,
            collector: Collector::new(
                plan.n_samples(),
                AxisKinds::new(&plan.meta.input_units, cell.n_axes()),
                plan.measure,
                cell.tcp_encoder.is_some(),
                cell.cycle_s(),
            ),
            announcer: parts.announcer,
            keeper: parts.keeper,
            n_samples: plan.n_samples(),
            campaign: plan.meta.campaign,
            unkept: Vec::new(),
            claim: parts.claim,
            policy: parts.policy,
            learner: parts.learner,
            frozen: parts.frozen,
            start: parts.start,
            runs: Runs::new(resumed.runs, options.forever),
            disturbance: options.disturbance.clone().or_file(cell),
            current_disturbance: resumed.next_disturbance,
            first,
            iterations: options.iterations,
            mail: parts.mail,
            stopping: None,
            before: Vec::new(),
            late: LateLog::new(cell),
            unjudged: VecDeque::new(),
            updates: VecDeque::new(),
            awaited: 0,
            remark: None,
            failure: None,
            phase_iteration: first,
            progress_every: if options.session.lockstep { u32::MAX } else { progress_every },
        }
    }
}

impl Running<'_> {
    /// Tells the losses or the early end of the recording.
    pub(super) fn recording(&mut self, recorder: &Recorder, reason: String) {
        self.announcer.publish(&recording::event(recorder, reason));
    }

    /// Handles the messages of the loop, the outcomes of storing and the updates of the law.
    pub(super) fn read_mail(&mut self) {
        while let Some(message) = self.mail.read() {
            match message {
                Message::Sample(sample) => {
                    self.announcer.sample(&sample);
                    if let Some((run, k)) = sample.at {
                        self.collector.take(run, k, &sample);
                        let run = run.max(self.first);
                        if k % self.progress_every == self.progress_every - 1 {
                            let (iteration, sample) = (run, k as usize + 1);
                            let n_samples = self.n_samples;
                            self.announcer.publish(&Event::Progress {
                                iteration,
                                sample,
                                n_samples,
                            });
                        }
                    }
                }
                Message::Phase(phase, iteration) => {
                    self.announcer.set_waiting_run(iteration);
                    let iteration = iteration.max(self.first);
                    self.phase_iteration = iteration;
                    if let Some(state) = state_name(phase) {
                        self.announcer.publish(&Event::State { state, iteration });
                    }
                }
                Message::RunStarted { run, table } => {
                    while let Some(event) = self.keeper.wait() {
                        self.on_stored(event);
                    }
                    self.collector.begin(run);
                    self.policy.started(table);
                }
                Message::RunEnded { run, .. } if run < self.first => {}
                Message::RunEnded { overruns, scaled, .. } => self.run_ended(overruns, scaled),
                Message::Inputs(bits) => {
                    let inputs = inputs::states(self.cell, bits);
                    self.announcer.publish(&Event::Inputs { inputs });
                }
                Message::Drives(states) => {
                    let drives = inputs::drives(self.cell, &states);
                    self.announcer.publish(&Event::Drives { drives });
                }
                Message::Before(sample) => self.before.push(sample),
                Message::Cycle(stamps) => {
                    if let Some(event) = self.late.take(stamps, self.phase_iteration) {
                        self.announcer.publish(&event);
                    }
                }
                Message::Stopping(reason) => self.stopping = Some(reason),
            }
        }
        self.poll_keeper();
        while let Some(update) = self.learner.as_mut().and_then(Learner::take) {
            self.awaited = self.awaited.saturating_sub(1);
            let update = self.send_update(update);
            self.updates.push_back(update);
            self.amend_stored();
        }
    }

    /// Adds the law's decisions to the runs that are stored by now.
    pub(super) fn amend_stored(&mut self) {
        while !self.unjudged.is_empty()
            && let Some(update) = self.updates.pop_front()
        {
            self.amend(&update);
        }
    }

    /// Passes the input of an update to the loop.
    fn send_update(&mut self, mut update: UpdateResult) -> UpdateResult {
        // Logged when it changes, not after every run.
        if update.remark != self.remark {
            tracing::info!("{}", update.remark.as_deref().unwrap_or("the law learns again"));
            self.remark.clone_from(&update.remark);
        }
        match std::mem::replace(&mut update.input, Ok(Vec::new())) {
            Ok(input) => {
                self.policy.send(&mut self.mail, input, update.update_ms, update.purpose);
            }
            Err(error) => {
                self.fail(FaultKind::Law, format!("the law refused the last run: {error}"));
            }
        }
        update
    }

    /// Adds the law's decision to a run that was stored while it computed.
    fn amend(&mut self, update: &UpdateResult) {
        let Some((id, place)) = self.unjudged.pop_front() else { return };
        let Some((index, figures)) = self.runs.at(place) else { return };
        let before = figures.clone();
        update.annotate(figures);
        if *figures == before {
            return;
        }
        let event = Event::Judged {
            campaign: self.campaign.clone(),
            id,
            index: *index,
            rolled_back: figures.rolled_back,
            learning_off: figures.learning_off,
            remark: figures.remark.clone(),
        };
        self.keeper.amend(id, figures.clone());
        self.announcer.publish(&event);
    }

    fn run_ended(&mut self, overruns: u32, scaled: u32) {
        let Some(mut record) = self.collector.end() else {
            let why = "samples of a run were lost on their way to the record";
            self.fail(FaultKind::SamplesLost, why.to_owned());
            return;
        };
        record.figures.overruns = overruns;
        record.figures.scaled_cycles = scaled;
        record.disturbance = std::mem::take(&mut self.current_disturbance);
        if record.index + 1 < self.iterations {
            match self.disturbance.of(record.index + 1) {
                Ok(next_disturbance) => self.current_disturbance = next_disturbance,
                Err(why) => {
                    self.keep(record, false);
                    self.fail(FaultKind::Disturbance, why.to_string());
                    return;
                }
            }
        }
        self.policy.annotate(&mut record);
        if self.frozen.is_some() {
            return self.frozen_run_ended(record);
        }
        let decision = self.policy.decide(&mut record);
        let mut asked = false;
        let mut update = None;
        if let Some(learner) = &mut self.learner {
            if decision == Decision::Learn {
                self.policy.asked();
                learner.begin(&record.input, &record.error_m, &self.current_disturbance);
                asked = true;
                if learner.is_in_line() {
                    update = learner.take();
                }
            } else {
                if matches!(decision, Decision::RollBack(_)) {
                    learner.roll_back();
                }
                learner.set_disturbance(&self.current_disturbance);
            }
        } else {
            record.figures.remark = None;
        }
        if let Some(update) = update {
            update.annotate(&mut record.figures);
            self.send_update(update);
            asked = false;
        }
        if let Decision::RollBack(input) = decision {
            self.policy.send(&mut self.mail, input, 0.0, Purpose::Learning);
        }
        self.awaited += u32::from(asked);
        self.keep(record, asked);
    }
}

/// Returns the published state of a phase; disabling and stopped are published when the campaign ends.
fn state_name(phase: PhaseName) -> Option<StateName> {
    Some(match phase {
        PhaseName::Enabling => StateName::Enabling,
        PhaseName::Returning => StateName::Returning,
        PhaseName::Settling => StateName::Settling,
        PhaseName::Waiting => StateName::Waiting,
        PhaseName::Running => StateName::Running,
        PhaseName::Paused => StateName::Paused,
        PhaseName::Stopping => StateName::Stopping,
        PhaseName::Disabling | PhaseName::Stopped => return None,
    })
}

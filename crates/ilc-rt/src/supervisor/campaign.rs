//! One campaign from the first frame to the last: bring-up, runs, learning, library, end.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::sync::Arc;

use super::announce::Announcer;
use super::claim::{Claim, claim};
use super::collect::Collector;
use super::disturbance::Disturbance;
use super::error::SupervisorError;
use super::experiment::Experiment;
use super::keeper::{Keeper, Kept, Told};
use super::learner::{Learner, Lesson, set_disturbance};
use super::options::{Options, Outcome, SIMULATED_PATIENCE_S};
use super::pace::Pacer;
use super::plan::Plan;
use super::progress::{Decision, Progress, Resumed};
use super::telemetry::Telemetry;
use super::{nodes, reason};
use crate::config::Cell;
use crate::fieldbus::Bus;
use crate::learning::{Law, LearningError};
use crate::library::{Library, Task};
use crate::record::{AxisKinds, EndStatus, Event, Figures, IterationRecord, StateName};
use crate::servo::{Cycle, Mailbox, Message, PhaseName, StopReason, mailbox};

/// Messages that may wait in the loop's mailbox: two seconds at 4 kHz.
const MAILBOX: usize = 8192;
/// Time between two reports of progress.
const PROGRESS_S: f64 = 0.1;

/// Runs a campaign on a bus (`cell.bus.address`, open), with the cell's law or another one; `observe` hears every event.
///
/// # Errors
/// [`SupervisorError`] before anything has moved. Whatever happens later brings the axes to rest and
/// is told by the [`Outcome`].
pub fn run(
    cell: &Cell,
    options: &Options,
    bus: Box<dyn Bus>,
    law: Option<Box<dyn Law>>,
    observe: &mut dyn FnMut(&Event),
) -> Result<Outcome, SupervisorError> {
    let mut plan = Plan::new(cell, options.measure, options.lockstep)?;
    let (name, law) = if let Some(law) = law {
        ("user", Some(law))
    } else {
        let prepared = plan.law(cell)?;
        for warning in &prepared.warnings {
            tracing::warn!("{warning}");
        }
        (cell.learning.law.as_str(), prepared.law)
    };
    // Without a law there is nothing to take back. A gate decides by itself: it knows what is good
    // enough, and when the machine is not what it was.
    let growth_allowed = match &law {
        Some(law) if !law.handles_rollback() => cell.learning.rollback(),
        _ => f64::INFINITY,
    };
    let parameters = law.as_ref().map_or_else(|| "{}".to_owned(), Law::describe);
    plan.name_law(cell, name, &parameters);
    carry_out(cell, options, bus, Work { plan, law, input: None, growth_allowed }, observe)
}

/// Excites one axis while all hold still, `options.iterations` times, and keeps what was measured; the
/// records name the law `excitation`, with the experiment as its parameters.
///
/// # Errors
/// [`SupervisorError`] before anything has moved, as for an experiment beyond the limits of its axis.
pub fn identify(
    cell: &Cell,
    experiment: &Experiment,
    options: &Options,
    bus: Box<dyn Bus>,
    observe: &mut dyn FnMut(&Event),
) -> Result<Outcome, SupervisorError> {
    let planned = experiment.plan(cell, options.measure, options.lockstep)?;
    let work = Work {
        plan: planned.plan,
        law: None,
        input: Some(planned.input),
        // Nothing is learned, so that there is nothing to take back.
        growth_allowed: f64::INFINITY,
    };
    carry_out(cell, options, bus, work, observe)
}

/// What a campaign shall do.
struct Work {
    plan: Plan,
    law: Option<Box<dyn Law>>,
    /// Input of the first run, if it is not to be zero.
    input: Option<Vec<f64>>,
    /// Growth of the error at which the best input is restored.
    growth_allowed: f64,
}

/// Returns the newest campaign of the same fingerprint, also of libraries of older versions.
fn campaign_to_resume(library: &Library, plan: &Plan) -> Result<String, SupervisorError> {
    if let Some(campaign) = library.newest_campaign(&plan.meta.fingerprint)? {
        return Ok(campaign);
    }
    if let Some(campaign) = library.newest_campaign(&plan.legacy_fingerprint)? {
        tracing::info!("campaign {campaign} was begun by an older version; it goes on as it was");
        return Ok(campaign);
    }
    Err(SupervisorError::Resume(
        "the library has no campaign of this cell, program, measurement and law".to_owned(),
    ))
}

/// Lets a law that weighs runs by their disturbance remember those that the library holds: all of this
/// cell, program and measurement, made earlier than this campaign.
fn recall(
    library: &Library,
    plan: &Plan,
    progress: &Progress,
    law: Option<&mut (dyn Law + '_)>,
) -> Result<(), SupervisorError> {
    let Some((law, n_disturbances)) = law.and_then(|law| law.n_disturbances().map(|n| (law, n)))
    else {
        return Ok(());
    };
    let meta = &plan.meta;
    let task = Task { cell: Some(meta.cell.clone()) };
    let (ids, _) = library.fitting(plan.n_samples(), meta.n_axes, n_disturbances, &task)?;
    for id in ids {
        let row = library.load(id)?;
        if row.meta.campaign == meta.campaign {
            break;
        }
        let alike = row.meta.program == meta.program
            && row.meta.measure == meta.measure
            && row.meta.cycle_s.to_bits() == meta.cycle_s.to_bits();
        let record = &row.record;
        if alike && !progress.is_disturbed(&record.figures) {
            law.recall(&record.input, &record.error_m, &record.disturbance)
                .map_err(|source| SupervisorError::Learning { file: meta.cell.clone(), source })?;
        }
    }
    Ok(())
}

#[expect(clippy::too_many_lines, reason = "the course of a campaign, step by step")]
fn carry_out(
    cell: &Cell,
    options: &Options,
    mut bus: Box<dyn Bus>,
    work: Work,
    observe: &mut dyn FnMut(&Event),
) -> Result<Outcome, SupervisorError> {
    let Work { mut plan, mut law, input, growth_allowed } = work;
    let disturbance = options.disturbance.clone().or_file(cell);
    if options.resume && !options.library.exists() {
        // Opening it would leave an empty file where a name was mistyped.
        let path = options.library.display();
        return Err(SupervisorError::Resume(format!("there is no library {path} to go on with")));
    }
    let library = Library::open(&options.library)?;
    let mut progress = Progress::new(growth_allowed).forgiving(options.forgives_stalls());
    let held;
    let resumed = if options.resume {
        // Claimed before it is read: what another program adds to it meanwhile would be made twice.
        let campaign = campaign_to_resume(&library, &plan)?;
        held = claim(&options.library, &campaign)?;
        plan.meta.campaign = campaign;
        recall(&library, &plan, &progress, law.as_deref_mut())?;
        progress.resume(&library, &plan.meta, law.as_deref_mut(), &disturbance)?
    } else {
        plan.meta.campaign = library.new_campaign()?;
        held = claim(&options.library, &plan.meta.campaign)?;
        recall(&library, &plan, &progress, law.as_deref_mut())?;
        let coming = disturbance.of(0).map_err(SupervisorError::Disturbance)?;
        if let Some(law) = law.as_deref_mut() {
            set_disturbance(law, &coming);
        }
        Resumed { coming, ..Resumed::default() }
    };
    if let Some(expected) = law.as_ref().and_then(|law| law.n_disturbances())
        && expected != resumed.coming.len()
    {
        let found = resumed.coming.len();
        let source = LearningError::Disturbance { found, expected };
        let file = cell.file.display().to_string();
        return Err(SupervisorError::Learning { file, source });
    }
    let learner = match law {
        Some(law) if options.lockstep => Some(Learner::in_line(law)),
        Some(law) => Some(Learner::on_thread(law)?),
        None => None,
    };
    let first = resumed.runs.last().map_or(0, |(index, _)| index + 1);
    if first >= options.iterations {
        return Err(SupervisorError::Resume(format!(
            "campaign {} has {first} of {} runs already; ask for more with --iterations",
            plan.meta.campaign, options.iterations
        )));
    }
    let telemetry = if options.telemetry && cell.telemetry.enabled {
        Some(Telemetry::start(cell)?)
    } else {
        None
    };
    let mut announcer = Announcer::new(observe, telemetry, cell.cycle_s(), cell.n_axes());
    announcer.tell(&Event::State { state: StateName::BringingUp, iteration: first });
    nodes::start(cell, bus.as_mut(), options)?;

    // Drives that were off do not begin where the last run left them. One run with the coming input
    // brings them there; it is not kept, as it says nothing of the law.
    let warm_up = u32::from(!resumed.runs.is_empty());
    plan.servo.runs = first - warm_up..options.iterations;
    if options.forgives_stalls() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 s")]
        let patience = (SIMULATED_PATIENCE_S / cell.cycle_s()) as u32;
        plan.servo.hold_cycles_max = patience;
        plan.servo.overrun_cycles_max = plan.servo.overrun_cycles_max.max(patience);
    }
    let meta = Arc::new(plan.meta.clone());
    let keeper = if options.lockstep {
        Keeper::in_line(library, meta)
    } else {
        Keeper::on_thread(library, meta)?
    };
    let (mut mail, loop_side) = mailbox(MAILBOX, Arc::clone(&options.stop));
    if let Some((input, update_ms)) = input.map(|input| (input, 0.0)).or(resumed.next) {
        progress.send(&mut mail, input, update_ms);
    }
    let cycle = Cycle::new(bus, plan.servo.clone(), plan.interpolator.clone(), loop_side);
    let (mut pacer, granted) = if options.lockstep {
        (Pacer::in_line(cycle), None)
    } else {
        let (pacer, report) = Pacer::on_clock(cycle)?;
        (pacer, Some(report))
    };
    announcer.tell(&Event::Start {
        cell: cell.cell.name.clone(),
        campaign: plan.meta.campaign.clone(),
        n_samples: plan.n_samples(),
        n_axes: cell.n_axes(),
        axis_names: plan.meta.axis_names.clone(),
        input_units: plan.meta.input_units.clone(),
        cycle_s: cell.cycle_s(),
        first_index: first,
        iterations: options.iterations,
        measure: plan.meta.measure.clone(),
        law: plan.meta.law.clone(),
        bus: cell.bus.address.clone(),
        mode: if options.lockstep { "lockstep" } else { "realtime" },
        rt: granted,
    });
    // The loop tells of changes only, and this is where it begins.
    announcer.tell(&Event::State { state: StateName::Enabling, iteration: first });

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small, positive")]
    let progress_every = ((PROGRESS_S / cell.cycle_s()) as u32).max(1);
    let mut campaign = Running {
        collector: Collector::new(
            plan.n_samples(),
            AxisKinds::new(&plan.meta.input_units, cell.n_axes()),
            plan.measure,
            cell.tcp_encoder.is_some(),
            cell.cycle_s(),
        ),
        announcer,
        keeper,
        campaign: plan.meta.campaign,
        unkept: Vec::new(),
        _claim: held,
        progress,
        learner,
        runs: resumed.runs,
        disturbance,
        present: resumed.coming,
        first,
        iterations: options.iterations,
        mail,
        stopping: None,
        unjudged: VecDeque::new(),
        lessons: VecDeque::new(),
        awaited: 0,
        remark: None,
        failure: None,
        phase_iteration: first,
        progress_every: if options.lockstep { u32::MAX } else { progress_every },
        n_samples: plan.interpolator.n_samples(),
    };
    loop {
        let over = pacer.go_on();
        campaign.read_mail();
        if over {
            break;
        }
    }
    Ok(campaign.end(pacer, cell, options))
}

/// A campaign whose loop runs.
struct Running<'a> {
    collector: Collector,
    announcer: Announcer<'a>,
    keeper: Keeper,
    /// Name of the campaign.
    campaign: String,
    /// Runs that could not be kept, oldest first.
    unkept: Vec<IterationRecord>,
    _claim: Claim,
    progress: Progress,
    learner: Option<Learner>,
    runs: Vec<(u32, Figures)>,
    disturbance: Disturbance,
    /// Disturbance of the run that is on, or about to be.
    present: Vec<f64>,
    /// The first run that counts.
    first: u32,
    iterations: u32,
    mail: Mailbox,
    stopping: Option<StopReason>,
    /// Runs that the law is asked about and has not answered yet, the oldest first: key and place.
    unjudged: VecDeque<(i64, usize)>,
    /// What the law made of runs that are not kept yet, the oldest first.
    lessons: VecDeque<Lesson>,
    /// Runs that the law on its thread was asked about and has not answered yet.
    awaited: u32,
    /// What the law last had to say.
    remark: Option<String>,
    /// Why no more runs can be kept, if so: the axes are stopped, as nothing may be lost.
    failure: Option<String>,
    phase_iteration: u32,
    progress_every: u32,
    n_samples: usize,
}

impl Running<'_> {
    /// Handles all that the loop has reported, and all that has been learned meanwhile.
    fn read_mail(&mut self) {
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
                            self.announcer.tell(&Event::Progress { iteration, sample, n_samples });
                        }
                    }
                }
                Message::Phase(phase, iteration) => {
                    let iteration = iteration.max(self.first);
                    self.phase_iteration = iteration;
                    if let Some(state) = state_name(phase) {
                        self.announcer.tell(&Event::State { state, iteration });
                    }
                }
                Message::RunStarted { run, table } => {
                    self.collector.begin(run);
                    self.progress.started(table);
                }
                Message::RunEnded { run, .. } if run < self.first => {}
                Message::RunEnded { overruns, .. } => self.run_ended(overruns),
                Message::Stopping(reason) => self.stopping = Some(reason),
            }
        }
        self.heed_all();
        while let Some(lesson) = self.learner.as_mut().and_then(Learner::take) {
            self.awaited = self.awaited.saturating_sub(1);
            let lesson = self.learned(lesson);
            self.lessons.push_back(lesson);
            self.judge_kept();
        }
    }

    /// Adds what the law decided to those runs that are kept by now.
    fn judge_kept(&mut self) {
        while !self.unjudged.is_empty()
            && let Some(lesson) = self.lessons.pop_front()
        {
            self.judged(&lesson);
        }
    }

    /// Hands the loop what was learned.
    fn learned(&mut self, mut lesson: Lesson) -> Lesson {
        // Once for each change: what stays as it is need not be said after every run.
        if lesson.remark != self.remark {
            tracing::info!("{}", lesson.remark.as_deref().unwrap_or("the law learns again"));
            self.remark.clone_from(&lesson.remark);
        }
        match std::mem::replace(&mut lesson.input, Ok(Vec::new())) {
            Ok(input) => self.progress.send(&mut self.mail, input, lesson.update_ms),
            Err(error) => self.fail(format!("the law refused the last run: {error}")),
        }
        lesson
    }

    /// Adds what the law decided to a run that was kept while it computed.
    fn judged(&mut self, lesson: &Lesson) {
        let Some((id, place)) = self.unjudged.pop_front() else { return };
        let Some((index, figures)) = self.runs.get_mut(place) else { return };
        let before = figures.clone();
        lesson.note(figures);
        if *figures == before {
            return;
        }
        let event = Event::Judged {
            id,
            index: *index,
            rolled_back: figures.rolled_back,
            learning_off: figures.learning_off,
            remark: figures.remark.clone(),
        };
        self.keeper.judge(id, figures.clone());
        self.announcer.tell(&event);
    }

    fn run_ended(&mut self, overruns: u32) {
        let Some(mut record) = self.collector.end() else {
            self.fail("samples of a run were lost on their way to the record".to_owned());
            return;
        };
        record.figures.overruns = overruns;
        record.disturbance = std::mem::take(&mut self.present);
        if record.index + 1 < self.iterations {
            match self.disturbance.of(record.index + 1) {
                Ok(coming) => self.present = coming,
                Err(why) => {
                    self.keep(record, false);
                    self.fail(why);
                    return;
                }
            }
        }
        self.progress.note(&mut record);
        let decision = self.progress.decide(&mut record);
        let mut asked = false;
        let mut lesson = None;
        if let Some(learner) = &mut self.learner {
            if decision == Decision::Learn {
                self.progress.asked();
                learner.begin(&record.input, &record.error_m, &self.present);
                asked = true;
                if learner.is_in_line() {
                    lesson = learner.take();
                }
            } else {
                if matches!(decision, Decision::RollBack(_)) {
                    learner.take_back();
                }
                learner.pass(&self.present);
            }
        } else {
            record.figures.remark = None;
        }
        if let Some(lesson) = lesson {
            lesson.note(&mut record.figures);
            self.learned(lesson);
            asked = false;
        }
        if let Decision::RollBack(input) = decision {
            self.progress.send(&mut self.mail, input, 0.0);
        }
        self.awaited += u32::from(asked);
        self.keep(record, asked);
    }

    fn keep(&mut self, record: IterationRecord, asked: bool) {
        self.keeper.begin(record, asked);
        self.heed_all();
    }

    /// Heeds whatever has become of runs that were to be kept.
    fn heed_all(&mut self) {
        while let Some(told) = self.keeper.take() {
            self.heed(told);
        }
    }

    /// Tells of a run that is kept; the first one that is not stops the axes.
    fn heed(&mut self, told: Told) {
        let Kept { record, asked, result } = match told {
            Told::Kept(kept) => *kept,
            Told::Unjudged(error) => return self.fail(error.to_string()),
        };
        match result {
            Some(Ok(id)) => {
                self.tell_kept(id, &record);
                if asked {
                    self.unjudged.push_back((id, self.runs.len() - 1));
                    self.judge_kept();
                }
            }
            Some(Err(error)) => {
                self.fail(error.to_string());
                self.unkept.push(record);
            }
            None => self.unkept.push(record),
        }
    }

    fn tell_kept(&mut self, id: i64, record: &IterationRecord) {
        self.announcer.tell(&Event::Iteration {
            id,
            index: record.index,
            digest: record.digest(),
            figures: record.figures.clone(),
        });
        self.runs.push((record.index, record.figures.clone()));
    }

    /// Waits for the runs that are being kept, and tries once more to keep those that could not be.
    fn finish_keeping(&mut self) {
        for told in self.keeper.finish() {
            self.heed(told);
        }
        self.heed_all();
        if self.unkept.is_empty() {
            return;
        }
        let first = self.unkept[0].index;
        let mut is_saved = true;
        for record in std::mem::take(&mut self.unkept) {
            let Some(id) = self.keeper.retry(&record) else {
                is_saved = false;
                break;
            };
            self.tell_kept(id, &record);
        }
        let lost = if is_saved { "could not be kept at once" } else { "could not be kept" };
        let kept = match self.runs.len() {
            1 => "1 run is kept".to_owned(),
            n => format!("{n} runs are kept"),
        };
        if let Some(why) = &mut self.failure {
            let _ = write!(why, "; run {first} {lost}, {kept}");
        }
    }

    fn fail(&mut self, why: String) {
        if self.failure.is_none() {
            self.failure = Some(why);
            self.mail.stop(libc::SIGABRT);
        }
    }

    fn end(mut self, pacer: Pacer, cell: &Cell, options: &Options) -> Outcome {
        let remains = pacer.end();
        self.read_mail();
        while self.awaited > 0
            && let Some(lesson) = self.learner.as_mut().and_then(Learner::take_last)
        {
            self.awaited -= 1;
            self.lessons.push_back(lesson);
        }
        self.finish_keeping();
        let (status, reason) = match (&self.failure, self.stopping, &remains) {
            (Some(why), _, _) => (EndStatus::Fault, why.clone()),
            (None, Some(reason), _) => {
                (reason::status(reason), reason::sentence(reason, cell, options))
            }
            (None, None, None) => (
                EndStatus::Fault,
                "the loop's thread died; the drives stop by themselves".to_owned(),
            ),
            (None, None, Some(_)) => {
                (EndStatus::Completed, format!("{} runs made and kept", options.iterations))
            }
        };
        if status == EndStatus::Fault {
            self.announcer.tell(&Event::Fault { reason: reason.clone() });
        }
        if let Some(remains) = remains {
            if let Err(error) = remains.released {
                tracing::warn!("nodes could not be taken out of operation: {error}");
            }
            if let Some(timing) = remains.timing {
                self.announcer.tell(&Event::Latency {
                    wake_late_us: timing.wake_late.figures(),
                    execution_us: timing.execution.figures(),
                });
            }
        }
        let iterations = u32::try_from(self.runs.len()).unwrap_or(u32::MAX);
        self.announcer
            .tell(&Event::State { state: StateName::Stopped, iteration: self.phase_iteration });
        self.announcer.tell(&Event::End { status, reason: reason.clone(), iterations });
        let signal = match self.stopping {
            Some(StopReason::Asked(signal)) if self.failure.is_none() => signal,
            _ => 0,
        };
        Outcome { status, reason, signal, campaign: self.campaign, runs: self.runs }
    }
}

/// The state as others see it; switching off and being off are told when the campaign ends.
fn state_name(phase: PhaseName) -> Option<StateName> {
    Some(match phase {
        PhaseName::Enabling => StateName::Enabling,
        PhaseName::Returning => StateName::Returning,
        PhaseName::Settling => StateName::Settling,
        PhaseName::Running => StateName::Running,
        PhaseName::Stopping => StateName::Stopping,
        PhaseName::Disabling | PhaseName::Stopped => return None,
    })
}

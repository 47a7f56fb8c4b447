//! Course of a campaign: bring-up, loop, end.

use std::ops::Range;
use std::sync::Arc;

use super::announce::Announcer;
use super::before_run;
use super::claim::{Claim, claim};
use super::control::{Server, Shared};
use super::error::{CampaignError, ResumeError};
use super::first_input::first_input;
use super::frozen::{self, Frozen};
use super::input::InputError;
use super::inputs;
use super::keeper::{Keeper, Waits};
use super::learner::{Learner, set_disturbance};
use super::nodes;
use super::options::{Options, Outcome, SIMULATED_PATIENCE_S, Session, StartOn};
use super::pace::{MAILBOX, MAILBOX_IN_LOCKSTEP, Pacer, Settings};
use super::recording;
use super::resume::{Resumed, to_resume};
use super::rollback::RollbackPolicy;
use super::running::{Parts, Running};
use super::telemetry::Telemetry;
use crate::config::{Cell, Keep};
use crate::design::{DesignError, Plan};
use crate::fieldbus::Bus;
use crate::identification::Experiment;
use crate::learning::{Law, LearningError, Purpose};
use crate::library::Library;
use crate::record::{Event, SCHEMA, StateName};
use crate::recording::Recorder;
use crate::rt::RtReport;
use crate::servo::{Cycle, Orders, mailbox};

/// Runs a campaign on a bus (`cell.bus.address`, open), with the cell's law or another one; `observe` is
/// called with every event.
///
/// # Errors
/// [`CampaignError`] before anything has moved. Any later failure brings the axes to rest and is
/// reported in the [`Outcome`].
pub fn run(
    cell: &Cell,
    options: &Options,
    bus: Box<dyn Bus>,
    law: Option<Box<dyn Law>>,
    observe: &mut dyn FnMut(&Event),
) -> Result<Outcome, CampaignError> {
    let options = &options.counted();
    let cell = &options.apply(cell.clone());
    let session = &options.session;
    inputs::require_start(cell, options)?;
    let mut plan = Plan::new(cell, session.measure, session.lockstep)?;
    let relearns = !options.frozen || options.relearn_above.is_some();
    let (name, law) = if let Some(law) = law.filter(|_| relearns) {
        ("user", Some(law))
    } else {
        let prepared = plan.law(cell)?;
        for warning in &prepared.warnings {
            tracing::warn!("{warning}");
        }
        (cell.learning.law.as_str(), prepared.law)
    };
    // Without a law there is nothing to roll back. A gate decides on its own: it knows the
    // tolerance, and detects a change of the machine.
    let growth_allowed = match &law {
        Some(law) if !law.handles_rollback() => cell.learning.rollback(),
        _ => f64::INFINITY,
    };
    let parameters = law.as_ref().map_or_else(|| "{}".to_owned(), Law::describe);
    let earlier = law.as_ref().and_then(Law::earlier_description);
    plan.name_law(cell, name, &parameters, earlier.as_ref().unwrap_or(&parameters));
    let law_is_not_run = recording::law_is_not_run(law.as_deref(), name, options);
    let campaign = Campaign {
        plan,
        law,
        input: None,
        growth_allowed,
        frozen: None,
        law_is_not_run,
        holds: false,
    };
    execute(cell, options, bus, campaign, observe)
}

/// Excites one axis in one run while all others hold still, and stores the run; its record names the law
/// `excitation`, with the experiment as its parameters.
///
/// # Errors
/// [`CampaignError`] before anything has moved, e.g. for an experiment beyond the limits of its
/// axis.
pub fn identify(
    cell: &Cell,
    experiment: &Experiment,
    session: &Session,
    bus: Box<dyn Bus>,
    observe: &mut dyn FnMut(&Event),
) -> Result<Outcome, CampaignError> {
    let planned = experiment.plan(cell, session.measure, session.lockstep)?;
    let campaign = Campaign {
        plan: planned.plan,
        law: None,
        input: Some(planned.input),
        // Nothing is learned, so there is nothing to roll back.
        growth_allowed: f64::INFINITY,
        frozen: None,
        law_is_not_run: Some("there is no law".to_owned()),
        holds: true,
    };
    let once = Options { iterations: 1, learning: false, ..Options::default() };
    let options = Options { session: session.clone(), keep: Some(Keep::All), ..once };
    execute(cell, &options, bus, campaign, observe)
}

/// A planned campaign.
struct Campaign {
    plan: Plan,
    law: Option<Box<dyn Law>>,
    /// Input of the first run, if it is not zero.
    input: Option<Vec<f64>>,
    /// Growth of the error at which the best input is restored.
    growth_allowed: f64,
    /// Drift of a frozen input.
    frozen: Option<Frozen>,
    /// Reason why a replay of its recording cannot run the law again.
    law_is_not_run: Option<String>,
    /// True if its set points rest.
    holds: bool,
}

fn execute(
    cell: &Cell,
    options: &Options,
    mut bus: Box<dyn Bus>,
    mut campaign: Campaign,
    observe: &mut dyn FnMut(&Event),
) -> Result<Outcome, CampaignError> {
    let session = &options.session;
    let library = open_library(options)?;
    let mut policy =
        RollbackPolicy::new(campaign.growth_allowed).forgiving(session.forgives_stalls());
    if options.frozen {
        let chosen = frozen::choose(&library, options, (cell, &campaign.plan), &policy)?;
        let learns = campaign.law.is_some();
        let frozen = Frozen::new(&library, options, cell, &chosen, learns, &mut campaign.plan)?;
        (campaign.frozen, campaign.input) = (Some(frozen), Some(chosen.input));
    }
    let (claim, mut resumed) =
        begin_or_resume(&library, cell, options, &mut campaign, &mut policy)?;
    let Campaign { mut plan, law, input, frozen, growth_allowed, law_is_not_run, holds } = campaign;
    let mut recorder = recording::begin(cell, session, &plan.meta.campaign)?;
    let notes = recorder.as_ref().map(Recorder::notes).unwrap_or_default();
    policy = policy.noting(notes.clone());
    let learner = match law {
        Some(law) if session.lockstep => Some(Learner::in_line(law)),
        Some(law) => Some(Learner::on_thread(law)?),
        None => None,
    };
    let settings = if session.lockstep { None } else { Some(Settings::of(cell, session)?) };
    let first = resumed.next_index();
    if first >= options.iterations {
        let (campaign, iterations) = (plan.meta.campaign, options.iterations);
        return Err(ResumeError::Complete { campaign, made: first, iterations }.into());
    }
    let telemetry = if session.telemetry && cell.telemetry.enabled {
        Some(Telemetry::start(cell)?)
    } else {
        None
    };
    let orders = Arc::new(Orders::new(options.start == StartOn::AtOnce));
    let shared = Shared::new(Arc::clone(&orders), Arc::clone(&session.stop));
    let shared = Arc::new(shared.starting(options.start == StartOn::Command));
    // Before anything moves: a cell that cannot be commanded as asked is not started.
    let server =
        if options.ctl { Some(Server::open(&cell.cell.name, Arc::clone(&shared))?) } else { None };
    let size = (cell.cycle_s(), cell.n_axes());
    let mut announcer = Announcer::new(observe, telemetry, shared, notes, size);
    if let Some(recorder) = &recorder {
        let file = recorder.path().display().to_string();
        announcer.publish(&Event::Recording { file, lost: 0, reason: None });
    }
    announcer.publish(&Event::State { state: StateName::BringingUp, iteration: first });
    if session.home {
        bus = match before_run::home(cell, session, bus, &mut announcer, first)? {
            Ok(bus) => bus,
            Err(end) => return Ok(Outcome { campaign: plan.meta.campaign, ..end }),
        };
    }
    let maps = nodes::start(cell, bus.as_mut(), session)?;

    // After being switched off, drives start elsewhere than the last run left them. One run with
    // the next input brings them there; it is not stored, as it says nothing about the law.
    let warm_up = u32::from(!resumed.runs.is_empty());
    let runs = first - warm_up..options.iterations;
    complete(&mut plan, cell, options, runs);
    let facts = recording::Facts { first, holds, growth_allowed, law_is_not_run };
    recording::describe(recorder.as_ref(), cell, session, (&plan, &maps), facts)?;
    let meta = Arc::new(plan.meta.clone());
    let keep = options.keep.unwrap_or(cell.library.keep);
    let waits = if session.lockstep { Waits::WhenTold } else { Waits::Never };
    let keeper = Keeper::new(library, meta, keep, waits)?;
    let capacity = if session.lockstep { MAILBOX_IN_LOCKSTEP } else { MAILBOX };
    let (mut mail, loop_side) = mailbox(capacity, Arc::clone(&session.stop));
    let own = input.map(|input| (input, 0.0, Purpose::Learning));
    if let Some((input, update_ms, purpose)) = own.or(resumed.next.take()) {
        policy.send(&mut mail, input, update_ms, purpose);
    }
    let loop_side = loop_side.following(orders);
    let (bus, tap) = recording::tap(recorder.as_mut(), cell, session, bus);
    let network = plan.network(bus, &maps);
    let cycle = Cycle::new(network, plan.servo.clone(), plan.interpolator.clone(), loop_side);
    let cycle = recording::tapped(cycle, tap);
    let (mut pacer, granted) = match settings {
        None => (Pacer::in_line(cycle), None),
        Some(settings) => {
            let (pacer, report) = Pacer::on_clock(cycle, settings)?;
            (pacer, Some(report))
        }
    };
    let ctl = server.as_ref().map(|server| server.path().display().to_string());
    let start = start_event(cell, options, &plan, first, (ctl, granted));
    announcer.publish(&start);
    // The loop reports changes only, and this is its initial state.
    announcer.publish(&Event::State { state: StateName::Enabling, iteration: first });

    let parts = Parts { announcer, keeper, claim, policy, learner, mail, frozen, start };
    let mut running = Running::new(cell, options, plan, parts, resumed);
    follow(&mut pacer, &mut running, recorder.as_mut());
    let outcome = running.end(pacer, cell, options);
    if let Some(why) = recorder.as_mut().and_then(Recorder::end) {
        tracing::warn!("{why}");
    }
    Ok(outcome)
}

/// Completes the plan of the loop with the runs and the options of a campaign.
fn complete(plan: &mut Plan, cell: &Cell, options: &Options, runs: Range<u32>) {
    let session = &options.session;
    plan.servo.runs = runs;
    plan.servo.resets_faults |= session.reset_faults;
    plan.simulated = session.simulated;
    plan.servo.starts_on_input = options.start == StartOn::Input;
    if session.forgives_stalls() {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 s")]
        let patience = (SIMULATED_PATIENCE_S / cell.cycle_s()) as u32;
        plan.servo.hold_cycles_max = patience;
        plan.servo.forgive_overruns(patience);
    }
}

/// Follows the loop until it has ended.
fn follow(pacer: &mut Pacer, running: &mut Running<'_>, mut recorder: Option<&mut Recorder>) {
    loop {
        let has_ended = pacer.poll();
        running.read_mail();
        if let Some(recorder) = &mut recorder
            && let Some(why) = recorder.poll()
        {
            running.recording(recorder, why);
        }
        if has_ended {
            return;
        }
    }
}

fn open_library(options: &Options) -> Result<Library, CampaignError> {
    let path = &options.session.library;
    if options.resume && !path.exists() {
        return Err(ResumeError::NoLibrary { path: path.clone() }.into());
    }
    let reads = options.frozen && options.input_file.is_none() || options.parameters_from.is_some();
    if reads && !path.exists() {
        return Err(InputError::NoLibrary { path: path.display().to_string() }.into());
    }
    Ok(Library::open(path)?)
}

/// Claims a new campaign, or the newest one of the same kind with its runs and its next input.
fn begin_or_resume(
    library: &Library,
    cell: &Cell,
    options: &Options,
    campaign: &mut Campaign,
    policy: &mut RollbackPolicy,
) -> Result<(Claim, Resumed), CampaignError> {
    let path = &options.session.library;
    let plan = &mut campaign.plan;
    let mut law = campaign.law.as_deref_mut();
    let disturbance = options.disturbance.clone().or_file(cell);
    plan.meta.campaign =
        if options.resume { to_resume(library, plan)? } else { library.new_campaign()? };
    // Claimed before it is read: runs that another program adds meanwhile would be made twice.
    let held = claim(path, &plan.meta.campaign)?;
    if let Some(law) = law.as_deref_mut() {
        policy.recall(library, plan, law)?;
    }
    let resumed = if options.resume {
        policy.resume(library, &plan.meta, law.as_deref_mut(), &disturbance)?
    } else {
        let next_disturbance = disturbance.of(0)?;
        if let Some(law) = law.as_deref_mut() {
            set_disturbance(law, &next_disturbance);
        }
        if !options.frozen {
            let law = law.as_deref_mut();
            let own = first_input(library, options, (cell, plan), law, policy)?;
            campaign.input = own.or(campaign.input.take());
        }
        Resumed { next_disturbance, ..Resumed::default() }
    };
    if let Some(expected) = law.and_then(|law| law.n_disturbances())
        && expected != resumed.next_disturbance.len()
    {
        let found = resumed.next_disturbance.len();
        let source = LearningError::Disturbance { found, expected };
        let file = cell.file.display().to_string();
        return Err(DesignError::Learning { file, source }.into());
    }
    Ok((held, resumed))
}

fn start_event(
    cell: &Cell,
    options: &Options,
    plan: &Plan,
    first: u32,
    (ctl, granted): (Option<String>, Option<RtReport>),
) -> Event {
    Event::Start {
        schema: SCHEMA,
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
        mode: if options.session.lockstep { "lockstep" } else { "realtime" },
        ctl,
        rt: granted,
    }
}

//! The recording of a campaign: its place, its taps in the loop, and the description that a replay needs.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::error::CampaignError;
use super::options::{Options, Session};
use crate::config::Cell;
use crate::design::{self, Plan};
use crate::fieldbus::Bus;
use crate::fieldbus::cia402::PdoMap;
use crate::fieldbus::transport::TappedBus;
use crate::learning::Law;
use crate::record::{Event, fingerprint};
use crate::recording::{
    LoopSetup, MapText, Place, Recorder, RecordingError, VERSION, cell_digest, is_folder,
};
use crate::rt::{Clock, MonotonicClock, Nanos};
use crate::servo::{Cycle, Tap};

/// Bytes in a megabyte.
const MEGABYTE: u64 = 1_000_000;

/// Makes the recorder that the options or the cell ask for, if they do.
///
/// # Errors
/// [`CampaignError::Recording`] if its file cannot be made.
pub(super) fn begin(
    cell: &Cell,
    session: &Session,
    campaign: &str,
) -> Result<Option<Recorder>, CampaignError> {
    let section = &cell.recording;
    let in_folder = section.folder.clone().map(|folder| folder.join(""));
    let Some(mut path) = session.record.clone().or(in_folder) else { return Ok(None) };
    // A session of several experiments has a file for each, as each has a loop of its own.
    let earlier = session.recordings.fetch_add(1, Ordering::Relaxed);
    if earlier > 0 && !is_folder(&path) {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let end = path.extension().map(|end| format!(".{}", end.to_string_lossy()));
        path.set_file_name(format!("{stem}-{}{}", earlier + 1, end.unwrap_or_default()));
    }
    let axes: Vec<String> = cell.axes.iter().map(|axis| axis.name.clone()).collect();
    let pace = (cell.cycle_s(), session.lockstep);
    if let Some(file) = &session.record_to {
        let refused = |error: std::io::Error| RecordingError::Create {
            path: path.clone(),
            reason: error.to_string(),
        };
        let file = file.try_clone().map_err(refused)?;
        return Ok(Some(Recorder::into_open(file, &path, &axes, pace)?));
    }
    let bytes = section.keep_mb.map(|megabytes| u64::from(megabytes) * MEGABYTE);
    let place = Place { path, files: section.keep, bytes };
    Ok(Some(Recorder::create(&place, (&cell.cell.name, campaign), &axes, pace)?))
}

/// Returns the clock of the times in a recording; none in lock-step.
fn clock(session: &Session) -> Option<Arc<dyn Clock>> {
    (!session.lockstep).then(|| Arc::new(MonotonicClock::new(Nanos(0))) as Arc<dyn Clock>)
}

/// Returns the bus with its tap, and the tap of the loop.
pub(super) fn tap(
    recorder: Option<&mut Recorder>,
    cell: &Cell,
    session: &Session,
    bus: Box<dyn Bus>,
) -> (Box<dyn Bus>, Option<Tap>) {
    let Some(taps) = recorder.and_then(Recorder::taps) else { return (bus, None) };
    let count = taps.count;
    let tapped = TappedBus::new(bus, taps.traffic, Arc::clone(&count), clock(session));
    let period = Nanos::from_micros(cell.cell.cycle_us);
    let tap = Tap::new(taps.records, count, clock(session), period);
    (Box::new(tapped), Some(tap))
}

/// Returns a cycle with its tap.
pub(super) fn tapped(cycle: Cycle, tap: Option<Tap>) -> Cycle {
    match tap {
        Some(tap) => cycle.tapped(tap),
        None => cycle,
    }
}

/// Facts of a campaign that its recording tells.
pub(super) struct Facts {
    /// First run that counts.
    pub(super) first: u32,
    /// True for an experiment, whose set points rest.
    pub(super) holds: bool,
    /// Growth of the error at which the best input is restored.
    pub(super) growth_allowed: f64,
    /// Reason why the law cannot be run again.
    pub(super) law_is_not_run: Option<String>,
}

/// Notes the loop that is about to begin.
pub(super) fn describe(
    recorder: Option<&Recorder>,
    cell: &Cell,
    session: &Session,
    (plan, maps): (&Plan, &[PdoMap]),
    facts: Facts,
) -> Result<(), CampaignError> {
    let Some(recorder) = recorder else { return Ok(()) };
    let mut cell = cell.clone();
    if facts.holds {
        cell.program.start_m.clone_from(&plan.servo.start_m);
    }
    let text = toml::to_string(&cell).map_err(|error| CampaignError::NotDescribed {
        file: cell.file.display().to_string(),
        reason: error.to_string(),
    })?;
    let program = design::program_text(&cell)?;
    let servo = &plan.servo;
    let setup = LoopSetup {
        version: VERSION,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        campaign: plan.meta.campaign.clone(),
        lockstep: session.lockstep,
        simulated: session.simulated,
        measure: plan.meta.measure.clone(),
        hold_samples: facts.holds.then(|| plan.n_samples()),
        runs: servo.runs.clone(),
        first: facts.first,
        resets_faults: servo.resets_faults,
        starts_on_input: servo.starts_on_input,
        hold_cycles_max: servo.hold_cycles_max,
        overrun_cycles_max: servo.overrun_cycles_max,
        maps: maps.iter().map(MapText::from).collect(),
        axes: cell.axes.iter().map(|axis| axis.name.clone()).collect(),
        cell_digest: cell_digest(&text, &program),
        set_points_digest: digest(&plan.reference_m),
        growth_allowed: facts.growth_allowed,
        forgives_overruns: session.forgives_stalls(),
        law_is_not_run: facts.law_is_not_run,
    };
    recorder.notes().setup(setup, text, program);
    Ok(())
}

/// Returns the digest of numbers, bit by bit.
pub(super) fn digest(values: &[f64]) -> String {
    use std::fmt::Write as _;
    let mut bits = String::with_capacity(17 * values.len());
    for value in values {
        // Writing to a string cannot fail.
        let _ = write!(bits, "{:x} ", value.to_bits());
    }
    fingerprint(&bits)
}

/// Returns the reason why a replay cannot run a law again, if it cannot: what it learns from is not in the recording.
pub(super) fn law_is_not_run(
    law: Option<&(dyn Law + 'static)>,
    name: &str,
    options: &Options,
) -> Option<String> {
    let why = match law {
        None => "there is no law",
        Some(_) if name == "user" => "the law is not one of the catalogue",
        Some(_) if options.frozen => "the campaign began with a frozen input",
        Some(_) if options.resume => "the campaign was resumed, and its earlier runs are elsewhere",
        Some(_) if options.parameters_from.is_some() => "it began with parameters of another run",
        Some(law) if law.n_disturbances().is_some() => "it learns from a measured disturbance",
        Some(_) => return None,
    };
    Some(why.to_owned())
}

/// Returns the event that tells the end, or the losses, of a recording.
pub(super) fn event(recorder: &Recorder, reason: String) -> Event {
    let file = recorder.path().display().to_string();
    tracing::warn!("{file}: {reason}; the run goes on");
    Event::Recording { file, lost: recorder.lost(), reason: Some(reason) }
}

//! `ilc-rt identify`: an experiment with one axis, and the model that comes of it.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicI32;

use clap::{Args, ValueEnum};

use super::figures::FiguresFile;
use super::run::{MeasureName, bus_help, exit_status, open, say_event, stop_on_signals};
use super::{EXIT_BAD_INPUT, show};
use crate::campaign::{self, CampaignError, Disturbance, Options, Outcome};
use crate::config::{Cell, Measure};
use crate::identification::{
    Band, BandSearch, Described, Experiment, IdentificationError, Identified,
};
use crate::library::Library;
use crate::model::identify::{Doubt, Excitation, Waveform};
use crate::record::{EndStatus, Event};

/// Where an axis is excited if only the highest frequency is asked for.
const FALLBACK: Band = Band { from_hz: 1.0, to_hz: 50.0, period_s: 8.0 };

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt identify gantry.toml --axis x
  ilc-rt identify gantry.toml --axis x --amplitude 0.001 --from-hz 1 --to-hz 12 --json x.json")]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub(super) struct IdentifyArguments {
    /// Cell description.
    cell: PathBuf,
    /// Name of the axis.
    #[arg(long)]
    axis: String,
    /// What the axis is excited with.
    #[arg(long, visible_alias = "method", value_enum, default_value = "multisine")]
    waveform: WaveformName,
    /// Peak of the excitation, m (csp) or m/s (csv); half of what the limits allow if not given.
    #[arg(long, visible_aliases = ["amplitude-m", "amplitude-m-s"])]
    amplitude: Option<f64>,
    /// Lowest frequency; 1 Hz, or less for a slow axis.
    #[arg(long)]
    from_hz: Option<f64>,
    /// Highest frequency; tried out if not given.
    #[arg(long)]
    to_hz: Option<f64>,
    /// Length of a period; 8 s, or more for a slow axis.
    #[arg(long, visible_alias = "duration-s")]
    period_s: Option<f64>,
    /// Periods that are evaluated.
    #[arg(long, default_value_t = 5)]
    periods: usize,
    /// Where the axis is excited, instead of the program's start.
    #[arg(long, allow_negative_numbers = true)]
    at_m: Option<f64>,
    #[arg(long, value_name = "ADDRESS", help = bus_help())]
    bus: Option<String>,
    /// Measurement to look at instead of the cell's.
    #[arg(long, value_enum)]
    measure: Option<MeasureName>,
    /// Pace the loop by the drives' answers instead of the clock.
    #[arg(long)]
    lockstep: bool,
    /// The drives are simulated on this computer: forgive stalls of up to a second, which stall both.
    #[arg(long)]
    simulated_drives: bool,
    /// Stop the axes and end when standard input closes, as it does when the program that started this
    /// one ends.
    #[arg(long)]
    with_parent: bool,
    /// Where the experiment is kept.
    #[arg(long, value_name = "FILE", default_value = "ilc-library.db")]
    library: PathBuf,
    /// Write response, coherence, model and uncertainty to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Print one JSON object a line, and leave the evaluation to whoever reads them.
    #[arg(long)]
    events: bool,
    /// Do not publish on Zenoh.
    #[arg(long)]
    no_telemetry: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum WaveformName {
    Sweep,
    LinearSweep,
    Multisine,
}

/// Makes the experiment; returns the exit status.
pub(super) fn identify(arguments: &IdentifyArguments) -> u8 {
    let file = match &arguments.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, arguments.events) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    match experiment(arguments) {
        Ok((outcome, identified)) => {
            let doubt = identified.as_ref().and_then(|found| found.doubt);
            let written = match (&file, identified) {
                // What was measured is written all the same: it shows what is wrong.
                (Some(file), Some(found)) => file.write(&figures(&arguments.axis, &found)),
                (Some(file), None) => {
                    file.give_up();
                    true
                }
                (None, _) => true,
            };
            if let Some(doubt) = doubt {
                show::complain(&format_args!(
                    "no model for axis {}: {doubt}; try a larger amplitude or another band",
                    arguments.axis
                ));
            }
            exit_status(&outcome, written && doubt.is_none())
        }
        Err(error) => {
            if let Some(file) = file {
                file.give_up();
            }
            show::complain(&error);
            EXIT_BAD_INPUT
        }
    }
}

fn experiment(
    arguments: &IdentifyArguments,
) -> Result<(Outcome, Option<Identified>), CampaignError> {
    let cell = Cell::load(&arguments.cell)?;
    let stop = stop_on_signals(arguments.with_parent);
    let mut search = BandSearch::new(&cell, &laid_out(arguments, FALLBACK))?;
    if let Some(to_hz) = arguments.to_hz {
        let band = Band { to_hz, ..FALLBACK };
        let (outcome, found) = excite(arguments, &laid_out(arguments, band), &stop)?;
        return Ok((outcome, told(found)));
    }
    let mut best: Option<(Experiment, Identified)> = None;
    let mut last = None;
    while let Some(band) = search.next_band() {
        let (outcome, found) = match excite(arguments, &laid_out(arguments, band), &stop) {
            // An amplitude that was asked for may fit into a narrower band only.
            Err(CampaignError::Identification(IdentificationError::Experiment { .. }))
                if arguments.amplitude.is_some() && best.is_none() && search.is_open() =>
            {
                continue;
            }
            found => found?,
        };
        let completed = outcome.status == EndStatus::Completed;
        last = Some(outcome);
        let Some((experiment, found)) = found.filter(|_| completed) else { break };
        let left = 100.0 * found.residual_rms;
        let why = found.doubt.map_or(format!("the model leaves {left:.0} %"), |doubt| {
            let text = doubt.to_string();
            text.split(':').next().unwrap_or_default().to_owned()
        });
        show::say(&format_args!(
            "{:.3} to {:.3} Hz, amplitude {:.3e}: {why}",
            band.from_hz, band.to_hz, experiment.excitation.amplitude
        ));
        if search.judge(band, &found, best.as_ref().map(|(_, found)| found)) {
            best = Some((experiment, found));
        }
    }
    let Some(outcome) = last else {
        let band = Band { to_hz: 50.0, ..FALLBACK };
        let (outcome, found) = excite(arguments, &laid_out(arguments, band), &stop)?;
        return Ok((outcome, told(found)));
    };
    Ok((outcome, told(best)))
}

/// Prints what was found.
fn told(found: Option<(Experiment, Identified)>) -> Option<Identified> {
    found.map(|(experiment, identified)| {
        show::say(&describe(&experiment, &identified));
        identified
    })
}

/// The experiment that the arguments ask for, in a band where they say nothing of it.
fn laid_out(arguments: &IdentifyArguments, band: Band) -> Experiment {
    Experiment {
        axis: arguments.axis.clone(),
        excitation: Excitation {
            waveform: match arguments.waveform {
                WaveformName::Sweep => Waveform::LogarithmicSweep,
                WaveformName::LinearSweep => Waveform::LinearSweep,
                WaveformName::Multisine => Waveform::Multisine,
            },
            amplitude: arguments.amplitude.unwrap_or(1.0),
            from_hz: arguments.from_hz.unwrap_or(band.from_hz),
            to_hz: arguments.to_hz.unwrap_or(band.to_hz),
            period_s: arguments.period_s.unwrap_or(band.period_s),
            periods: arguments.periods,
        },
        at_m: arguments.at_m,
    }
}

/// Makes an experiment and evaluates it.
fn excite(
    arguments: &IdentifyArguments,
    experiment: &Experiment,
    stop: &Arc<AtomicI32>,
) -> Result<(Outcome, Option<(Experiment, Identified)>), CampaignError> {
    let (cell, bus) = open(&arguments.cell, arguments.bus.as_deref())?;
    let mut experiment = experiment.clone();
    if arguments.amplitude.is_none() {
        experiment = experiment.with_default_amplitude(&cell)?;
    }
    let options = Options {
        iterations: 1,
        measure: arguments.measure.map(Measure::from),
        lockstep: arguments.lockstep,
        simulated: arguments.simulated_drives,
        resume: false,
        library: arguments.library.clone(),
        disturbance: Disturbance::default(),
        telemetry: !arguments.no_telemetry,
        stop: Arc::clone(stop),
    };
    let mut kept = None;
    let mut observe = |event: &Event| {
        if let Event::Iteration { id, .. } = event {
            kept = Some(*id);
        }
        if arguments.events {
            say_event(event, &options.stop);
        } else if let Event::Fault { reason } = event {
            show::say(reason);
        }
    };
    let outcome = campaign::identify(&cell, &experiment, &options, bus, &mut observe)?;
    let (Some(id), EndStatus::Completed, false) = (kept, outcome.status, arguments.events) else {
        return Ok((outcome, None));
    };
    let record = Library::read(&arguments.library)?.load(id)?.record;
    let identified = Identified::new(&cell, &experiment, &record)?;
    Ok((outcome, Some((experiment, identified))))
}

/// The figures of `[axis.model]`; of an output that does not follow its input there are none.
fn describe(experiment: &Experiment, found: &Identified) -> String {
    let worst = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
    let head = format!(
        "axis {}: {} frequencies from {} to {} Hz, amplitude {:.3e}, coherence at least {:.4}",
        experiment.axis,
        found.measured.frequency_hz.len(),
        experiment.excitation.from_hz,
        experiment.excitation.to_hz,
        experiment.excitation.amplitude,
        worst(&found.measured.coherence),
    );
    if matches!(found.doubt, Some(Doubt::Incoherent { .. } | Doubt::Silent)) {
        return head;
    }
    let (figures, delay_s) = match found.described {
        Described::Position(model) => (
            format!(
                "natural frequency  {:>10.4} Hz\ndamping            {:>10.5}",
                model.natural_frequency_hz, model.damping
            ),
            model.delay_s,
        ),
        Described::Velocity(model) => {
            (format!("velocity bandwidth {:>10.4} Hz", model.bandwidth_hz), model.delay_s)
        }
    };
    format!(
        "{head}\n\
         gain               {:>10.5} +- {:.1e}\n\
         {figures}\n\
         delay              {:>10.4} ms\n\
         left over          {:>10.2} % rms{}",
        found.fit.model.gain,
        found.fit.gain_deviation,
        delay_s * 1e3,
        found.residual_rms * 100.0,
        if found.doubt.is_none() { format!("\n\n{}", found.section()) } else { String::new() }
    )
}

fn figures(axis: &str, found: &Identified) -> serde_json::Value {
    let (fit, measured) = (&found.fit, &found.measured);
    serde_json::json!({
        "axis": axis,
        "frequency_hz": measured.frequency_hz,
        "response_real": measured.response.iter().map(|h| h.re).collect::<Vec<_>>(),
        "response_imag": measured.response.iter().map(|h| h.im).collect::<Vec<_>>(),
        "coherence": measured.coherence,
        "n_averages": measured.n_averages,
        "model": {
            "gain": fit.model.gain,
            "natural_frequency_hz": fit.model.natural_frequency_hz,
            "damping": fit.model.damping,
            "delay_s": fit.model.delay_s,
            "residual_rms": fit.residual_rms,
        },
        "uncertainty": {
            "frequency_hz": found.uncertainty.frequency_hz,
            "bound": found.uncertainty.bound,
        },
        "doubt": found.doubt.map(|doubt| doubt.to_string()),
        "axis_model": found.doubt.is_none().then(|| found.section()),
    })
}

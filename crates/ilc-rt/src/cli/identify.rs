//! `ilc-rt identify`: experiments with one axis, and the model fitted to its response.

use std::path::PathBuf;

use clap::Args;

use super::figures::FiguresFile;
use super::run::{Output, exit_status, open, say_event, stop_on_signals};
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::campaign::{self, CampaignError, Outcome, Session};
use crate::config::Cell;
use crate::identification::{
    self, Described, Experiment, ExperimentOptions, Identified, Signals, waveform_name,
};
use crate::library::Library;
use crate::model::identify::Doubt;
use crate::record::{EndStatus, Event};

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt identify gantry.toml --axis x
  ilc-rt identify gantry.toml --axis x --amplitude 0.001 --from-hz 1 --to-hz 12 --json x.json")]
pub(super) struct IdentifyArguments {
    /// Cell description.
    cell: PathBuf,
    #[command(flatten)]
    options: IdentifyOptions,
    #[command(flatten)]
    output: Output,
}

/// Options of an identification, in what and how an axis is excited.
#[derive(Args, Clone, Debug)]
pub struct IdentifyOptions {
    /// The experiment.
    #[command(flatten)]
    pub experiment: ExperimentOptions,
    /// Bus, measurement, pace and library.
    #[command(flatten)]
    pub session: Session,
}

/// An experiment, and its model.
type Found = (Experiment, Identified);

/// Identifies an axis; returns the exit status.
pub(super) fn identify(arguments: &IdentifyArguments) -> u8 {
    let cell = match Cell::load(&arguments.cell) {
        Ok(cell) => cell,
        Err(error) => {
            show::complain(&error);
            return EXIT_BAD_INPUT;
        }
    };
    let file = match &arguments.output.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, arguments.output.events) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    match experiment(arguments, &cell) {
        Ok((outcome, found)) => {
            let doubt = found.as_ref().and_then(|(_, identified)| identified.doubt);
            let axis = found.as_ref().map_or_else(String::new, |(made, _)| made.axis.clone());
            let written = match (&file, &found) {
                // The measurement is written anyway: it shows the problem.
                (Some(file), Some((made, identified))) => {
                    file.write(&figures(&cell, made, identified))
                }
                (Some(file), None) => {
                    file.give_up();
                    true
                }
                (None, _) => true,
            };
            if let Some(doubt) = doubt {
                show::complain(&format_args!(
                    "no model for axis {axis}: {doubt}; try a larger amplitude or another band"
                ));
            }
            outcome.map_or(EXIT_FAILURE, |end| exit_status(&end, written && doubt.is_none()))
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

/// Executes experiments until a model fits; returns the end of the last one, and the model.
fn experiment(
    arguments: &IdentifyArguments,
    cell: &Cell,
) -> Result<(Option<Outcome>, Option<Found>), CampaignError> {
    let mut session = arguments.options.session.clone();
    session.stop = stop_on_signals(arguments.output.with_parent);
    let mut last = None;
    let mut excite = |experiment: &Experiment| -> Result<Option<Signals>, CampaignError> {
        let (outcome, signals) = excite(arguments, &session, experiment)?;
        last = Some(outcome);
        Ok(signals)
    };
    let mut report = |line: &str| {
        show::say(&line);
    };
    let found =
        identification::identify(cell, &arguments.options.experiment, &mut excite, &mut report)?;
    if let Some((experiment, identified)) = &found {
        show::say(&describe(experiment, identified));
    }
    Ok((last, found))
}

/// Executes one experiment and returns its signals; with `--events` the reader of the events has them.
fn excite(
    arguments: &IdentifyArguments,
    session: &Session,
    experiment: &Experiment,
) -> Result<(Outcome, Option<Signals>), CampaignError> {
    let (cell, bus) = open(&arguments.cell, session.bus.as_deref())?;
    let mut stored = None;
    let mut observe = |event: &Event| {
        if let Event::Iteration { id, .. } = event {
            stored = Some(*id);
        }
        if arguments.output.events {
            say_event(event, &session.stop);
        } else if let Event::Fault { reason, .. } = event {
            show::say(reason);
        }
    };
    let outcome = campaign::identify(&cell, experiment, session, bus, &mut observe)?;
    let is_evaluated = outcome.status == EndStatus::Completed && !arguments.output.events;
    let Some(id) = stored.filter(|_| is_evaluated) else { return Ok((outcome, None)) };
    let record = Library::read(&session.library)?.load(id)?.record;
    let signals = Signals { input: record.input, error_m: record.error_m };
    Ok((outcome, Some(signals)))
}

/// Describes the result; without a response there is no `[axis.model]`.
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
        Described::Position(fit) => (
            format!(
                "natural frequency  {:>10.4} Hz\ndamping            {:>10.5}",
                fit.model.natural_frequency_hz, fit.model.damping
            ),
            fit.model.delay_s,
        ),
        Described::Velocity(fit) => {
            (format!("velocity bandwidth {:>10.4} Hz", fit.model.bandwidth_hz), fit.model.delay_s)
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
        found.residual_rms() * 100.0,
        if found.doubt.is_none() { format!("\n\n{}", found.section()) } else { String::new() }
    )
}

/// Returns the content of the `--json` file, with the keys of `ilc identify`'s.
fn figures(cell: &Cell, made: &Experiment, found: &Identified) -> serde_json::Value {
    let (fit, measured) = (&found.fit, &found.measured);
    serde_json::json!({
        "axis": made.axis,
        "waveform": waveform_name(made.excitation.waveform),
        "amplitude": made.excitation.amplitude,
        "input_unit": made.input_unit(cell),
        "dt_s": fit.model.dt_s,
        "periods": made.excitation.periods,
        "frequency_hz": measured.frequency_hz,
        "response_real": measured.response.iter().map(|h| h.re).collect::<Vec<_>>(),
        "response_imag": measured.response.iter().map(|h| h.im).collect::<Vec<_>>(),
        "coherence": measured.coherence,
        "n_averages": measured.n_averages,
        "model": {
            "gain": fit.model.gain,
            "gain_deviation": fit.gain_deviation,
            "natural_frequency_hz": fit.model.natural_frequency_hz,
            "natural_frequency_deviation_hz": fit.natural_frequency_deviation_hz,
            "damping": fit.model.damping,
            "damping_deviation": fit.damping_deviation,
            "delay_s": fit.model.delay_s,
            "delay_deviation_s": fit.delay_deviation_s,
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

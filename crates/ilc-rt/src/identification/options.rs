//! Options of an identification: the one description of their names, ranges, defaults and help.
//!
//! `ilc-rt identify` parses its command line with it; `ilc identify` and Python read it through
//! [`crate::cli::described`] and hand their options over as such a command line.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::band::Band;
use super::error::IdentificationError;
use super::experiment::Experiment;
use crate::config::{Axis, Cell};
use crate::model::identify::{Excitation, Waveform};

/// Band of a single experiment.
const DEFAULT_BAND: Band = Band { from_hz: 1.0, to_hz: 50.0, period_s: 8.0 };

/// Options of an identification.
#[derive(Clone, Debug, Args)]
pub struct ExperimentOptions {
    /// Name of the axis; may be left out if the cell has one axis only.
    #[arg(long, value_name = "NAME")]
    pub axis: Option<String>,
    /// Waveform of the excitation.
    #[arg(long, default_value = "multisine", value_parser = waveforms())]
    pub waveform: Waveform,
    /// Peak of the excitation: m or rad (csp), m/s or rad/s (csv); half of what the limits allow if not given, 90 % of a torque.
    #[arg(long, value_name = "PEAK")]
    pub amplitude: Option<f64>,
    /// Lowest frequency; 1 Hz, or less for a slow axis, if not given.
    #[arg(long, value_name = "HZ")]
    pub from_hz: Option<f64>,
    /// Highest frequency; bands are searched for the best fit if not given.
    #[arg(long, value_name = "HZ")]
    pub to_hz: Option<f64>,
    /// Length of a period; 8 s, or more for a slow axis, if not given.
    #[arg(long, value_name = "SECONDS")]
    pub period_s: Option<f64>,
    /// Evaluated periods; their scatter is the noise.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = periods)]
    pub periods: usize,
    /// Position that the axis is excited around; the program's start if not given.
    #[arg(long, value_name = "POSITION", allow_negative_numbers = true)]
    pub at_m: Option<f64>,
    #[arg(long, hide = true, help = "--waveform", value_parser = renamed("--waveform"))]
    method: Option<String>,
    #[arg(long, hide = true, help = "--period-s", value_parser = renamed("--period-s"))]
    duration_s: Option<String>,
    #[arg(long, hide = true, help = "--amplitude", value_parser = renamed("--amplitude"))]
    amplitude_m: Option<String>,
    #[arg(long, hide = true, help = "--amplitude", value_parser = renamed("--amplitude"))]
    amplitude_m_s: Option<String>,
}

impl ExperimentOptions {
    /// Returns the named axis, or the only one.
    ///
    /// # Errors
    /// [`IdentificationError::Experiment`] if the cell has no such axis, or several and none is
    /// named.
    pub fn axis<'a>(&self, cell: &'a Cell) -> Result<&'a Axis, IdentificationError> {
        let found = match (&self.axis, &cell.axes[..]) {
            (None, [axis]) => Some(axis),
            (name, axes) => axes.iter().find(|axis| Some(&axis.name) == name.as_ref()),
        };
        found.ok_or_else(|| {
            let names: Vec<&str> = cell.axes.iter().map(|axis| axis.name.as_str()).collect();
            let name = self.axis.clone().unwrap_or_default();
            IdentificationError::Experiment {
                file: cell.file.display().to_string(),
                axis: name.clone(),
                what: "name".to_owned(),
                value: name,
                allowed: format!("this cell has {}", names.join(", ")),
            }
        })
    }

    /// Returns the experiment in a band, or in a default one; given options replace the band's own
    /// values. The default amplitude is half of the largest one, 90 % for a torque.
    ///
    /// # Errors
    /// [`IdentificationError::Experiment`] if it is beyond a limit of the axis.
    pub fn experiment(
        &self,
        cell: &Cell,
        band: Option<Band>,
    ) -> Result<Experiment, IdentificationError> {
        let experiment = Experiment {
            axis: self.axis(cell)?.name.clone(),
            excitation: self.excitation(band),
            at_m: self.at_m,
        };
        let experiment = match self.amplitude {
            Some(_) => experiment,
            None => experiment.with_default_amplitude(cell)?,
        };
        experiment.check(cell)?;
        Ok(experiment)
    }

    /// Returns the excitation in a band, or in a default one; given options replace the band's own values.
    pub fn excitation(&self, band: Option<Band>) -> Excitation {
        let band = band.unwrap_or(DEFAULT_BAND);
        Excitation {
            waveform: self.waveform,
            amplitude: self.amplitude.unwrap_or(1.0),
            from_hz: self.from_hz.unwrap_or(band.from_hz),
            to_hz: self.to_hz.unwrap_or(band.to_hz),
            period_s: self.period_s.unwrap_or(band.period_s),
            periods: self.periods,
        }
    }
}

/// The waveforms with their names, on a command line and in Python.
pub const WAVEFORMS: [(&str, Waveform); 3] = [
    ("sweep", Waveform::LogarithmicSweep),
    ("linear-sweep", Waveform::LinearSweep),
    ("multisine", Waveform::Multisine),
];

/// Returns the waveform of a name.
fn waveform(name: &str) -> Option<Waveform> {
    WAVEFORMS.iter().find(|(each, _)| *each == name).map(|(_, waveform)| *waveform)
}

/// Returns the name of a waveform.
pub fn waveform_name(waveform: Waveform) -> &'static str {
    WAVEFORMS.iter().find(|(_, each)| *each == waveform).map_or("", |(name, _)| *name)
}

fn waveforms() -> impl TypedValueParser<Value = Waveform> {
    PossibleValuesParser::new(WAVEFORMS.map(|(name, _)| name))
        .map(|name| waveform(&name).unwrap_or(Waveform::Multisine))
}

/// Largest number of periods.
const PERIODS_MAX: usize = 10_000;

fn periods(text: &str) -> Result<usize, String> {
    let allowed = || format!("allowed 2 to {PERIODS_MAX}, as one period shows no noise");
    text.parse().ok().filter(|n| (2..=PERIODS_MAX).contains(n)).ok_or_else(allowed)
}

/// Refuses an option of an older version with its new name.
fn renamed(name: &'static str) -> impl Fn(&str) -> Result<String, String> + Clone + Send + Sync {
    move |_: &str| Err(format!("this option is now {name}"))
}

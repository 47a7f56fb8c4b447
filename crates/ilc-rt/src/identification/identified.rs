//! Evaluation of an experiment: response of the axis, model, and residual.

use std::f64::consts::TAU;

use super::error::IdentificationError;
use super::experiment::{Experiment, Signals};
use crate::config::{Cell, InputKind, mode};
use crate::model::ModelError;
use crate::model::identify::{
    Averaging, Doubt, FrequencyResponse, Known, SecondOrder, SecondOrderFit, Uncertainty,
    VelocityLoopFit, doubt, fit_second_order, fit_velocity_loop, frequency_response, uncertainty,
};

/// Standard deviations of the measurement included in the uncertainty.
const DEVIATIONS: f64 = 3.0;
/// Residual relative to the best at which a shorter delay is preferred: the data hardly distinguish
/// a cycle of delay from a lower natural frequency, and the simpler model learns as well.
const WORTH_A_CYCLE: f64 = 1.05;
/// Largest delay of a cell description, in cycles.
const DELAY_MAX: usize = 20;
/// Motion per input below which the output counts as at rest: per metre or per m/s.
const STILL: f64 = 1e-6;
/// Likewise per newton: hundreds of them move a stiff axis by micrometres only.
const STILL_M_N: f64 = 1e-12;

/// Form of the model that describes an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// Second order with any gain: not an axis of a cell.
    Free,
    /// Position loop of a csp axis, from the velocity or torque behind it: any gain.
    Offset {
        /// The input is a torque, which shows the mass as well.
        is_torque: bool,
    },
    /// Loops of known gains around a mass, from a torque: any gain.
    Mass,
    /// Position loop of a csp axis: unit gain.
    Position,
    /// Velocity loop of a csv axis, in the position loop of the controller.
    Velocity {
        /// Gain of the position loop.
        position_gain_per_s: f64,
    },
}

impl Form {
    /// Returns the motion per input below which the output counts as at rest.
    fn still(self) -> f64 {
        match self {
            Self::Mass | Self::Offset { is_torque: true } => STILL_M_N,
            _ => STILL,
        }
    }
}

/// An identified axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// Response from the learned input to the measurement, in the band of the excitation.
    pub measured: FrequencyResponse,
    /// Second-order model with delay, discretised at the servo cycle.
    pub fit: SecondOrderFit,
    /// Model that `[axis.model]` can express: unit gain and whole cycles of delay.
    pub described: Described,
    /// Bound of the relative difference between the response and that model.
    pub uncertainty: Uncertainty,
    /// Reason not to use the model, if there is one.
    pub doubt: Option<Doubt>,
    /// Form of the described model.
    pub form: Form,
    /// Samples in a period.
    pub period_samples: usize,
    /// Input of the evaluated periods.
    pub input: Vec<f64>,
    /// Output of the evaluated periods.
    pub output: Vec<f64>,
}

/// Model of an axis in a cell description.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Described {
    /// Position loop of a csp axis, or an axis without a cell.
    Position(SecondOrderFit),
    /// Velocity loop of a csv axis, in the position loop of the controller.
    Velocity(VelocityLoopFit),
}

impl Described {
    /// Returns the parameter out of the range of a cell description, if there is one.
    fn beyond_cell(&self) -> Option<Doubt> {
        let (first, second) = match self {
            Self::Position(fit) => (
                ("natural frequency in Hz", fit.model.natural_frequency_hz, 0.1, 1000.0),
                ("damping", fit.model.damping, 0.05, 5.0),
            ),
            Self::Velocity(fit) => {
                let bandwidth = ("velocity bandwidth in Hz", fit.model.bandwidth_hz, 0.1, 10_000.0);
                (bandwidth, bandwidth)
            }
        };
        let delay = ("delay in cycles", self.delay_samples() as f64, 0.0, DELAY_MAX as f64);
        [first, second, delay]
            .into_iter()
            .find(|(_, value, low, high)| !(low..=high).contains(&value))
            .map(|(what, value, low, high)| Doubt::BeyondCell { what, value, low, high })
    }

    fn delay_samples(&self) -> usize {
        match self {
            Self::Position(fit) => fit.model.delay_samples(),
            Self::Velocity(fit) => fit.model.delay_samples(),
        }
    }

    fn residual_rms(&self) -> f64 {
        match self {
            Self::Position(fit) => fit.residual_rms,
            Self::Velocity(fit) => fit.residual_rms,
        }
    }
}

/// Fits the models of a form with several delays; returns the simplest of those that are as good as
/// the best.
fn describe(
    measured: &FrequencyResponse,
    free: &SecondOrder,
    dt_s: f64,
    form: Form,
) -> Result<Described, ModelError> {
    let second_order = |gain, n: usize| {
        let known = Known { gain, delay_s: Some(n as f64 * dt_s) };
        fit_second_order(measured, Some(dt_s), known).map(Described::Position)
    };
    let tried: Vec<Described> = match form {
        Form::Free => return second_order(None, free.delay_samples()),
        Form::Offset { .. } | Form::Mass => {
            delays(free, dt_s).map(|n| second_order(None, n)).collect::<Result<_, _>>()?
        }
        Form::Position => {
            delays(free, dt_s).map(|n| second_order(Some(1.0), n)).collect::<Result<_, _>>()?
        }
        Form::Velocity { position_gain_per_s } => delays(free, dt_s)
            .map(|n| {
                let delay_s = Some(n as f64 * dt_s);
                fit_velocity_loop(measured, position_gain_per_s, dt_s, delay_s)
                    .map(Described::Velocity)
            })
            .collect::<Result<_, _>>()?,
    };
    Ok(plainest(&tried).unwrap_or(tried[0]))
}

/// Returns the model of least delay among those within a cell's range and with the smallest
/// residuals.
fn plainest(tried: &[Described]) -> Option<Described> {
    let possible = |described: &&Described| described.beyond_cell().is_none();
    let any = tried.iter().any(|each| possible(&each));
    let among = || tried.iter().filter(|each| !any || possible(each));
    let least = among().map(Described::residual_rms).fold(f64::INFINITY, f64::min);
    among().find(|each| each.residual_rms() <= WORTH_A_CYCLE * least).copied()
}

/// Returns the delays to try: from zero to two cycles beyond the identified one.
fn delays(model: &SecondOrder, dt_s: f64) -> std::ops::Range<usize> {
    let found = (model.delay_s / dt_s).ceil().clamp(0.0, (DELAY_MAX - 2) as f64);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to 18")]
    let found = found as usize;
    0..found + 3
}

/// Returns a response of zero for an axis that rests, instead of one of rounding errors.
fn without_rounding(
    mut measured: FrequencyResponse,
    u: &[f64],
    y: &[f64],
    still: f64,
) -> FrequencyResponse {
    let range = |values: &[f64]| {
        let (low, high) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        high - low
    };
    if range(y) <= still * range(u) {
        for (response, coherence) in measured.response.iter_mut().zip(&mut measured.coherence) {
            (response.re, response.im, *coherence) = (0.0, 0.0, 0.0);
        }
    }
    measured
}

impl Identified {
    /// Evaluates whole periods of input and output: `H = Y / U`, a model, and its uncertainty.
    ///
    /// # Shapes
    /// - `u`, `y`: whole periods of `period_samples`
    /// # Errors
    /// [`ModelError`] if the response cannot be fitted.
    pub fn evaluate(
        u: Vec<f64>,
        y: Vec<f64>,
        period_samples: usize,
        band_hz: (f64, f64),
        dt_s: f64,
        form: Form,
    ) -> Result<Self, ModelError> {
        let averaging = Averaging::Periods { period_samples };
        let whole = frequency_response(&u, &y, dt_s, averaging)?.band(band_hz.0, band_hz.1);
        let measured = without_rounding(whole, &u, &y, form.still());
        let fit = fit_second_order(&measured, Some(dt_s), Known::default())?;
        let described = describe(&measured, &fit.model, dt_s, form)?;
        let model = match described {
            Described::Position(fit) => fit.model.response(&measured.frequency_hz),
            Described::Velocity(fit) => fit.model.response(&measured.frequency_hz),
        };
        let uncertainty = uncertainty(&measured, &model, DEVIATIONS)?;
        let beyond =
            || described.beyond_cell().filter(|_| !matches!(form, Form::Free | Form::Mass));
        let doubt = doubt(&measured, described.residual_rms()).or_else(beyond);
        Ok(Self {
            measured,
            fit,
            described,
            uncertainty,
            doubt,
            form,
            period_samples,
            input: u,
            output: y,
        })
    }

    /// Evaluates the signals of an experiment, over the periods that count.
    ///
    /// # Errors
    /// [`IdentificationError::Experiment`] or [`IdentificationError::Model`] if the signals belong to
    /// another experiment, or cannot be fitted.
    pub fn new(
        cell: &Cell,
        experiment: &Experiment,
        signals: &Signals,
    ) -> Result<Self, IdentificationError> {
        let (index, axis) = experiment.axis(cell)?;
        let signal = experiment.signal(cell)?;
        let n_axes = cell.n_axes();
        let expected = signal.values.len();
        if [&signals.input, &signals.error_m].iter().any(|each| each.len() != expected * n_axes) {
            let found = format!("{} samples", signals.input.len() / n_axes);
            let allowed = format!("{expected} samples of this experiment");
            return Err(experiment.refused(cell, "record", &found, &allowed));
        }
        let rows = signal.evaluated();
        let column = |values: &[f64], sign: f64| -> Vec<f64> {
            let rows = rows.start * n_axes..rows.end * n_axes;
            values[rows].chunks_exact(n_axes).map(|row| sign * row[index]).collect()
        };
        let is_torque = axis.input_kind() == InputKind::Torque;
        let form = match (axis.input_kind(), axis.position_loop) {
            (InputKind::Position, _) => Form::Position,
            (InputKind::Velocity, Some(position_loop)) => {
                Form::Velocity { position_gain_per_s: position_loop.gain_per_s }
            }
            _ if !mode::of(axis.interface).closes_position_loop() => Form::Offset { is_torque },
            _ => Form::Mass,
        };
        Self::evaluate(
            column(&signals.input, 1.0),
            // The set point is constant, so the error changes with the measurement.
            column(&signals.error_m, -1.0),
            signal.period_samples,
            (experiment.excitation.from_hz, experiment.excitation.to_hz),
            cell.cycle_s(),
            form,
        )
        .map_err(|source| IdentificationError::Model {
            file: cell.file.display().to_string(),
            source,
        })
    }

    /// Returns the relative RMS of the residual of the described model.
    pub fn residual_rms(&self) -> f64 {
        self.described.residual_rms()
    }

    /// Returns the section `[axis.model]` with the described model, for a cell description; for a torque also
    /// the mass, in `[axis.force]`.
    pub fn section(&self) -> String {
        let figures = match self.described {
            Described::Position(_) if self.form == Form::Mass => String::new(),
            Described::Position(SecondOrderFit { model, .. }) => format!(
                "natural_frequency_hz = {:.3}\ndamping = {:.4}\n",
                model.natural_frequency_hz, model.damping
            ),
            Described::Velocity(VelocityLoopFit { model, .. }) => {
                format!("velocity_bandwidth_hz = {:.3}\n", model.bandwidth_hz)
            }
        };
        let delay = self.described.delay_samples();
        let mass = self.mass_kg().map_or_else(String::new, |mass_kg| {
            format!("\n# beside what is there\n[axis.force]\nmass_kg = {mass_kg:.4}\n")
        });
        format!("[axis.model]\n{figures}delay_samples = {delay}\n{mass}")
    }

    /// Returns the moving mass that a torque shows: above the natural frequency of its loops only the mass
    /// acts, `y/F = 1 / (m s^2)`, so `m = 1 / (K w0^2)`.
    pub fn mass_kg(&self) -> Option<f64> {
        let (Described::Position(fit), Form::Mass | Form::Offset { is_torque: true }) =
            (self.described, self.form)
        else {
            return None;
        };
        let natural_rad_s = TAU * fit.model.natural_frequency_hz;
        Some(1.0 / (fit.model.gain * natural_rad_s * natural_rad_s))
    }
}

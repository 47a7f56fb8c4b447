//! Gradient ILC without a model: the adjoint is measured, by runs with the reversed error.

#[cfg(test)]
mod oracle;
mod parameters;
mod probe;

pub use parameters::ModelFreeParameters;

use crate::learning::error::{check, check_counts, check_length, check_update};
use crate::learning::{Law, LearningError, Purpose, Result, Surrogate};

use probe::{Came, came, largest_within, scaled_reverse};

/// Runs in a row whose input was not the one asked for, after which an iteration is given up.
const ATTEMPTS_MAX: u32 = 8;
/// Share of the asked size below which a channel's input is not worth a run: its bound leaves no room.
const ROOM: f64 = 1e-3;

/// Parameters of a [`ModelFree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelFreeRule {
    /// Step alpha; `None` for the best one of each iteration, by a third run.
    pub gain: Option<f64>,
    /// Size of the probing inputs relative to the error, input units per error unit.
    pub probe: f64,
}

impl Default for ModelFreeRule {
    fn default() -> Self {
        Self { gain: None, probe: 0.1 }
    }
}

/// Gradient ILC whose adjoint is measured: the plant itself is run with the reversed error.
///
/// `u_{j+1} = u_j + alpha P' e_j`, `P' e = R P R e`, R the reversal of time
///
/// One iteration takes two runs, the learning run and the probing run, or three without a gain: the
/// searching run, along the gradient, gives the step `alpha = <e, P g> / |P g|^2`. [`Law::purpose`]
/// says what the next run is for. The difference of two runs removes what is the same in both, such
/// as friction at the same velocity or the reference.
///
/// P must be linear and time-invariant, and every channel an axis of its own: then P is symmetric
/// about its antidiagonal. All channels are probed in the same run, each with its own error and step.
///
/// A probing input that does not fit within the bound of the input is made smaller, or given the other
/// sign. If the rate limit of the loop changed an input, the run is repeated with half the probing size;
/// if a run used an older input because its own came too late, it is repeated unchanged.
///
/// # Shapes
/// - `input`, `next`, `error`: `n_samples` x `n_channels`
/// # Real Time
/// Cold path. Allocates at creation, never in [`Law::update`].
/// # Source
/// - \[bolder2018\].
#[derive(Debug, Clone)]
pub struct ModelFree {
    rule: ModelFreeRule,
    n_samples: usize,
    /// Bound of the input of each channel.
    input_max: Vec<f64>,
    purpose: Purpose,
    /// Input and error of the learning run of this iteration.
    input: Vec<f64>,
    error: Vec<f64>,
    /// The reversed error, and then the gradient.
    direction: Vec<f64>,
    /// Size along the direction of the run that was asked for, of each channel.
    sizes: Vec<f64>,
    asked: Vec<f64>,
    attempts: u32,
    status: Option<&'static str>,
}

impl ModelFree {
    /// Creates the law for runs of `n_samples` samples.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a gain or probe that is not positive and finite.
    /// - [`LearningError::Empty`] for 0 samples or channels.
    pub fn new(rule: ModelFreeRule, n_samples: usize, n_channels: usize) -> Result<Self> {
        check_counts(&[("n_samples", n_samples), ("n_channels", n_channels)])?;
        for (what, value, least, greatest) in [
            ("gain", rule.gain.unwrap_or(1.0), f64::MIN_POSITIVE, 1e12),
            ("probe", rule.probe, 1e-9, 1e9),
        ] {
            if !(least..=greatest).contains(&value) {
                let allowed = "a gain must be above 0 and at most 1e12, a probe 1e-9 to 1e9";
                return Err(LearningError::Parameter { what, value, allowed });
            }
        }
        let size = n_samples * n_channels;
        Ok(Self {
            rule,
            n_samples,
            input_max: vec![f64::INFINITY; n_channels],
            purpose: Purpose::Learning,
            input: vec![0.0; size],
            error: vec![0.0; size],
            direction: vec![0.0; size],
            sizes: vec![0.0; n_channels],
            asked: vec![0.0; size],
            attempts: 0,
            status: None,
        })
    }

    /// Keeps the inputs of probing and searching runs within bounds, one per channel.
    ///
    /// # Errors
    /// - [`LearningError::Parameter`] for a bound that is negative or NaN;
    ///   [`LearningError::Length`] for another number of bounds.
    pub fn within(mut self, input_max: &[f64]) -> Result<Self> {
        check_length("input_max", input_max, 1, self.n_channels())?;
        if let Some(value) = input_max.iter().copied().find(|max| max.is_nan() || *max < 0.0) {
            let allowed = "a bound must not be negative";
            return Err(LearningError::Parameter { what: "input_max", value, allowed });
        }
        self.input_max.copy_from_slice(input_max);
        Ok(self)
    }

    fn n_channels(&self) -> usize {
        self.input_max.len()
    }

    /// Returns the values of one channel of a signal.
    fn channel(&self, signal: &[f64], channel: usize) -> impl DoubleEndedIterator<Item = f64> {
        signal.iter().skip(channel).step_by(self.n_channels()).copied()
    }

    /// Asks for a run at the sizes along the direction; returns false if no channel has room for it.
    fn ask(&mut self, purpose: Purpose, next: &mut [f64]) -> bool {
        let n_channels = self.n_channels();
        let mut has_room = false;
        for channel in 0..n_channels {
            let (input, along) =
                (self.channel(&self.input, channel), self.channel(&self.direction, channel));
            let wanted = self.sizes[channel];
            let found = largest_within(self.input_max[channel], wanted, input.zip(along));
            let counts = found.abs() >= ROOM * wanted && found != 0.0;
            self.sizes[channel] = if counts { found } else { 0.0 };
            has_room |= counts;
        }
        if !has_room {
            return false;
        }
        self.move_along(next);
        self.asked.copy_from_slice(next);
        (self.purpose, self.attempts) = (purpose, 0);
        true
    }

    /// Writes the learned input plus the direction times the sizes.
    fn move_along(&self, next: &mut [f64]) {
        let sizes = self.sizes.iter().cycle();
        for (((next, input), along), size) in
            next.iter_mut().zip(&self.input).zip(&self.direction).zip(sizes)
        {
            *next = input + size * along;
        }
    }

    /// Ends the iteration at the input that it began with.
    fn keep(&mut self, why: Option<&'static str>, next: &mut [f64]) {
        next.copy_from_slice(&self.input);
        (self.purpose, self.status) = (Purpose::Learning, why);
    }

    /// Begins an iteration: asks for the probing run.
    fn begin(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) {
        self.input.copy_from_slice(input);
        self.error.copy_from_slice(error);
        self.status = None;
        let n_channels = self.n_channels();
        scaled_reverse(error, &[], &mut self.direction, n_channels);
        for channel in 0..self.n_channels() {
            let is_zero = self.channel(error, channel).all(|value| value == 0.0);
            self.sizes[channel] = if is_zero { 0.0 } else { self.rule.probe };
        }
        if self.sizes.iter().all(|size| *size == 0.0) {
            self.keep(None, next);
        } else if !self.ask(Purpose::Probing, next) {
            self.keep(Some(NO_ROOM), next);
        }
    }

    /// Takes the gradient from a probing run: makes a step, or asks for the searching run.
    fn probed(&mut self, error: &[f64], next: &mut [f64]) {
        // The effect of the probing input, per unit of it.
        self.asked.iter_mut().zip(&self.error).zip(error).for_each(|((to, before), now)| {
            *to = before - now;
        });
        let mut steps = std::mem::take(&mut self.sizes);
        let n_channels = self.n_channels();
        scaled_reverse(&self.asked, &steps, &mut self.direction, n_channels);
        for (channel, step) in steps.iter_mut().enumerate() {
            let square = |values: &[f64]| -> f64 {
                self.channel(values, channel).map(|value| value * value).sum()
            };
            let (error, answer) = (square(&self.error), square(&self.direction));
            // A cautious step for the search: |P| is at least |P R e| / |e|.
            let search = if answer > 0.0 { error / answer * step.abs() } else { 0.0 };
            *step = self.rule.gain.unwrap_or(search);
        }
        self.sizes = steps;
        if self.rule.gain.is_some() || self.sizes.iter().all(|step| *step == 0.0) {
            self.move_along(next);
            self.purpose = Purpose::Learning;
        } else if !self.ask(Purpose::Searching, next) {
            self.keep(Some(NO_ROOM), next);
        }
    }

    /// Makes the best step from a searching run.
    fn searched(&mut self, error: &[f64], next: &mut [f64]) {
        for channel in 0..self.n_channels() {
            let step = self.sizes[channel];
            let (mut with_error, mut size) = (0.0, 0.0);
            if step != 0.0 {
                let both = self.channel(&self.error, channel).zip(self.channel(error, channel));
                for (before, now) in both {
                    let along = (before - now) / step;
                    with_error += before * along;
                    size += along * along;
                }
            }
            self.sizes[channel] = if size > 0.0 { with_error / size } else { 0.0 };
        }
        self.move_along(next);
        self.purpose = Purpose::Learning;
    }

    /// Asks again for a run that was not made as asked.
    fn ask_again(&mut self, was_limited: bool, next: &mut [f64]) {
        self.attempts += 1;
        if self.attempts >= ATTEMPTS_MAX {
            return self.keep(Some(NOT_AS_ASKED), next);
        }
        if was_limited {
            self.sizes.iter_mut().for_each(|size| *size *= 0.5);
        }
        self.move_along(next);
        self.asked.copy_from_slice(next);
    }
}

const NO_ROOM: &str =
    "the input is at its bound: the gradient cannot be measured, and the input is kept";
const NOT_AS_ASKED: &str = "the inputs that measure the gradient were not applied as asked, e.g. by the rate limit of the \
                            input: nothing is learned from them, and the input is kept";

impl Law for ModelFree {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let n_channels = self.n_channels();
        check_update(input, error, next, self.n_samples, [n_channels; 2])?;
        if self.purpose == Purpose::Learning {
            self.begin(input, error, next);
            return check("next", next, self.n_samples, n_channels);
        }
        match came(&self.input, &self.asked, input, n_channels) {
            Came::AsAsked if self.purpose == Purpose::Probing => self.probed(error, next),
            Came::AsAsked => self.searched(error, next),
            Came::Limited => self.ask_again(true, next),
            Came::Other => self.ask_again(false, next),
        }
        check("next", next, self.n_samples, n_channels)
    }

    fn purpose(&self) -> Purpose {
        self.purpose
    }

    fn measures(&self) -> bool {
        true
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Gradient { gain: self.rule.gain }
    }

    fn on_rollback(&mut self) {
        self.reset();
    }

    fn status(&self) -> Option<String> {
        self.status.map(str::to_owned)
    }

    fn reset(&mut self) {
        (self.purpose, self.status, self.attempts) = (Purpose::Learning, None, 0);
    }

    fn describe(&self) -> String {
        let gain = self.rule.gain.map_or_else(|| "null".to_owned(), |gain| gain.to_string());
        format!(
            r#"{{"law":"model_free","gain":{gain},"probe":{},"n_samples":{},"n_channels":{}}}"#,
            self.rule.probe,
            self.n_samples,
            self.n_channels()
        )
    }
}

//! Learning laws: from one run's error to the next run's input.
//!
//! This folder holds the [`Law`] trait, one law a file under [`law`], the linear-time solver
//! ([`sweep`]) that the optimal ones share, and what goes round any law: when to stop ([`gate`]) and
//! how many runs to average ([`ladder`]); [`analysis`] says before the first run whether a law will
//! converge, and [`tune`] proposes weights. It runs between iterations, never in the tick; `config`,
//! `design` and the Python bindings may import it.
//!
//! Family: `error`, `krylov`, `law`, `operator`, `structure` and `weights` share the error of the folder,
//! which carries that of the bounds, and a law answers with the structure that the analysis asks for.

pub mod analysis;
mod error;
pub mod gate;
mod krylov;
pub mod ladder;
pub mod law;
mod operator;
mod repeatability;
mod structure;
pub mod sweep;
pub mod tune;
pub mod weights;

pub use error::LearningError;
pub use repeatability::{Repeatability, repeatability};
pub use structure::{LowPass, Structure, Surrogate};

/// A rule that turns the error of one run into the input of the next.
///
/// # Shapes
/// - all signals time first, sample `k` of channel `i` at `k * n_channels + i`: `input` and `next`
///   have `n_samples` x `n_inputs`, `error` has `n_samples` x `n_outputs`
/// - `error[k] = reference[k] - measured[k]` on the grid of `input`: `input[k]` acts from sample `k`
///   on and shows at `k + 1` at the earliest unless the axis has direct feedthrough. Each law pairs
///   the samples itself; the caller shifts nothing.
pub trait Law: Send {
    /// Computes the input of the next run.
    ///
    /// # Real Time
    /// Cold path, but allocates nothing: it may run while the axes return to the start.
    /// # Errors
    /// - [`LearningError::Length`] or [`LearningError::NotFinite`]; `next` is then not to be used.
    fn update(
        &mut self,
        input: &[f64],
        error: &[f64],
        next: &mut [f64],
    ) -> Result<(), LearningError>;

    /// Tells the law what is known of the coming run before [`Law::update`] computes its input: one
    /// number for each disturbance that is measured, as a temperature. Most laws have no use for it.
    fn set_disturbance(&mut self, disturbance: &[f64]) {
        let _ = disturbance;
    }

    /// Returns how many numbers describe the disturbance of a run, for a law that must be told;
    /// `None` for one that has no use for it.
    fn n_disturbances(&self) -> Option<usize> {
        None
    }

    /// Learns from a run that was made earlier, under a disturbance like those announced; returns
    /// whether the law has use for it.
    ///
    /// # Errors
    /// - as [`Law::update`], or [`LearningError::Disturbance`].
    fn recall(
        &mut self,
        input: &[f64],
        error: &[f64],
        disturbance: &[f64],
    ) -> Result<bool, LearningError> {
        let _ = (input, error, disturbance);
        Ok(false)
    }

    /// Applies the transpose of the update's linear part: `to_input = L_u' dual`,
    /// `to_error = L_e' dual`, where the update is `next = L_u input + L_e error`.
    ///
    /// Returns whether the law can; one that cannot is analysed by its columns, in short runs only.
    ///
    /// # Errors
    /// - as [`Law::update`].
    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool, LearningError> {
        let _ = (dual, to_input, to_error);
        Ok(false)
    }

    /// Returns what is known of the law beyond its update; [`analysis`] uses it where it can.
    fn structure(&self) -> Structure<'_> {
        Structure::Unknown
    }

    /// Returns the law that [`analysis`] looks at where this one is not linear itself.
    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Itself
    }

    /// Returns the law's low-pass for a sample time, if it has one that can be told from the rest.
    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        let _ = dt_s;
        None
    }

    /// Tells the law that its last input is rolled back, as the error grew with it: the run to
    /// come has an earlier input. Most laws look at one run only and have no use for it.
    fn on_rollback(&mut self) {}

    /// Returns whether the law restores an earlier input where the error grows, so that its caller should
    /// not.
    fn handles_rollback(&self) -> bool {
        false
    }

    /// Returns what a person should know of the last update, as a sentence; most have nothing to say.
    fn status(&self) -> Option<String> {
        None
    }

    /// Returns whether the law goes on learning after the last update.
    fn standing(&self) -> Standing {
        Standing::Learns
    }

    /// Forgets everything that earlier runs taught the law itself.
    fn reset(&mut self);

    /// Returns the law and its parameters as one line of JSON, for the record of the run.
    fn describe(&self) -> String;
}

/// Outcome of the last update of a law that may also rest.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// It learned.
    #[default]
    Learns,
    /// It keeps the input, as the error is good enough.
    Holds,
    /// The error had grown: it restored the best input, and rests.
    GoesBack,
    /// It rests with the best input.
    Rests,
}

impl<L: Law + ?Sized> Law for Box<L> {
    fn update(
        &mut self,
        input: &[f64],
        error: &[f64],
        next: &mut [f64],
    ) -> Result<(), LearningError> {
        (**self).update(input, error, next)
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        (**self).set_disturbance(disturbance);
    }

    fn n_disturbances(&self) -> Option<usize> {
        (**self).n_disturbances()
    }

    fn recall(
        &mut self,
        input: &[f64],
        error: &[f64],
        disturbance: &[f64],
    ) -> Result<bool, LearningError> {
        (**self).recall(input, error, disturbance)
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool, LearningError> {
        (**self).apply_adjoint(dual, to_input, to_error)
    }

    fn structure(&self) -> Structure<'_> {
        (**self).structure()
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        (**self).linear_surrogate()
    }

    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        (**self).low_pass(dt_s)
    }

    fn on_rollback(&mut self) {
        (**self).on_rollback();
    }

    fn handles_rollback(&self) -> bool {
        (**self).handles_rollback()
    }

    fn status(&self) -> Option<String> {
        (**self).status()
    }

    fn standing(&self) -> Standing {
        (**self).standing()
    }

    fn reset(&mut self) {
        (**self).reset();
    }

    fn describe(&self) -> String {
        (**self).describe()
    }
}

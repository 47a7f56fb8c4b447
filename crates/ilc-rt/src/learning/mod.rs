//! Learning laws: from one run's error to the next run's input.
//!
//! This folder holds the [`Law`] trait, one law per file under [`law`], the linear-time solver
//! ([`sweep`]) shared by the norm-optimal laws, and wrappers of any law: when to stop ([`gate`]) and
//! how many runs to average ([`ladder`]). [`analysis`] predicts convergence before the first run, and
//! [`tune`] proposes weights, and [`batch`] lets a law learn on many plants at once. It runs between iterations, never in the tick; `config`, `design` and
//! the Python bindings may import it.
//!
//! Family: `error`, `krylov`, `law`, `operator`, `structure` and `weights` share the error of the folder,
//! which carries that of the bounds, and a law answers with the structure that the analysis asks for.

pub mod analysis;
pub mod batch;
mod error;
pub mod gate;
mod krylov;
pub mod ladder;
pub mod law;
mod operator;
mod purpose;
mod repeatability;
mod scaled;
mod span;
mod structure;
pub mod sweep;
pub mod tune;
pub mod weights;

pub use error::{LearningError, Result};
pub use purpose::Purpose;
pub use repeatability::{Repeatability, repeatability};
pub use scaled::Scaled;
pub use structure::{LowPass, Structure, Surrogate};

/// A learning law: computes the input of the next run from the error of the last.
///
/// # Shapes
/// - all signals time first, sample `k` of channel `i` at `k * n_channels + i`: `input` and `next`
///   have `n_samples` x `n_inputs`, `error` has `n_samples` x `n_outputs`
/// - `error[k] = reference[k] - measured[k]` on the grid of `input`: `input[k]` acts from sample `k`
///   on and shows at `k + 1` at the earliest unless the axis has direct feedthrough. Each law pairs
///   the samples itself; the caller shifts nothing.
///
/// A wrapper names the law that it wraps ([`Law::inner`]): of what carries no signals, and what the
/// wrapper does not do itself, the defaults are those of the inner law.
pub trait Law: Send {
    /// Returns the inner law of a wrapper.
    fn inner(&self) -> Option<&dyn Law> {
        None
    }

    /// Returns the inner law of a wrapper.
    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        None
    }

    /// Computes the input of the next run.
    ///
    /// # Real Time
    /// Cold path, but does not allocate: it may run while the axes return to the start.
    /// # Errors
    /// - [`LearningError::Length`] or [`LearningError::NotFinite`]; the content of `next` is then
    ///   undefined.
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result;

    /// Passes the measured disturbance of the coming run, e.g. a temperature, before
    /// [`Law::update`] computes its input: one number per disturbance. Most laws ignore it.
    fn set_disturbance(&mut self, disturbance: &[f64]) {
        if let Some(inner) = self.inner_mut() {
            inner.set_disturbance(disturbance);
        }
    }

    /// Returns the number of disturbances that the law needs; `None` for a law that ignores them.
    fn n_disturbances(&self) -> Option<usize> {
        self.inner()?.n_disturbances()
    }

    /// Learns from an earlier run under a disturbance like those set; returns true if the law uses it.
    ///
    /// # Errors
    /// - as [`Law::update`], or [`LearningError::Disturbance`].
    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        let _ = (input, error, disturbance);
        Ok(false)
    }

    /// Takes over what an earlier run of another program shows about the axes, as parameters to begin with:
    /// `reference` and `input` are those of that run. Returns true if the law has such parameters.
    ///
    /// # Shapes
    /// - both: samples of that run x `n_inputs`
    /// # Errors
    /// - [`LearningError::Length`] or [`LearningError::NotFinite`].
    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        let _ = (reference, input);
        Ok(false)
    }

    /// Returns the input of the first run of a campaign, under the disturbance set for it; `None`
    /// for zero, as most laws begin.
    ///
    /// # Errors
    /// - as [`Law::update`].
    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        Ok(None)
    }

    /// Applies the adjoint (transpose) of the update's linear part: `to_input = L_u' dual`,
    /// `to_error = L_e' dual`, where the update is `next = L_u input + L_e error`.
    ///
    /// Returns true if the law implements it; otherwise it is analysed by columns, in short runs
    /// only.
    ///
    /// # Errors
    /// - as [`Law::update`].
    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
        let _ = (dual, to_input, to_error);
        Ok(false)
    }

    /// Returns the declared structure of the law; [`analysis`] uses it where it can.
    fn structure(&self) -> Structure<'_> {
        Structure::Unknown
    }

    /// Returns the linear law that [`analysis`] uses in place of a nonlinear one.
    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        Surrogate::Itself
    }

    /// Returns the law's low-pass (Q-filter) for a sample time, if it is separable from the law.
    fn low_pass(&self, dt_s: f64) -> Option<LowPass> {
        let _ = dt_s;
        None
    }

    /// Tells the law that its last input is rolled back, as the error grew with it: the run to
    /// come has an earlier input. Most laws look at one run only and have no use for it.
    fn on_rollback(&mut self) {
        if let Some(inner) = self.inner_mut() {
            inner.on_rollback();
        }
    }

    /// Returns whether the law restores an earlier input where the error grows, so that its caller should
    /// not.
    fn handles_rollback(&self) -> bool {
        self.inner().is_some_and(Law::handles_rollback)
    }

    /// Returns a status message about the last update; most laws have none.
    fn status(&self) -> Option<String> {
        self.inner()?.status()
    }

    /// Returns whether the law keeps learning after the last update.
    fn standing(&self) -> Standing {
        self.inner().map_or(Standing::Learns, Law::standing)
    }

    /// Returns the purpose of the next run, whose input the last update computed. Runs that only measure are
    /// never the best ones, and a larger error is not held against them.
    fn purpose(&self) -> Purpose {
        self.inner().map_or(Purpose::Learning, Law::purpose)
    }

    /// Returns true if some runs only measure ([`Law::purpose`]): a wrapper that changes their inputs or
    /// errors refuses such a law.
    fn measures(&self) -> bool {
        self.inner().is_some_and(Law::measures)
    }

    /// Resets the law's memory of earlier runs.
    fn reset(&mut self);

    /// Returns the law and its parameters as one line of JSON, for the record of the run.
    fn describe(&self) -> String;

    /// Returns the description that versions up to 0.1 stored for this law, if it was another.
    fn earlier_description(&self) -> Option<String> {
        None
    }
}

/// Outcome of the last update of a law that may also rest.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// Learning.
    #[default]
    Learns,
    /// Paused, with the input kept: the error is good enough.
    Holds,
    /// Rolled back: the error had grown, and the best input was restored; paused.
    GoesBack,
    /// Paused, with the best input.
    Rests,
}

impl<L: Law + ?Sized> Law for Box<L> {
    fn inner(&self) -> Option<&dyn Law> {
        (**self).inner()
    }

    fn inner_mut(&mut self) -> Option<&mut dyn Law> {
        (**self).inner_mut()
    }

    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        (**self).update(input, error, next)
    }

    fn set_disturbance(&mut self, disturbance: &[f64]) {
        (**self).set_disturbance(disturbance);
    }

    fn n_disturbances(&self) -> Option<usize> {
        (**self).n_disturbances()
    }

    fn recall(&mut self, input: &[f64], error: &[f64], disturbance: &[f64]) -> Result<bool> {
        (**self).recall(input, error, disturbance)
    }

    fn take_over(&mut self, reference: &[f64], input: &[f64]) -> Result<bool> {
        (**self).take_over(reference, input)
    }

    fn first_input(&mut self) -> Result<Option<Vec<f64>>> {
        (**self).first_input()
    }

    fn apply_adjoint(
        &mut self,
        dual: &[f64],
        to_input: &mut [f64],
        to_error: &mut [f64],
    ) -> Result<bool> {
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

    fn purpose(&self) -> Purpose {
        (**self).purpose()
    }

    fn measures(&self) -> bool {
        (**self).measures()
    }

    fn reset(&mut self) {
        (**self).reset();
    }

    fn describe(&self) -> String {
        (**self).describe()
    }

    fn earlier_description(&self) -> Option<String> {
        (**self).earlier_description()
    }
}

//! The model of the axes, time-invariant or time-varying.

use crate::model::{ModelError, StateSpace, TimeVarying};

/// A time-invariant or time-varying model.
#[derive(Debug, Clone, Copy)]
pub enum Plant<'a> {
    /// Time-invariant.
    Invariant(&'a StateSpace),
    /// One model per sample, for exactly the samples of a run.
    Varying(&'a TimeVarying),
}

impl<'a> From<&'a StateSpace> for Plant<'a> {
    fn from(model: &'a StateSpace) -> Self {
        Self::Invariant(model)
    }
}

impl<'a> From<&'a TimeVarying> for Plant<'a> {
    fn from(model: &'a TimeVarying) -> Self {
        Self::Varying(model)
    }
}

impl<'a> Plant<'a> {
    /// Returns the model if it is time-invariant.
    pub fn invariant(self) -> Option<&'a StateSpace> {
        match self {
            Self::Invariant(model) => Some(model),
            Self::Varying(_) => None,
        }
    }

    /// Returns the model at sample `k`.
    ///
    /// # Panics
    /// If the model varies and `k` is beyond the end of the run.
    pub fn at(self, k: usize) -> &'a StateSpace {
        match self {
            Self::Invariant(model) => model,
            Self::Varying(model) => model.at(k),
        }
    }

    /// Returns the distinct models: one, or one per sample.
    pub fn distinct(self) -> &'a [StateSpace] {
        match self {
            Self::Invariant(model) => std::slice::from_ref(model),
            Self::Varying(model) => model.samples(),
        }
    }

    /// Refuses a continuous model, or one with samples for another run length.
    ///
    /// # Errors
    /// - [`ModelError::Continuous`] or [`ModelError::Length`].
    pub fn check(self, n_samples: usize) -> Result<(), ModelError> {
        match self {
            Self::Invariant(model) if model.dt_s().is_none() => {
                Err(ModelError::Continuous { action: "norm-optimal learning" })
            }
            Self::Varying(model) if model.n_samples() != n_samples => Err(ModelError::Length {
                what: "model",
                found: model.n_samples(),
                allowed: format!("one for each of the {n_samples} samples of a run is needed"),
            }),
            _ => Ok(()),
        }
    }
}

/// A model that a group of axes owns.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::learning::law) enum OwnPlant {
    Invariant(StateSpace),
    Varying(TimeVarying),
}

impl OwnPlant {
    pub(in crate::learning::law) fn borrow(&self) -> Plant<'_> {
        match self {
            Self::Invariant(model) => Plant::Invariant(model),
            Self::Varying(model) => Plant::Varying(model),
        }
    }
}

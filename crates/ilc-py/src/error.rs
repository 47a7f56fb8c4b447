//! Mapping from errors of `ilc-rt` to Python exceptions.

use ilc_rt::trajectory::contour;
use ilc_rt::{
    campaign, config, design, identification, kinematics, learning, library, model, signal,
    trajectory,
};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::exceptions;

/// Converts an error of `ilc-rt` into the exception of its family, with the same sentence.
pub(crate) trait OrRaise<T> {
    /// Returns the value or the exception.
    fn or_raise(self) -> PyResult<T>;
}

impl<T, E> OrRaise<T> for Result<T, E>
where
    Raised: From<E>,
{
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| Raised::from(error).0)
    }
}

/// The exception of an error.
#[derive(Debug)]
pub(crate) struct Raised(pub(crate) PyErr);

/// Maps the errors of a module to an exception.
macro_rules! raise {
    ($($error:ty => $exception:ty),* $(,)?) => {
        $(impl From<$error> for Raised {
            fn from(error: $error) -> Self {
                Self(<$exception>::new_err(error.to_string()))
            }
        })*
    };
}

raise! {
    model::ModelError => exceptions::ModelError,
    signal::SignalError => exceptions::SignalError,
    trajectory::TrajectoryError => exceptions::TrajectoryError,
    trajectory::program::GcodeError => exceptions::TrajectoryError,
    kinematics::KinematicsError => exceptions::KinematicsError,
    contour::ContourError => exceptions::ContourError,
    model::identify::ResponseError => PyValueError,
    library::LibraryError => PyOSError,
    library::ElsewhereError => PyValueError,
    learning::batch::BatchError => exceptions::LearningError,
    config::ConfigError => PyValueError,
    design::DesignError => PyValueError,
    campaign::CampaignError => PyValueError,
}

impl From<learning::LearningError> for Raised {
    fn from(error: learning::LearningError) -> Self {
        use learning::LearningError::{Model, Signal};
        match error {
            Model(error) => error.into(),
            Signal(error) => error.into(),
            error => Self(exceptions::LearningError::new_err(error.to_string())),
        }
    }
}

impl From<identification::IdentificationError> for Raised {
    fn from(error: identification::IdentificationError) -> Self {
        use identification::IdentificationError::Model;
        Self(match error {
            Model { .. } => exceptions::ModelError::new_err(error.to_string()),
            error => PyValueError::new_err(error.to_string()),
        })
    }
}

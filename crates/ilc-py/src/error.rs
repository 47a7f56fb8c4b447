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

/// An exception, where an error of `ilc-rt` may come as well.
#[derive(Debug)]
pub(crate) struct Raised(pub(crate) PyErr);

impl<T> OrRaise<T> for Result<T, Raised> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|Raised(error)| error)
    }
}

/// Maps the errors of a module to an exception.
macro_rules! raise {
    ($($error:ty => $exception:ty),* $(,)?) => {
        $(impl<T> OrRaise<T> for Result<T, $error> {
            fn or_raise(self) -> PyResult<T> {
                self.map_err(|error| Raised::from(error).0)
            }
        }

        impl From<$error> for Raised {
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
    library::LibraryError => PyOSError,
    library::ElsewhereError => PyValueError,
    learning::batch::BatchError => exceptions::LearningError,
    config::ConfigError => PyValueError,
    design::DesignError => PyValueError,
    campaign::CampaignError => PyValueError,
}

impl<T> OrRaise<T> for Result<T, learning::LearningError> {
    fn or_raise(self) -> PyResult<T> {
        use learning::LearningError::{Model, Signal};
        self.or_else(|error| match error {
            Model(error) => Err(error).or_raise(),
            Signal(error) => Err(error).or_raise(),
            error => Err(exceptions::LearningError::new_err(error.to_string())),
        })
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

impl<T> OrRaise<T> for Result<T, identification::IdentificationError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(Raised::from).or_raise()
    }
}

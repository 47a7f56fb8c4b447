//! Which error of `ilc-rt` becomes which exception.

use ilc_rt::trajectory::contour;
use ilc_rt::{
    campaign, config, design, identification, kinematics, learning, library, model, signal,
    trajectory,
};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::exceptions;

/// Turns an error of `ilc-rt` into the exception of its family, with the same sentence.
pub(crate) trait OrRaise<T> {
    /// Returns the value or the exception.
    fn or_raise(self) -> PyResult<T>;
}

impl<T> OrRaise<T> for Result<T, model::ModelError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| exceptions::ModelError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, signal::SignalError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| exceptions::SignalError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, trajectory::TrajectoryError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| exceptions::TrajectoryError::new_err(error.to_string()))
    }
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

impl<T> OrRaise<T> for Result<T, config::ConfigError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| PyValueError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, library::LibraryError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| PyOSError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, design::DesignError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| PyValueError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, identification::IdentificationError> {
    fn or_raise(self) -> PyResult<T> {
        use identification::IdentificationError::Model;
        self.map_err(|error| match error {
            Model { .. } => exceptions::ModelError::new_err(error.to_string()),
            error => PyValueError::new_err(error.to_string()),
        })
    }
}

impl<T> OrRaise<T> for Result<T, campaign::CampaignError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| PyValueError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, kinematics::KinematicsError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| exceptions::KinematicsError::new_err(error.to_string()))
    }
}

impl<T> OrRaise<T> for Result<T, contour::ContourError> {
    fn or_raise(self) -> PyResult<T> {
        self.map_err(|error| exceptions::ContourError::new_err(error.to_string()))
    }
}

//! The exceptions of `ilc_rt`. All are `ValueError`: the caller passed an invalid value.

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;

create_exception!(ilc_rt, ModelError, PyValueError, "A model that cannot be used as asked.");
create_exception!(ilc_rt, SignalError, PyValueError, "A filter or signal that cannot be used.");
create_exception!(ilc_rt, LearningError, PyValueError, "A law or argument that cannot be used.");
create_exception!(ilc_rt.kinematics, KinematicsError, PyValueError, "No such pose or mechanism.");
create_exception!(ilc_rt.trajectory, ContourError, PyValueError, "Not a path or not an arc.");
create_exception!(ilc_rt, TrajectoryError, PyValueError, "A motion that cannot be planned.");

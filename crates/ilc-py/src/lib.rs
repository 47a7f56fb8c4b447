//! Python bindings of `ilc-rt`: conversion, shape checks and error mapping only.
//!
//! One file per family of Python names, exported below; `argument` checks input, `answer` returns values,
//! `exceptions` and `error` define the exceptions, and `detached` releases the interpreter.
//!
//! Family: `laws` and `python_law` call each other: an inner law may be written in Python.
//!
//! Family: `arguments`, `model` and `model_argument` read each other's arguments.

#![expect(clippy::doc_markdown, reason = "documentation here is Python's, in numpydoc style")]
#![expect(
    clippy::needless_pass_by_value,
    reason = "arguments are owned, as Python hands them over"
)]

mod analysis;
mod answer;
mod argument;
mod arguments;
mod campaign;
mod cell;
mod contour;
mod control;
mod detached;
mod error;
mod exceptions;
mod experiment;
mod guard;
mod identify;
mod kinematics;
mod laws;
mod library;
mod library_rows;
mod made;
mod many;
mod model;
mod model_argument;
mod move_plan;
mod python_law;
mod signal;
mod time_varying;
mod trajectory;
mod transport;
mod weights;
mod whole;

/// The compiled part of `ilc_rt`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "the name is Python's")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    const TUNING_RUNS_MAX: usize = ilc_rt::learning::tune::RUNS_MAX;
    #[pymodule_export]
    use super::{
        analysis::{analyze, refuse_divergent, repeatability, tune},
        campaign::{EventStream, check_options, described_options, run_events},
        cell::PyCell,
        contour::{PyArc, PyLine, contour_error, coupling_gains, projection_across},
        control::{PyCascade, PyCrossCoupled, PyPid},
        exceptions::{
            ContourError, KinematicsError, LearningError, ModelError, SignalError, TrajectoryError,
        },
        experiment::{evaluate_experiment, identify_axis, single_experiment},
        identify::{
            check_response, excitation, fit_rational, fit_second_order, fit_velocity_loop,
            frequency_response, relative_deviation, second_order_model, second_order_response,
            uncertainty, velocity_loop_response,
        },
        kinematics::{PyDelta, PyGantry},
        laws::{PyLaw, recalled::check_relevance_weights},
        library::PyLibrary,
        made::{_made, _made_of_kind, Made},
        many::simulate_many,
        model::{PyStateSpace, discretize, from_transfer_function, second_order},
        move_plan::PyMovePlan,
        signal::{PyFilter, instantaneous_frequency, zero_phase},
        time_varying::PyTimeVarying,
        trajectory::{
            butterfly, exponential_sigmoid, gcode, jerk_limited, modulated, raster, sigmoid_pair,
            spiral, spline, tracking_index,
        },
        transport::transports,
        weights::{
            band_filter, contour_weights, coupled_weights, formation_errors, formation_weights,
            schedule,
        },
    };
}

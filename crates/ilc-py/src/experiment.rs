//! Identification of an axis from Python: the search of `ilc_rt::identification` over experiments that
//! Python executes.

use ilc_rt::cli::parse;
use ilc_rt::identification::{
    self, Described, Experiment, ExperimentOptions, Form, Identified, Signals, waveform_name,
};
use ilc_rt::model::identify::Doubt;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::answer::{ByName, by_name, give_vector};
use crate::argument::read_vector;
use crate::arguments::Arguments;
use crate::cell::PyCell;
use crate::detached::computed;
use crate::error::{OrRaise, Raised};
use crate::identify::{give_measured, give_second_order, give_velocity_loop};

/// Identify an axis of a cell by experiments, in narrower bands until a model fits.
///
/// - cell : Cell: The cell.
/// - arguments : list of str: Options of the identification, as words of ``ilc-rt identify``.
/// - excite : callable: Called with a dict of the experiment's figures; returns learned input and
///   error as two arrays of shape (n_samples * n_axes,).
/// - report : callable: Called with a sentence on each band.
///
/// Returns dict: The experiment, its signals, response, models, uncertainty and doubt.
/// Raises ModelError if the response cannot be fitted.
/// Raises ValueError if an option cannot be used, or an amplitude is beyond a limit.
#[pyfunction]
pub(crate) fn identify_axis<'py>(
    py: Python<'py>,
    cell: &Bound<'py, PyCell>,
    arguments: Vec<String>,
    excite: &Bound<'py, PyAny>,
    report: &Bound<'py, PyAny>,
) -> ByName<'py> {
    let cell = &cell.get().cell;
    let options: ExperimentOptions = parse(&arguments).map_err(PyValueError::new_err)?;
    let mut raised = None;
    let mut call = |experiment: &Experiment| {
        let execute = || -> PyResult<Signals> {
            let told = excite.call1((figures(py, experiment)?,))?;
            let (input, error_m) = told.extract::<(Bound<'_, PyAny>, Bound<'_, PyAny>)>()?;
            Ok(Signals {
                input: read_vector("input", &input)?,
                error_m: read_vector("error", &error_m)?,
            })
        };
        execute().map(Some).map_err(Raised)
    };
    let mut tell = |line: &str| {
        if let Err(error) = report.call1((line,)) {
            raised.get_or_insert(error);
        }
    };
    let found = identification::identify(cell, &options, &mut call, &mut tell);
    if let Some(error) = raised {
        return Err(error);
    }
    let (experiment, identified) =
        found.or_raise()?.ok_or_else(|| PyValueError::new_err("no experiment was completed"))?;
    let result = describe(py, identified)?;
    result.set_item("experiment", figures(py, &experiment)?)?;
    Ok(result)
}

/// Return the experiment of options, words of ``ilc-rt identify``, in the default band if they give none.
#[pyfunction]
pub(crate) fn single_experiment(py: Python<'_>, arguments: Vec<String>) -> ByName<'_> {
    let options: ExperimentOptions = parse(&arguments).map_err(PyValueError::new_err)?;
    let axis = options.axis.clone().unwrap_or_default();
    let at_m = options.at_m;
    figures(py, &Experiment { axis, excitation: options.excitation(None), at_m })
}

/// Evaluate whole periods of input and output of any system, excited in a band in Hz.
///
/// Returns signals, response, models, uncertainty and doubt by name.
#[pyfunction]
pub(crate) fn evaluate_experiment<'py>(a: Arguments<'_, 'py>) -> ByName<'py> {
    let (u, y, dt_s) = (a.vector("u")?, a.vector("y")?, a.number("dt_s")?);
    let period_samples = a.whole("period_samples")?;
    let band_hz = (a.number("from_hz")?, a.number("to_hz")?);
    let evaluate = || Identified::evaluate(u, y, period_samples, band_hz, dt_s, Form::Free);
    describe(a.py(), computed(a.py(), evaluate)?)
}

/// Returns the figures of an experiment, as the arguments of `ilc_rt.experiment.Experiment`.
fn figures<'py>(py: Python<'py>, experiment: &Experiment) -> ByName<'py> {
    let excitation = &experiment.excitation;
    Ok(by_name!(py,
        [experiment => axis, at_m]
        [excitation => from_hz, to_hz, period_s, periods, amplitude]
        waveform: waveform_name(excitation.waveform),
    ))
}

/// Returns the result of an identification, as arguments of `ilc_rt.identification.Identification`.
fn describe(py: Python<'_>, found: Identified) -> ByName<'_> {
    let array = |values: Vec<f64>| give_vector(py, values);
    let is_lost = matches!(found.doubt, Some(Doubt::Incoherent { .. } | Doubt::Silent));
    let described = match &found.described {
        Described::Position(fit) => give_second_order(py, fit)?,
        Described::Velocity(fit) => give_velocity_loop(py, fit)?,
    };
    Ok(by_name!(py,
        [found => period_samples]
        axis_model: found.section(),
        followed: !is_lost,
        doubt: found.doubt.as_ref().map(ToString::to_string),
        model: give_second_order(py, &found.fit)?,
        described: described,
        measured: give_measured(py, found.measured)?,
        uncertainty: (array(found.uncertainty.frequency_hz), array(found.uncertainty.bound)),
        u: array(found.input),
        y: array(found.output),
    ))
}

//! Builders of laws with a memory of runs: `relevance` and `flexible`, filled from a library.

use ilc_rt::learning::law::flexible::{Flexible, TableShape};
use ilc_rt::learning::law::relevance::{Each, Relevance, RelevanceWeights, RunShape, Shelf};
use ilc_rt::learning::{Law, LearningError};
use ilc_rt::library::{Fitting, Library, LibraryError, Task};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use super::figure::{Figure, Readable};
use super::{Builder, Built, Call, Fits, Size};
use crate::argument::read_disturbance;
use crate::detached::detached;
use crate::error::OrRaise;
use crate::library::PyLibrary;
use crate::python_law::Channels;
use crate::whole::number;

/// Runs that are read from a library at a time.
const READ: usize = 256;

/// The laws of this file.
pub(super) const BUILDERS: &[Builder] = &[("relevance", relevance), ("flexible", flexible)];

pub(super) fn relevance(call: &Call<'_, '_>) -> PyResult<Built> {
    let a = call.arguments;
    let weights = read_weights(&a.get("weights")?)?;
    let top = a.maybe_whole("top")?;
    let dt_s = a.maybe_number("dt_s")?;
    let has_library = a.given("library")?.is_some();
    if weights.error_rate > 0.0 && dt_s.is_none() && !has_library {
        return Err(no_sample_time(&weights));
    }
    let size = call.size.unwrap_or(Size { n_disturbances: weights.disturbance.len(), ..Size::ONE });
    let earlier = Earlier::of(call)?;
    // Without a weight of the rate, and before the first run, the sample time has no effect.
    let is_used = weights.error_rate > 0.0 && call.size.is_some();
    let dt_s = dt_s.or(earlier.fitting.cycle_s).or((!is_used).then_some(1.0));
    let dt_s = dt_s.ok_or_else(|| no_sample_time(&weights))?;
    let Size { n_samples, channels: Channels { n_inputs, n_outputs }, n_disturbances } = size;
    let shape = RunShape { n_samples, n_inputs, n_outputs, n_disturbances, dt_s };
    let core = call.inner("core", size.channels)?;
    let mut law = Relevance::new(core, shape, weights, top).or_raise()?;
    let Some(library) = earlier.library else {
        return Ok(Built { law: Box::new(law), fits: Fits::First });
    };
    let law = detached(call.py(), move || -> Result<Relevance, PyErr> {
        let Fitting { runs, disturbances, error_squares, .. } = earlier.fitting;
        let mut shelf = LibraryShelf { library, runs };
        let error_sums = if law.needs_squares_only() {
            error_squares.iter().map(|squares| law.error_sum_of_squares(*squares)).collect()
        } else {
            shelf.error_sums(&law)?
        };
        law.remember_shelf(Box::new(shelf), &error_sums, &disturbances).or_raise()?;
        Ok(law)
    })?;
    Ok(Built { law: Box::new(law), fits: Fits::First })
}

pub(super) fn flexible(call: &Call<'_, '_>) -> PyResult<Built> {
    let tolerance = call.arguments.number("tolerance")?;
    let Earlier { library, fitting } = Earlier::of(call)?;
    let Size { n_samples, channels, n_disturbances } = call.size();
    let Channels { n_inputs, n_outputs } = channels;
    let shape = TableShape { n_samples, n_inputs, n_outputs, n_disturbances, tolerance };
    let mut law = Flexible::new(call.inner("core", channels)?, shape).or_raise()?;
    let Some(library) = library else {
        return Ok(Built { law: Box::new(law), fits: Fits::First });
    };
    let law = detached(call.py(), move || -> PyResult<Flexible> {
        let all: Vec<usize> = (0..fitting.runs.len()).collect();
        let mut shelf = LibraryShelf { library, runs: fitting.runs };
        let disturbances = fitting.disturbances;
        shelf
            .read(&all, &mut |run, input, error| {
                let disturbance = &disturbances[run * n_disturbances..][..n_disturbances];
                law.recall(input, error, disturbance).map(drop)
            })
            .or_raise()?;
        Ok(law)
    })?;
    Ok(Built { law: Box::new(law), fits: Fits::First })
}

/// Runs of a library that match the coming ones.
#[derive(Default)]
struct Earlier {
    library: Option<Py<PyLibrary>>,
    fitting: Fitting,
}

impl Earlier {
    fn of(call: &Call<'_, '_>) -> PyResult<Self> {
        let library = call.arguments.given("library")?;
        let task = Task { cell: call.arguments.maybe_text("cell")? };
        let library = library.map(|given| {
            given.cast_into::<PyLibrary>().map_err(|other| {
                PyTypeError::new_err(format!("library: {other}; a Library or None is needed"))
            })
        });
        let (Some(library), Some(size)) = (library.transpose()?, call.size) else {
            return Ok(Self::default());
        };
        let Size { n_samples, channels: Channels { n_inputs, n_outputs }, n_disturbances } = size;
        if n_inputs != n_outputs {
            return Ok(Self::default());
        }
        let library = library.unbind();
        let find = |library: &Library| library.fitting(n_samples, n_inputs, n_disturbances, &task);
        let fitting = detached(call.py(), || library.get().read(find)).or_raise()?;
        Ok(Self { fitting, library: Some(library) })
    }
}

/// Runs of a library, read when they count.
struct LibraryShelf {
    library: Py<PyLibrary>,
    runs: Vec<(i64, u64)>,
}

impl LibraryShelf {
    /// Returns the shares of the sums due to the errors; of a run that is gone by now, infinity.
    fn error_sums(&mut self, law: &Relevance) -> PyResult<Vec<f64>> {
        let mut sums = vec![f64::INFINITY; self.runs.len()];
        let all: Vec<usize> = (0..self.runs.len()).collect();
        self.read(&all, &mut |run, _, error| {
            sums[run] = law.error_sum(error);
            Ok(())
        })
        .or_raise()?;
        Ok(sums)
    }
}

impl Shelf for LibraryShelf {
    fn read(&mut self, runs: &[usize], each: &mut Each<'_>) -> Result<(), LearningError> {
        let library = self.library.get();
        // A few at a time, and used when the library is closed: a law of Python may use it, too.
        for (start, few) in (0..).step_by(READ).zip(runs.chunks(READ)) {
            let load = |library: &Library| {
                few.iter()
                    .map(|&run| library.load_if_there(self.runs[run]))
                    .collect::<Result<Vec<_>, _>>()
            };
            let told = |error: LibraryError| LearningError::Shelf { reason: error.to_string() };
            for (place, row) in (start..).zip(library.read(load).map_err(told)?) {
                if let Some(row) = row {
                    each(place, &row.record.input, &row.record.error_m)?;
                }
            }
        }
        Ok(())
    }
}

impl Readable for Relevance {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "n_runs").then(|| Figure::Count(self.len()))
    }

    fn has_inner(&self) -> bool {
        true
    }

    fn relevance(&mut self) -> Option<&mut Relevance> {
        Some(self)
    }
}

impl Readable for Flexible {
    fn figure(&self, name: &str) -> Option<Figure> {
        (name == "n_runs").then(|| Figure::Count(self.len()))
    }

    fn has_inner(&self) -> bool {
        true
    }
}

/// Reads any object with the attributes of `ilc_rt.RelevanceWeights`.
fn read_weights(object: &Bound<'_, PyAny>) -> PyResult<RelevanceWeights> {
    let part = |name: &str| number(name, &object.getattr(name)?);
    let disturbance = read_disturbance("disturbance", &object.getattr("disturbance")?)?;
    let n = disturbance.len();
    RelevanceWeights {
        error: part("error")?,
        error_rate: part("error_rate")?,
        disturbance,
        epsilon: part("epsilon")?,
        rate_filter_s: part("rate_filter_s")?,
        error_gain: part("error_gain")?,
        input_gain: part("input_gain")?,
    }
    .spread(n)
    .or_raise()
}

/// Refuses invalid weights of the relevance.
#[pyfunction]
pub(crate) fn check_relevance_weights(weights: &Bound<'_, PyAny>) -> PyResult<()> {
    read_weights(weights).map(drop)
}

fn no_sample_time(weights: &RelevanceWeights) -> PyErr {
    PyValueError::new_err(format!(
        "dt_s = None: the weight of the error's rate, {}, needs the sample time, and no library has it",
        weights.error_rate
    ))
}

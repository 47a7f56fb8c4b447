//! What the laws that remember runs share: made at the first update, and filled from a library.

use std::sync::Mutex;

use ilc_rt::learning::law::flexible::Flexible;
use ilc_rt::learning::law::relevance::Relevance;
use ilc_rt::learning::{Law, LearningError};
use ilc_rt::library::{LibraryError, Task};
use ilc_rt::record::IterationRecord;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use super::{held, next};
use crate::argument::{Signal, give_signal, misfit, read_disturbance};
use crate::detached::detached;
use crate::error::OrRaise;
use crate::library::PyLibrary;
use crate::python_law::PythonLaw;

/// A law that can be told of runs made earlier.
pub(super) trait Remember: Law {
    fn remember(&mut self, u: &[f64], e: &[f64], disturbance: &[f64]) -> Result<(), LearningError>;
}

impl Remember for Relevance {
    fn remember(&mut self, u: &[f64], e: &[f64], disturbance: &[f64]) -> Result<(), LearningError> {
        Relevance::remember(self, u, e, disturbance)
    }
}

impl Remember for Flexible {
    fn remember(&mut self, u: &[f64], e: &[f64], disturbance: &[f64]) -> Result<(), LearningError> {
        Flexible::remember(self, u, e, disturbance)
    }
}

/// Size of the runs, as the first one shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    pub(super) n_samples: usize,
    pub(super) n_inputs: usize,
    pub(super) n_outputs: usize,
    pub(super) n_disturbances: usize,
    /// Sample time of the runs in the library, if it has any that fit.
    pub(super) library_dt_s: Option<f64>,
}

/// A law around a core, and where it takes earlier runs from.
#[derive(Debug)]
pub(super) struct Recalled<L> {
    core: Py<PyAny>,
    library: Option<Py<PyLibrary>>,
    task: Task,
    state: Mutex<State<L>>,
}

#[derive(Debug)]
struct State<L> {
    /// The law and the size of run that it is for.
    law: Option<(Size, L)>,
    /// Disturbances announced before the law could be made.
    announced: Vec<Vec<f64>>,
}

impl<L: Remember> Recalled<L> {
    pub(super) fn new(
        library: Option<&Bound<'_, PyLibrary>>,
        core: &Bound<'_, PyAny>,
        cell: Option<String>,
    ) -> PyResult<Self> {
        if !core.getattr_opt("update")?.is_some_and(|update| update.is_callable()) {
            let shown = core.repr()?;
            return Err(PyTypeError::new_err(format!(
                "core = {shown}: a law with update(u, e, disturbance=None) is needed"
            )));
        }
        Ok(Self {
            core: core.clone().unbind(),
            library: library.map(|library| library.clone().unbind()),
            task: Task { cell },
            state: Mutex::new(State { law: None, announced: Vec::new() }),
        })
    }

    /// Announces a run.
    pub(super) fn expect(&self, disturbance: &Bound<'_, PyAny>) -> PyResult<()> {
        let values = read_disturbance("disturbance", disturbance)?;
        detached(disturbance.py(), || {
            let mut state = held(&self.state);
            match &mut state.law {
                Some((_, law)) => law.set_disturbance(&values),
                None => state.announced.push(values),
            }
        });
        Ok(())
    }

    /// Runs one update; `make` makes the law when it is the first.
    pub(super) fn update<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        e: &Bound<'py, PyAny>,
        disturbance: Option<&Bound<'py, PyAny>>,
        make: impl Fn(Box<dyn Law>, Size) -> PyResult<L>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let u = Signal::read("u", u)?;
        let e = Signal::read("e", e)?.with_samples("e", u.n_samples)?;
        let coming = disturbance
            .filter(|disturbance| !disturbance.is_none())
            .map(|disturbance| read_disturbance("disturbance", disturbance))
            .transpose()?;
        self.prepare(py, &u, &e, coming.as_deref(), make)?;
        let result = detached(py, || {
            let mut state = held(&self.state);
            let Some((_, law)) = &mut state.law else {
                return Err(LearningError::Empty { what: "law" });
            };
            if let Some(coming) = &coming {
                law.set_disturbance(coming);
            }
            next(law, &u, &e)
        });
        give_signal(py, result.or_raise()?, u.n_channels, u.is_flat)
    }

    /// Remembers a run made elsewhere.
    pub(super) fn remember(
        &self,
        py: Python<'_>,
        u: &Bound<'_, PyAny>,
        e: &Bound<'_, PyAny>,
        disturbance: Option<&Bound<'_, PyAny>>,
        make: impl Fn(Box<dyn Law>, Size) -> PyResult<L>,
    ) -> PyResult<()> {
        let u = Signal::read("u", u)?;
        let e = Signal::read("e", e)?.with_samples("e", u.n_samples)?;
        let own = match disturbance {
            Some(disturbance) if !disturbance.is_none() => {
                read_disturbance("disturbance", disturbance)?
            }
            _ => Vec::new(),
        };
        self.prepare(py, &u, &e, Some(&own), make)?;
        detached(py, || match &mut held(&self.state).law {
            Some((_, law)) => law.remember(&u.values, &e.values, &own),
            None => Err(LearningError::Empty { what: "law" }),
        })
        .or_raise()
    }

    /// Makes the law if it is not there, and refuses runs of another size.
    fn prepare(
        &self,
        py: Python<'_>,
        u: &Signal,
        e: &Signal,
        disturbance: Option<&[f64]>,
        make: impl Fn(Box<dyn Law>, Size) -> PyResult<L>,
    ) -> PyResult<()> {
        let (size, announced) = detached(py, || {
            let state = held(&self.state);
            (state.law.as_ref().map(|(size, _)| *size), state.announced.clone())
        });
        if let Some(size) = size {
            for (name, signal, n_channels) in [("u", u, size.n_inputs), ("e", e, size.n_outputs)] {
                if (signal.n_samples, signal.n_channels) != (size.n_samples, n_channels) {
                    let allowed = format!("({}, {n_channels})", size.n_samples);
                    return Err(misfit(name, &signal.shape(), &allowed));
                }
            }
            return Ok(());
        }
        let told = disturbance.or(announced.last().map(Vec::as_slice));
        let mut size = Size {
            n_samples: u.n_samples,
            n_inputs: u.n_channels,
            n_outputs: e.n_channels,
            n_disturbances: told.map_or(0, <[f64]>::len),
            library_dt_s: None,
        };
        let runs = self.runs(py, &mut size)?;
        let core = PythonLaw::core(self.core.bind(py), size.n_inputs, size.n_outputs, u.is_flat)?;
        let mut law = make(Box::new(core), size)?;
        detached(py, || {
            for run in &runs {
                law.remember(&run.input, &run.error_m, &run.disturbance)?;
            }
            for disturbance in &announced {
                law.set_disturbance(disturbance);
            }
            let mut state = held(&self.state);
            state.announced.clear();
            state.law = Some((size, law));
            Ok::<(), LearningError>(())
        })
        .or_raise()
    }

    /// Reads the runs of the library that fit.
    fn runs(&self, py: Python<'_>, size: &mut Size) -> PyResult<Vec<IterationRecord>> {
        let Some(library) = &self.library else {
            return Ok(Vec::new());
        };
        let library = library.get();
        let Size { n_samples, n_inputs, n_outputs, n_disturbances, .. } = *size;
        if n_inputs != n_outputs {
            return Ok(Vec::new());
        }
        detached(py, || -> Result<Vec<IterationRecord>, LibraryError> {
            library.read(|library| {
                let (ids, dt_s) =
                    library.fitting(n_samples, n_inputs, n_disturbances, &self.task)?;
                size.library_dt_s = dt_s;
                ids.into_iter()
                    .map(|id| library.load(id).map(|row| row.record))
                    .collect::<Result<Vec<_>, _>>()
            })
        })
        .or_raise()
    }

    /// Forgets everything; the library is read again at the next update.
    pub(super) fn reset(&self, py: Python<'_>) {
        detached(py, || {
            let mut state = held(&self.state);
            if let Some((_, mut law)) = state.law.take() {
                law.reset();
            }
            state.announced.clear();
        });
    }

    /// Does something with the law, if there has been a run.
    pub(super) fn with<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut L) -> T + Send,
    ) -> Option<T> {
        detached(py, || held(&self.state).law.as_mut().map(|(_, law)| work(law)))
    }

    pub(super) fn core_repr(&self, py: Python<'_>) -> PyResult<String> {
        Ok(self.core.bind(py).repr()?.to_string())
    }
}

//! What stands behind `NormOptimalIlc`: the law with or without a filter, and its arguments.

use ilc_rt::learning::law::dynamic::DynamicNormOptimal;
use ilc_rt::learning::law::norm_optimal::{Cost, NormOptimal, Plant};
use ilc_rt::learning::weights::{Dynamic, Weight};
use ilc_rt::learning::{Law, LearningError};
use ilc_rt::model::StateSpace;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::argument::misfit;
use crate::error::OrRaise;
use crate::model_argument::read_model;
use crate::weights::{Given, read_matrices, read_weight};

/// The law with or without a filter in front.
#[derive(Debug)]
pub(super) enum Solver {
    Plain(NormOptimal),
    Dynamic(DynamicNormOptimal),
}

impl Solver {
    pub(super) fn new(
        plant: Plant<'_>,
        n_samples: usize,
        cost: Cost,
        filter: Option<Filter>,
    ) -> Result<Self, LearningError> {
        match filter {
            None => NormOptimal::new(plant, n_samples, cost).map(Self::Plain),
            Some(Filter(dynamic)) => {
                DynamicNormOptimal::new(plant, n_samples, &dynamic, cost).map(Self::Dynamic)
            }
        }
    }

    pub(super) fn law(&mut self) -> &mut dyn Law {
        match self {
            Self::Plain(law) => law,
            Self::Dynamic(law) => law,
        }
    }

    pub(super) fn into_law(self) -> Box<dyn Law> {
        match self {
            Self::Plain(law) => Box::new(law),
            Self::Dynamic(law) => Box::new(law),
        }
    }

    pub(super) fn conditioning(&self) -> f64 {
        match self {
            Self::Plain(law) => law.conditioning(),
            Self::Dynamic(law) => law.inner().conditioning(),
        }
    }
}

/// What is said about the input.
pub(super) struct Effort<'a, 'py> {
    pub(super) s: Given<'a, 'py>,
    pub(super) r: Given<'a, 'py>,
    pub(super) rate: f64,
}

impl Effort<'_, '_> {
    pub(super) fn cost(&self, q: Weight, n_samples: usize, n_inputs: usize) -> PyResult<Cost> {
        let s = read_weight("s", self.s, 0.0, n_samples, n_inputs)?;
        let r = read_weight("r", self.r, 0.0, n_samples, n_inputs)?;
        Ok(Cost { q, s, r, rate: self.rate })
    }
}

/// The filter of a dynamic weight.
#[derive(Debug, Clone)]
pub(super) struct Filter(Dynamic);

impl Filter {
    pub(super) fn read(
        filter: &Bound<'_, PyAny>,
        n_samples: usize,
        coupling: Given<'_, '_>,
        plain: Given<'_, '_>,
    ) -> PyResult<Self> {
        let mut dynamic = Dynamic::new(read_model("filter", filter)?).or_raise()?;
        if let Some(coupling) = coupling {
            let matrices = read_matrices("coupling", coupling)?;
            if matrices.len() != n_samples {
                let (rows, cols) = matrices[0].shape();
                let rule = format!("({n_samples}, rows, columns)");
                return Err(misfit("coupling", &[matrices.len(), rows, cols], &rule));
            }
            dynamic = dynamic.with_coupling(matrices).or_raise()?;
        }
        if plain.is_some() {
            let weight = read_weight("plain", plain, 0.0, n_samples, dynamic.n_outputs())?;
            dynamic = dynamic.with_plain(weight);
        }
        Ok(Self(dynamic))
    }

    /// Returns the channels that it gives.
    pub(super) fn n_outputs(&self) -> usize {
        self.0.n_filtered()
    }
}

/// Returns the models of several agents side by side, and the outputs of one of them.
pub(super) fn side_by_side(models: &[Bound<'_, PyAny>]) -> PyResult<(StateSpace, usize)> {
    let Some((first, others)) = models.split_first() else {
        return Err(PyValueError::new_err("models is empty; at least one agent is needed"));
    };
    let mut all = read_model("models[0]", first)?;
    let n_outputs = all.n_outputs();
    for (i, model) in others.iter().enumerate() {
        let name = format!("models[{}]", i + 1);
        let agent = read_model(&name, model)?;
        if agent.n_outputs() != n_outputs {
            let found = agent.n_outputs();
            return Err(PyValueError::new_err(format!(
                "{name} has {found} outputs; {n_outputs} are needed, as models[0] has"
            )));
        }
        all = all.append(&agent).or_raise()?;
    }
    Ok((all, n_outputs))
}

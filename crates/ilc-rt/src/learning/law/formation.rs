//! Norm-optimal ILC of several machines in formation: the law of
//! [`norm_optimal`](super::norm_optimal) with the weights of [`Formation`].

use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, violation};
use super::norm_optimal::{Cost, NormOptimal};
use crate::learning::Law;
use crate::learning::weights::{Formation, Weight};
use crate::schema::{Violation, field_order};

/// `[learning.formation]`: weights of each agent's own error, of the centre's and of the
/// formation's.
///
/// `Q = q I + centre K' K + formation F' F`, F the differences of the errors of every two agents, K
/// the mean of all agents' errors. An agent is a group of axes; all groups have the same number, in
/// the same order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct FormationParameters {
    /// The agents, e.g. `[["x1", "y1"], ["x2", "y2"]]`: every axis of the cell once.
    pub agents: Vec<Vec<String>>,
    /// Weight of each agent's own error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the error of the formation's centre.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub centre: f64,
    /// Weight of the formation errors.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub formation: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Weight of the rate of the change of input.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rate: f64,
}

impl Default for FormationParameters {
    fn default() -> Self {
        let agents = Vec::new();
        Self { agents, q: 1.0, centre: 0.0, formation: 1.0, s: 0.0, r: 0.0, rate: 0.0 }
    }
}

impl LawParameters for FormationParameters {
    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        let key = "[learning.formation] agents";
        let refused = |allowed: &str| Err(violation(key, format!("{:?}", self.agents), allowed));
        let names: Vec<&String> = self.agents.iter().flatten().collect();
        let once = |name: &str| names.iter().filter(|found| **found == name).count() == 1;
        if names.len() != cell.axes.len() || !cell.axes.iter().all(|axis| once(axis.name)) {
            return refused("names of the axes of this cell, every one once");
        }
        if self.agents.len() < 2 || self.agents.iter().any(|a| a.len() != self.agents[0].len()) {
            return refused("at least two agents, each with as many axes");
        }
        Ok(())
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        self.requires(context.cell)?;
        let cost = Cost {
            q: Weight::Block(self.weight(context.cell)?),
            s: Weight::Scalar(self.s),
            r: Weight::Scalar(self.r),
            rate: self.rate,
        };
        Ok(Box::new(NormOptimal::new(context.model, context.n_samples(), cost)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"formation\"\n[learning.formation]\nagents = [[\"x\"], [\"y\"]]\n\
                       formation = 0.5\nrate = 7.0",
            error_left: 0.1,
        }]
    }
}

impl FormationParameters {
    /// Returns the weight of the errors in the order of the cell's axes.
    fn weight(&self, cell: &LawCell) -> Result<DMatrix<f64>, BuildError> {
        let formation = Formation::new(self.agents.len(), self.agents[0].len())?;
        let (f, k) = (formation.shape(), formation.centre());
        let by_agent = f.transpose() * f * self.formation + k.transpose() * k * self.centre;
        let place = |axis: usize| {
            let mut names = self.agents.iter().flatten();
            names.position(|name| name == cell.axes[axis].name).unwrap_or(axis)
        };
        let n_axes = cell.axes.len();
        let own = DMatrix::identity(n_axes, n_axes) * self.q;
        Ok(own + DMatrix::from_fn(n_axes, n_axes, |i, j| by_agent[(place(i), place(j))]))
    }
}

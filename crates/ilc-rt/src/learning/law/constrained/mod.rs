//! Constrained norm-optimal ILC.
//!
//! The cost of norm-optimal ILC, minimised over the feasible inputs: bounds of the input, of its
//! change and steps, of the set point's position, velocity and acceleration and of the predicted
//! output (a quadratic program). `design` and the Python bindings may import it.
//!
//! Family: `bounds` and `solver`: the solver refuses with the error of its bounds.

mod active;
mod active_rows;
mod bounds;
mod gain;
mod group;
mod interior;
mod load;
mod parameters;
#[cfg(test)]
mod proof;
mod reach;
mod riccati;
mod rows;
mod solver;
mod sweeps;

use super::norm_optimal::decouple::parts;
use super::norm_optimal::{Cost, NormOptimal, Plant};
use crate::learning::error::check;
use crate::learning::sweep::Run;
use crate::learning::{Law, LearningError, Result, Surrogate};
use crate::model::{ModelError, StateSpace};

use bounds::Extent;
pub use bounds::{Bound, Bounds, BoundsError, Limit};
pub use parameters::ConstrainedParameters;
use solver::Solver;

/// Outcome of the last update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Status {
    /// No update yet.
    Untried,
    /// The next input is optimal within the bounds.
    Solved,
    /// The bounds are infeasible from this input; it was kept.
    Infeasible(BoundsError),
    /// No optimum was found, most likely because the bounds contradict each other; the input was
    /// kept.
    MaxIterations,
}

impl Status {
    /// Returns the name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Untried => "untried",
            Self::Solved => "solved",
            Self::Infeasible(_) => "infeasible",
            Self::MaxIterations => "max_iterations",
        }
    }
}

impl std::fmt::Display for Status {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Untried => out.write_str("there was no update yet"),
            Self::Solved => out.write_str("the input is optimal within the bounds"),
            Self::Infeasible(error) => error.fmt(out),
            Self::MaxIterations => {
                out.write_str("no optimum was found: the bounds most likely contradict each other")
            }
        }
    }
}

/// Constrained norm-optimal ILC, in linear time.
///
/// `u_{j+1} = u_j + argmin_v J(v)` over all `v` that satisfy every bound.
///
/// A primal-dual interior-point method finds the minimum; its linear systems are solved by a
/// Riccati recursion, with bounds as weighted virtual outputs, so that time and memory grow
/// linearly with the run. Inactive bounds cost nothing: the law then is
/// [`NormOptimal`]. Near the optimum the active bounds are solved for as equations, to
/// rounding. Each search begins in this way with the active bounds of the last solution (warm start):
/// if few of them have changed, it ends after one to five linear systems.
///
/// The next input exceeds no bound by more than 1e-9 of its size. If no such input is found, the
/// old input is kept and [`Constrained::status`] reports it.
///
/// # Shapes
/// - `input`, `next`: `n_samples` x `n_inputs`; `error`: `n_samples` x `n_outputs`
/// # Real Time
/// Cold path. Allocates in the constructor, never in [`Law::update`]; `O(n_samples)` time per
/// iteration, of which there are at most 60 in a search; if a search from the last solution (warm
/// start) fails, it starts over, and then once more with care, in at most 264 iterations
/// altogether.
/// # Source
/// - \[haas2016\], section 4: constraints on set points. \[mehrotra1992\]: the interior-point
///   method. \[rao1998\]: its linear system as a Riccati recursion. \[hintermueller2002\]: the
///   primal-dual active set.
#[derive(Debug)]
pub struct Constrained {
    model: StateSpace,
    cost: Cost,
    bounds: Bounds,
    extent: Extent,
    solvers: Vec<Box<dyn Solver>>,
    status: Status,
    iterations: usize,
    gap: f64,
}

impl Constrained {
    /// Creates the law for runs of `n_samples` samples; `cost` is a [`Cost`] or
    /// [`Weights`](super::norm_optimal::Weights).
    ///
    /// # Errors
    /// - [`LearningError::Weight`] or [`LearningError::Parameter`] for an invalid weight.
    /// - [`LearningError::Bounds`] or [`LearningError::Length`] for bounds that are contradictory
    ///   or of the wrong shape.
    /// - [`LearningError::Empty`] for 0 samples, or a model without inputs or outputs.
    /// - [`LearningError::Undetermined`] if `s`, `r` and `rate` are zero and the model does not
    ///   determine the input.
    /// - [`LearningError::Model`] for a continuous model.
    pub fn new(
        model: &StateSpace,
        n_samples: usize,
        cost: impl Into<Cost>,
        bounds: Bounds,
    ) -> Result<Self> {
        let Some(dt_s) = model.dt_s() else {
            return Err(ModelError::Continuous { action: "constrained learning" }.into());
        };
        let (n_inputs, n_outputs) = (model.n_inputs(), model.n_outputs());
        for (what, count) in
            [("n_samples", n_samples), ("n_inputs", n_inputs), ("n_outputs", n_outputs)]
        {
            if count == 0 {
                return Err(LearningError::Empty { what });
            }
        }
        let cost = cost.into();
        cost.check(n_samples, n_inputs, n_outputs)?;
        let extent = Extent { n_samples, n_inputs, n_outputs, dt_s };
        bounds.check(extent)?;
        let solvers = parts(Plant::Invariant(model), &cost)?
            .into_iter()
            .map(|part| group::solver(part, &bounds, extent))
            .collect::<Result<_, _>>()?;
        let (status, iterations, gap) = (Status::Untried, 0, 0.0);
        Ok(Self { model: model.clone(), cost, bounds, extent, solvers, status, iterations, gap })
    }

    /// Returns the outcome of the last update.
    pub fn status(&self) -> Status {
        self.status
    }

    /// Returns the law without its bounds.
    ///
    /// # Errors
    /// - as [`NormOptimal::new`].
    pub fn unbounded(&self) -> Result<NormOptimal> {
        NormOptimal::new(&self.model, self.extent.n_samples, self.cost.clone())
    }

    /// Returns the iterations of the last update, for the group of axes that took most; 0 if no
    /// bound was active.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Returns the relative duality gap: a bound on the excess cost, relative to the minimum.
    pub fn gap(&self) -> f64 {
        self.gap
    }
}

impl Law for Constrained {
    fn update(&mut self, input: &[f64], error: &[f64], next: &mut [f64]) -> Result {
        let Extent { n_samples, n_inputs, n_outputs, .. } = self.extent;
        check("input", input, n_samples, n_inputs)?;
        check("error", error, n_samples, n_outputs)?;
        if next.len() != input.len() {
            let (what, found, n_channels) = ("next", next.len(), n_inputs);
            return Err(LearningError::Length { what, found, n_samples, n_channels });
        }
        (self.iterations, self.gap) = (0, 0.0);
        let mut run = Run { input, error, next, n_inputs, n_outputs };
        self.status = Status::Solved;
        if let Some(conflict) = self.solvers.iter().find_map(|solver| solver.conflict(&run)) {
            self.status = Status::Infeasible(conflict);
        } else {
            for solver in &mut self.solvers {
                let outcome = solver.solve(&run);
                self.iterations = self.iterations.max(outcome.iterations);
                self.gap = self.gap.max(outcome.gap);
                if !outcome.is_solved {
                    self.status = Status::MaxIterations;
                }
            }
        }
        if self.status == Status::Solved {
            for solver in &self.solvers {
                solver.write(&mut run);
            }
        } else {
            run.next.copy_from_slice(input);
            self.reset();
        }
        check("next", run.next, n_samples, n_inputs)
    }

    fn linear_surrogate(&mut self) -> Surrogate<'_> {
        self.unbounded().map_or(Surrogate::Itself, |law| Surrogate::Unbounded(Box::new(law)))
    }

    fn status(&self) -> Option<String> {
        match self.status {
            Status::Untried | Status::Solved => None,
            Status::Infeasible(conflict) => {
                Some(format!("the bounds cannot be honoured, so that the input is kept: {conflict}"))
            }
            Status::MaxIterations => Some(
                "no input within the bounds was found, so that the input is kept: they most likely \
                 contradict each other"
                    .to_owned(),
            ),
        }
    }

    fn reset(&mut self) {
        for solver in &mut self.solvers {
            solver.forget();
        }
    }

    fn describe(&self) -> String {
        let Extent { n_samples, n_inputs, n_outputs, .. } = self.extent;
        format!(
            r#"{{"law":"constrained",{},"bounds":{},"n_samples":{n_samples},"n_inputs":{n_inputs},"n_outputs":{n_outputs}}}"#,
            self.cost.json(),
            self.bounds.describe(self.extent),
        )
    }
}

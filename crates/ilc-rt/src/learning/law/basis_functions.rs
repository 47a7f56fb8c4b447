//! Basis functions in a cell: the parameters of a feed-forward, learned on one program for every other one.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::context::{BuildError, Example, LawCell, LawContext, LawParameters, violation};
use super::parametric::{Diagonal, Function, MotionFunction, Parametric, Term};
use crate::learning::{Law, LearningError};
use crate::model::delays;
use crate::schema::{Violation, field_order};

/// `[learning.basis_functions]`: signals of the program, each with one parameter per axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct BasisFunctionsParameters {
    /// Functions of the motion; `viscous` is `velocity` by the name of the friction. Jerk and snap suit smooth
    /// programs alone.
    pub functions: Vec<MotionFunction>,
    /// Harmonics of the position, sine and cosine of each order: cogging, the pitch of a screw.
    #[serde(rename = "harmonic")]
    pub harmonics: Vec<HarmonicParameters>,
    /// Weight of the predicted error.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub q: f64,
    /// Weight of the next input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub s: f64,
    /// Weight of the change of input.
    #[schemars(range(min = 0.0, max = 1e12))]
    pub r: f64,
    /// Samples by which the signals are ahead of the program; the dead time of each axis' model by default.
    #[schemars(range(min = 0, max = 1000))]
    pub lead_samples: Option<usize>,
    /// Parameters to begin with, a row for each axis: of its functions, then sine and cosine of its harmonics. The
    /// first run has their input; it is zero by default.
    pub parameters: Vec<Vec<f64>>,
    /// Learn; otherwise the parameters stay as they are.
    pub learn: bool,
}

/// `[[learning.basis_functions.harmonic]]`: what repeats with the position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct HarmonicParameters {
    /// Period of the first harmonic, in the unit of the position.
    #[schemars(range(min = 1e-6, max = 1e4))]
    pub pitch_m: f64,
    /// Number of harmonics.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 100))]
    pub orders: u32,
    /// Name of the axis; all axes of the cell by default.
    pub axis: Option<String>,
}

fn one() -> u32 {
    1
}

/// Functions that a law has unless others are named.
pub(super) const USUAL: [MotionFunction; 3] =
    [MotionFunction::Velocity, MotionFunction::Acceleration, MotionFunction::Coulomb];

impl Default for BasisFunctionsParameters {
    fn default() -> Self {
        Self {
            functions: USUAL.to_vec(),
            harmonics: Vec::new(),
            q: 1.0,
            s: 0.0,
            r: 0.0,
            lead_samples: None,
            parameters: Vec::new(),
            learn: true,
        }
    }
}

impl LawParameters for BasisFunctionsParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_functions("[learning.basis_functions] functions", &self.functions)?;
        for (number, harmonic) in self.harmonics.iter().enumerate() {
            let known = |name: &String| cell.axes.iter().any(|axis| axis.name == name);
            if let Some(name) = harmonic.axis.as_ref().filter(|name| !known(name)) {
                let key = format!("[[learning.basis_functions.harmonic]] {} axis", number + 1);
                return Err(violation(&key, name, "the name of an axis of this cell"));
            }
        }
        let wanted: Vec<usize> =
            cell.axes.iter().map(|axis| self.of_axis(axis.name).len()).collect();
        let key = "[learning.basis_functions] parameters";
        let found: Vec<usize> = self.parameters.iter().map(Vec::len).collect();
        if !found.is_empty() && found != wanted {
            let allowed = format!("a row for each axis, of {wanted:?} numbers");
            return Err(violation(key, format!("rows of {found:?} numbers"), allowed));
        }
        match self.parameters.iter().flatten().find(|value| !value.is_finite()) {
            Some(value) => Err(violation(key, value, "finite numbers")),
            None => Ok(()),
        }
    }

    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        if cell.axes.iter().all(|axis| self.of_axis(axis.name).is_empty()) {
            let allowed = "a function or a [[learning.basis_functions.harmonic]] at least";
            return Err(violation("[learning.basis_functions] functions", "[]", allowed));
        }
        Ok(())
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let functions = |axis: usize| self.of_axis(context.cell.axes[axis].name);
        let terms = terms(context, self.lead_samples, functions)?;
        let weights = weights([self.q, self.s, self.r], context);
        let told = ("basis_functions", serde_json::to_value(self).unwrap_or_default());
        let start = self.parameters.concat();
        let law = Parametric::new(told, context.model, terms, context.n_samples(), &weights)?;
        let start = if start.is_empty() { vec![0.0; law.terms().len()] } else { start };
        Ok(Box::new(law.starting_with(&start, self.learn)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example { is_parallel: false, learning: "law = \"basis_functions\"", error_left: 0.3 },
            Example {
                is_parallel: true,
                learning: "law = \"basis_functions\"\ninput_max_m_s = 0.1\n\
                           [learning.basis_functions]\n\
                           functions = [\"velocity\", \"acceleration\", \"coulomb\"]\n\
                           harmonic = [{ pitch_m = 0.03, orders = 2, axis = \"x\" }]\nr = 1e-6",
                error_left: 0.5,
            },
        ]
    }
}

impl BasisFunctionsParameters {
    fn of_axis(&self, name: &str) -> Vec<Function> {
        let own =
            |harmonic: &&HarmonicParameters| harmonic.axis.as_ref().is_none_or(|axis| axis == name);
        let waves = self.harmonics.iter().filter(own).flat_map(|harmonic| {
            let pitch_m = harmonic.pitch_m;
            (1..=harmonic.orders).flat_map(move |order| {
                [false, true].map(|is_cosine| Function::Harmonic { pitch_m, order, is_cosine })
            })
        });
        self.functions.iter().map(|function| Function::Motion(*function)).chain(waves).collect()
    }
}

/// Refuses a function that is named twice.
pub(super) fn check_functions(key: &str, functions: &[MotionFunction]) -> Result<(), Violation> {
    let same = |one: MotionFunction, other: MotionFunction| {
        let plain = |function| match function {
            MotionFunction::Viscous => MotionFunction::Velocity,
            other => other,
        };
        plain(one) == plain(other)
    };
    for (place, function) in functions.iter().enumerate() {
        if functions[..place].iter().any(|earlier| same(*earlier, *function)) {
            return Err(violation(key, function.as_str(), "each function once"));
        }
    }
    Ok(())
}

/// Returns the terms of all axes with their signals, ahead by `lead_samples` or by the dead time of the axis.
pub(super) fn terms(
    context: &LawContext,
    lead_samples: Option<usize>,
    functions: impl Fn(usize) -> Vec<Function>,
) -> Result<Vec<Term>, LearningError> {
    let delays = delays(context.model)?;
    let n_axes = context.n_axes();
    let terms = (0..n_axes).flat_map(|input| {
        let own = context.reference_m.iter().skip(input).step_by(n_axes);
        let position_m: Vec<f64> = own.copied().collect();
        let dead = delays.iter().filter_map(|row| row[input]).min().unwrap_or(0);
        let lead = lead_samples.unwrap_or(dead);
        let term = move |function: Function| Term {
            input,
            name: function.name(),
            signal: function.signal(&position_m, context.cell.cycle_s, lead),
            function: Some((function, lead)),
        };
        functions(input).into_iter().map(term)
    });
    Ok(terms.collect())
}

/// Returns the same weights for every axis of a cell.
pub(super) fn weights(of: [f64; 3], context: &LawContext) -> Diagonal {
    Diagonal::uniform(of, context.n_axes(), context.n_axes())
}

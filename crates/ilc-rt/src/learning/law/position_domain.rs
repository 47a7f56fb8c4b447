//! Repetitive learning over the position: a table for each axis, which holds on every program.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::basis_functions::{USUAL, check_functions, terms, weights};
use super::context::{BuildError, Example, LawAxis, LawCell, LawContext, LawParameters, violation};
use super::parametric::{Function, MotionFunction, Parametric, Travel};
use crate::learning::Law;
use crate::schema::{Violation, field_order};

/// Largest number of entries of a table.
const ENTRIES_MAX: f64 = 2000.0;

/// `[learning.position_domain]`: a table over the position of each axis, e.g. of cogging or of an eccentric
/// wheel, and beside it functions of the motion, so that the table holds at every speed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct PositionDomainParameters {
    /// Distance of the entries of a table, in the unit of the position: a sixth of the shortest period at most.
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub spacing_m: f64,
    /// A table for each direction of travel, in place of one for both.
    pub by_direction: bool,
    /// Names of the axes with a table; all axes by default.
    pub axes: Vec<String>,
    /// Functions of the motion, learned beside the tables.
    pub functions: Vec<MotionFunction>,
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
}

impl Default for PositionDomainParameters {
    fn default() -> Self {
        Self {
            spacing_m: 0.002,
            by_direction: false,
            axes: Vec::new(),
            functions: USUAL.to_vec(),
            q: 1.0,
            s: 0.0,
            r: 0.0,
            lead_samples: None,
        }
    }
}

impl LawParameters for PositionDomainParameters {
    fn check(&self, cell: &LawCell) -> Result<(), Violation> {
        check_functions("[learning.position_domain] functions", &self.functions)?;
        for (place, name) in self.axes.iter().enumerate() {
            let known = cell.axes.iter().any(|axis| axis.name == name);
            if !known || self.axes[..place].contains(name) {
                let key = "[learning.position_domain] axes";
                return Err(violation(key, name, "names of axes of this cell, each once"));
            }
        }
        Ok(())
    }

    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        let widest = cell.axes.iter().map(|axis| axis.position_max - axis.position_min);
        let least = widest.fold(0.0, f64::max) / ENTRIES_MAX;
        if self.spacing_m < least {
            let allowed =
                format!("at least {least:.3e}, for {ENTRIES_MAX} entries over the travel");
            return Err(violation("[learning.position_domain] spacing_m", self.spacing_m, allowed));
        }
        Ok(())
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        self.requires(context.cell)?;
        let functions = |axis: usize| self.of_axis(&context.cell.axes[axis]);
        let terms = terms(context, self.lead_samples, functions)?;
        let weights = weights([self.q, self.s, self.r], context);
        let told = ("position_domain", serde_json::to_value(self).unwrap_or_default());
        let law = Parametric::new(told, context.model, terms, context.n_samples(), &weights)?;
        Ok(Box::new(law))
    }

    fn examples(&self) -> &'static [Example] {
        &[Example {
            is_parallel: false,
            learning: "law = \"position_domain\"\n[learning.position_domain]\nspacing_m = 0.005\n\
                       by_direction = true",
            error_left: 0.3,
        }]
    }
}

impl PositionDomainParameters {
    fn of_axis(&self, axis: &LawAxis) -> Vec<Function> {
        let motion = self.functions.iter().map(|function| Function::Motion(*function));
        if !self.axes.is_empty() && !self.axes.iter().any(|name| name == axis.name) {
            return motion.collect();
        }
        let travels: &[Travel] =
            if self.by_direction { &[Travel::Forward, Travel::Backward] } else { &[Travel::Both] };
        let table = travels.iter().flat_map(|travel| {
            entries(axis.position_min, axis.position_max, self.spacing_m)
                .into_iter()
                .map(|at_m| Function::Entry { at_m, spacing_m: self.spacing_m, travel: *travel })
        });
        motion.chain(table).collect()
    }
}

/// Returns the positions of the entries of a table: multiples of the spacing, from end to end of the travel.
///
/// Multiples, so that the table of one program is that of another with other limits.
pub fn entries(from_m: f64, to_m: f64, spacing_m: f64) -> Vec<f64> {
    let first = (from_m / spacing_m).floor();
    let last = (to_m / spacing_m).ceil().min(first + ENTRIES_MAX + 1.0);
    let mut place = first;
    let mut entries = Vec::new();
    while place <= last {
        entries.push(place * spacing_m);
        place += 1.0;
    }
    entries
}

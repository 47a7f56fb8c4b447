//! `[learning.model_free]`: step and size of the probing inputs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ModelFree, ModelFreeRule};
use crate::learning::law::LawName;
use crate::learning::law::context::{
    BuildError, Example, LawCell, LawContext, LawParameters, needs_inputs,
};
use crate::learning::law::norm_optimal::Weights;
use crate::learning::law::norm_optimal::decouple::parts;
use crate::learning::{Law, LearningError};
use crate::schema::{Violation, field_order};

/// `[learning.model_free]`: the step, and the size of the inputs by which the gradient is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct ModelFreeParameters {
    /// Step of the gradient descent, below `2 / |P|^2`; by default the best one of each iteration, which a third
    /// run measures.
    #[schemars(range(min = 1e-12, max = 1e12))]
    pub gain: Option<f64>,
    /// Size of the probing inputs relative to the error, input units per error unit; smaller where the bound of
    /// the input requires it.
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub probe: f64,
}

impl Default for ModelFreeParameters {
    fn default() -> Self {
        let ModelFreeRule { gain, probe } = ModelFreeRule::default();
        Self { gain, probe }
    }
}

impl LawParameters for ModelFreeParameters {
    fn requires(&self, cell: &LawCell) -> Result<(), Violation> {
        needs_inputs(LawName::ModelFree, cell)
    }

    fn measures(&self) -> bool {
        true
    }

    fn build(&self, context: &LawContext) -> Result<Box<dyn Law>, BuildError> {
        let n_axes = context.n_axes();
        let weights = Weights::default().into();
        let apart = parts(context.model.into(), &weights).map_err(LearningError::from)?;
        if apart.len() != n_axes || apart.iter().any(|part| part.outputs.len() != 1) {
            let allowed = "another law: the axes of this cell are coupled by their model, so that the gradient \
                           of one shows in the error of another";
            return Err(LawCell::unfit(LawName::ModelFree, allowed).into());
        }
        let input_max: Vec<f64> = context.cell.axes.iter().map(|axis| axis.input_max).collect();
        let rule = ModelFreeRule { gain: self.gain, probe: self.probe };
        Ok(Box::new(ModelFree::new(rule, context.n_samples(), n_axes)?.within(&input_max)?))
    }

    fn examples(&self) -> &'static [Example] {
        &[
            Example { is_parallel: false, learning: "law = \"model_free\"", error_left: 0.5 },
            Example {
                is_parallel: false,
                learning: "law = \"model_free\"\n[learning.model_free]\ngain = 0.8\nprobe = 0.5",
                error_left: 0.5,
            },
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learning::law::context::{LawAxis, LawTables};
    use crate::model::{StateSpace, from_transfer_function};
    use nalgebra::DMatrix;

    #[derive(Debug)]
    struct NoTables;

    impl LawTables for NoTables {
        fn parameters(&self, _: LawName) -> Option<&dyn LawParameters> {
            None
        }
    }

    #[test]
    fn axes_that_their_model_couples_are_refused() {
        let axis = |name| LawAxis {
            name,
            input: crate::fieldbus::cia402::InputKind::Position,
            input_max: 1.0,
            position_min: -1.0,
            position_max: 1.0,
            velocity_max: 1.0,
            acceleration_max: 1.0,
        };
        let cell = LawCell { axes: vec![axis("x"), axis("y")], cycle_s: 2e-3, tables: &NoTables };
        let one = from_transfer_function(&[0.5], &[1.0, -0.5], Some(2e-3)).unwrap();
        let apart = one.append(&one).unwrap();
        let skew = DMatrix::from_row_slice(2, 2, &[1.0, 1e-3, 0.0, 1.0]);
        let skew = StateSpace::static_gain(skew, Some(2e-3)).unwrap();
        let path = vec![0.0; 2 * 50];
        let build = |model: &StateSpace| {
            let context = LawContext { cell: &cell, model, reference_m: &path };
            ModelFreeParameters::default().build(&context).map(drop)
        };
        assert_eq!(build(&apart), Ok(()));
        let line = build(&apart.series(&skew).unwrap()).unwrap_err().to_string();
        assert!(line.contains("model_free") && line.contains("coupled by their model"), "{line}");
    }
}

//! `[learning]`: the law, its measurement and bounds, and its wrappers. The tables of the laws come
//! from their catalogue.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::learning::gate::GateParameters;
use crate::learning::ladder::LadderRule;
use crate::learning::law::{Json, LawParameters, LawTables};
use crate::learning::law::{LawName, every_law};
use crate::schema::field_order;

/// Default growth of the RMS error over the best run at which the best input is restored.
const ROLLBACK_RATIO: f64 = 1.5;

macro_rules! learning {
    ($(#[doc = $does:literal] $law:ident $name:ident $parameters:ty;)*) => {
        /// `[learning]`: the law, its measurement and its bounds.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        #[schemars(extend("x-order" = field_order::<Self>()))]
        pub struct Learning {
            /// The law.
            pub law: LawName,
            /// The measurement to learn from; `--measure` replaces it.
            pub measure: Measure,
            /// Bound of the learned input of an axis that learns a position.
            #[schemars(range(min = 0.0, max = 1.0))]
            pub input_max_m: f64,
            /// Bound of the learned input of an axis that learns a velocity.
            #[schemars(range(min = 0.0, max = 10.0))]
            pub input_max_m_s: f64,
            /// Bound of the learned input of an axis that learns a torque (N, or N m).
            #[schemars(range(min = 0.0, max = 1e6))]
            pub input_max_n: f64,
            /// Growth of the RMS error over the best run at which the best input is restored
            /// (rollback), 1.5 by default; after two rollbacks learning stays off. Not with a gate.
            #[schemars(range(min = 1.0, max = 1e3))]
            pub rollback_ratio: Option<f64>,
            /// Start the law even if the analysis predicts divergence.
            pub allow_divergent: bool,
            /// File with the disturbance of the coming run: one number or more, e.g. temperatures,
            /// separated by blanks or commas. Read before every run, for the laws that use it.
            pub disturbance_file: Option<std::path::PathBuf>,
            $(#[doc = $does] pub $name: $parameters,)*
            /// Ladder: several runs with the same input before each step of learning.
            pub ladder: Option<LadderRule>,
            /// Gate: stops learning at a tolerance, and rolls back to the best input.
            pub gate: Option<GateParameters>,
        }

        impl Default for Learning {
            fn default() -> Self {
                Self {
                    law: LawName::NormOptimal,
                    measure: Measure::Tcp,
                    input_max_m: 0.005,
                    input_max_m_s: 0.05,
                    input_max_n: 50.0,
                    rollback_ratio: None,
                    allow_divergent: false,
                    disturbance_file: None,
                    $($name: Default::default(),)*
                    ladder: None,
                    gate: None,
                }
            }
        }

        impl LawTables for Learning {
            fn parameters(&self, law: LawName) -> Option<&dyn LawParameters> {
                match law {
                    $(LawName::$law => Some(&self.$name),)*
                    LawName::None => None,
                }
            }
        }
    };
}
every_law!(learning);

impl Learning {
    /// Returns the growth of the RMS error over the best run at which the campaign restores the
    /// best input, unless a gate decides.
    pub fn rollback(&self) -> f64 {
        self.rollback_ratio.unwrap_or(ROLLBACK_RATIO)
    }

    /// Returns the table of the named law as `Debug` prints it, `()` without one.
    pub(crate) fn table_debug(&self) -> String {
        self.parameters(self.law).map_or_else(|| "()".to_owned(), |table| format!("{table:?}"))
    }

    /// Returns law and parameters as canonical JSON: equal if and only if they are; a resumed
    /// campaign must agree in it with the earlier one.
    pub fn law_json(&self) -> serde_json::Value {
        let parameters = |law: LawName| self.parameters(law).map(Json::json);
        let core = self.parameters(self.law).and_then(LawParameters::core);
        serde_json::json!({
            "law": self.law,
            "parameters": parameters(self.law),
            "core": core.and_then(parameters),
            "ladder": self.ladder,
            "gate": self.gate,
        })
    }
}

/// Measurement to learn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// The encoder in each drive.
    Encoder,
    /// The tool centre point.
    Tcp,
}

impl Measure {
    /// Returns its name in the cell description.
    pub fn name(self) -> &'static str {
        match self {
            Self::Encoder => "encoder",
            Self::Tcp => "tcp",
        }
    }
}

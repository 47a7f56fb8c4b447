//! The catalogue of the laws that a cell can name. A law is added by a line here and a file beside it.
//!
//! `config` makes the tables of `[learning]` from it, and with them the schema of the cell description,
//! its documents and what is checked; the tests that go over all laws read it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Calls a macro with every law: what it does, its name in Rust and in a cell, its parameters.
macro_rules! every_law {
    ($macro:ident) => {
        $macro! {
            /// The input that a quadratic cost over the whole run asks for; with `rate` it is CO-ILC.
            NormOptimal norm_optimal crate::learning::law::norm_optimal::NormOptimalParameters;
            /// Proportional-derivative learning from the error some samples ahead, each axis on its own.
            Pd pd crate::learning::law::pd::PdParameters;
            /// Norm-optimal learning within bounds of input and set point.
            Constrained constrained crate::learning::law::constrained::ConstrainedParameters;
            /// Down the gradient: the error run backward through the model.
            Adjoint adjoint crate::learning::law::adjoint::AdjointParameters;
            /// With the inverse of the model.
            ModelInverse model_inverse crate::learning::law::model_inverse::ModelInverseParameters;
            /// By adding the filtered error up; for cells of csv axes only.
            ErrorFeedforward error_feedforward
                crate::learning::law::error_feedforward::ErrorFeedforwardParameters;
            /// Norm-optimal learning that weighs the low frequencies of the error.
            Dynamic dynamic crate::learning::law::dynamic::DynamicParameters;
            /// Norm-optimal learning of several machines that keep a formation.
            Formation formation crate::learning::law::formation::FormationParameters;
            /// Another law, fed with the tool's errors through the inverse of a Jacobian matrix.
            ThroughJacobian through_jacobian
                crate::learning::law::through_jacobian::ThroughJacobianParameters;
            /// From all past runs, weighted by how like their disturbance was and how small their error.
            Relevance relevance crate::learning::law::relevance::RelevanceParameters;
            /// One input for each disturbance met, interpolated between the nearest two.
            Flexible flexible crate::learning::law::flexible::FlexibleParameters;
        }
    };
}
pub(crate) use every_law;

macro_rules! names {
    ($($(#[$doc:meta])* $law:ident $name:ident $parameters:ty;)*) => {
        /// Name of a law.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
        #[serde(rename_all = "snake_case")]
        pub enum LawName {
            $($(#[$doc])* $law,)*
            /// No learning: every run is like the first.
            None,
        }

        impl LawName {
            /// Every law that a cell can name.
            pub const ALL: &[Self] = &[$(Self::$law),*];

            /// Returns the name as a cell description has it.
            pub fn as_str(self) -> &'static str {
                match self {
                    $(Self::$law => stringify!($name),)*
                    Self::None => "none",
                }
            }
        }
    };
}
every_law!(names);

//! The laws, one per file: a [`Law`](super::Law) and its parameters in a cell description, and the
//! catalogue of those that a cell can name. A new law needs its file and two lines here.
//!
//! `config` makes the tables of `[learning]` from the catalogue, and with them the schema of the
//! cell description, its documents and its checks; the tests over all laws read it. `config`,
//! `design` and the Python bindings import this folder.

pub mod adjoint;
pub mod basis_functions;
pub mod constrained;
mod context;
pub mod dynamic;
pub mod error_feedforward;
mod expectation;
pub mod filtered;
pub mod flexible;
pub mod formation;
pub mod higher_order;
mod inputs;
pub mod model_free;
pub mod model_inverse;
pub mod norm_optimal;
pub mod parametric;
pub mod pd;
pub mod point_to_point;
pub mod position_domain;
pub mod q_filter;
pub mod relevance;
pub mod stable_inverse;
pub mod through_jacobian;

pub use context::{
    BuildError, Example, Json, LawAxis, LawCell, LawContext, LawParameters, LawTables,
};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Calls a macro with every law: its summary, its names in Rust and in a cell, its parameters.
macro_rules! every_law {
    ($macro:ident) => {
        $macro! {
            /// Norm-optimal ILC: minimises a quadratic cost over the run; with `rate` it is CO-ILC.
            NormOptimal norm_optimal crate::learning::law::norm_optimal::NormOptimalParameters;
            /// Proportional-derivative ILC: the error some samples ahead, each axis separately.
            Pd pd crate::learning::law::pd::PdParameters;
            /// Constrained norm-optimal ILC: within bounds of input and set point.
            Constrained constrained crate::learning::law::constrained::ConstrainedParameters;
            /// Adjoint (gradient) ILC: the error run backward through the model.
            Adjoint adjoint crate::learning::law::adjoint::AdjointParameters;
            /// Model-inverse ILC.
            ModelInverse model_inverse crate::learning::law::model_inverse::ModelInverseParameters;
            /// Adds up the filtered error (feed-forward, parallel); for cells of csv axes only.
            ErrorFeedforward error_feedforward
                crate::learning::law::error_feedforward::ErrorFeedforwardParameters;
            /// Norm-optimal ILC with a dynamic weight on the low frequencies of the error.
            Dynamic dynamic crate::learning::law::dynamic::DynamicParameters;
            /// Norm-optimal ILC of several machines in formation.
            Formation formation crate::learning::law::formation::FormationParameters;
            /// Another law, fed with the tool's errors through the inverse of a Jacobian matrix.
            ThroughJacobian through_jacobian
                crate::learning::law::through_jacobian::ThroughJacobianParameters;
            /// Relevance-weighted ILC (DPW-ILC): learns from all past runs with a similar disturbance.
            Relevance relevance crate::learning::law::relevance::RelevanceParameters;
            /// Flexible ILC: one input for each disturbance met, interpolated between the nearest two.
            Flexible flexible crate::learning::law::flexible::FlexibleParameters;
            /// Basis functions: parameters of a feed-forward, learned on one program for every other one.
            BasisFunctions basis_functions
                crate::learning::law::basis_functions::BasisFunctionsParameters;
            /// Point-to-point ILC: the error at some instants vanishes, the motion between them is free.
            PointToPoint point_to_point
                crate::learning::law::point_to_point::PointToPointParameters;
            /// Inverse-model ILC that also inverts zeros outside the unit circle, by looking ahead.
            StableInverse stable_inverse
                crate::learning::law::stable_inverse::StableInverseParameters;
            /// Higher order: the next input from several past runs, with another law.
            HigherOrder higher_order crate::learning::law::higher_order::HigherOrderParameters;
            /// Gradient ILC without a model: runs with the reversed error measure the gradient.
            ModelFree model_free crate::learning::law::model_free::ModelFreeParameters;
            /// Another law with a low-pass (Q-filter) after it.
            Filtered filtered crate::learning::law::filtered::FilteredParameters;
            /// Repetitive learning over the position: a table for each axis, e.g. of cogging.
            PositionDomain position_domain
                crate::learning::law::position_domain::PositionDomainParameters;
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

            /// Returns the name in a cell description.
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

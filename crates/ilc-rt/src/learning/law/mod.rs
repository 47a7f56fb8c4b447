//! The laws, one per file: a [`Law`](super::Law) and its parameters in a cell description, listed
//! in [`catalogue`]. `config`, `design` and the Python bindings import them.
//!
//! Family: every file here, since the catalogue lists the laws, and a law is built from types of
//! the catalogue.

pub mod adjoint;
pub mod catalogue;
pub mod constrained;
mod context;
pub mod dynamic;
pub mod error_feedforward;
mod expectation;
pub mod flexible;
pub mod formation;
mod inputs;
pub mod model_inverse;
pub mod norm_optimal;
pub mod pd;
pub mod q_filter;
pub mod relevance;
pub mod through_jacobian;

pub use context::{
    BuildError, Example, Json, LawAxis, LawCell, LawContext, LawParameters, LawTables,
};

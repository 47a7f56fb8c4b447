//! The laws, one a file. Each implements [`Law`](super::Law); `supervisor` and the Python bindings
//! make them.

pub mod adjoint;
pub mod constrained;
pub mod dynamic;
pub mod error_feedforward;
mod expectation;
pub mod flexible;
mod inputs;
pub mod model_inverse;
pub mod norm_optimal;
pub mod pd;
pub mod q_filter;
pub mod relevance;
pub mod through_jacobian;

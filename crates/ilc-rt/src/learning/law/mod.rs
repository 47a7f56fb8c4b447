//! The laws, one a file. Each implements [`Law`](super::Law); `supervisor` and the Python bindings
//! make them.

pub mod adjoint;
pub mod dynamic;
pub mod error_feedforward;
pub mod model_inverse;
pub mod norm_optimal;
pub mod pd;
pub mod q_filter;
pub mod through_jacobian;
mod expectation;
pub mod flexible;
mod inputs;
pub mod relevance;

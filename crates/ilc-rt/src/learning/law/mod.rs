//! The laws, one a file. Each implements [`Law`](super::Law); `supervisor` and the Python bindings
//! make them.

mod expectation;
pub mod flexible;
mod inputs;
pub mod norm_optimal;
pub mod pd;
pub mod relevance;

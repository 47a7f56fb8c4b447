//! The laws, one a file. Each implements [`Law`](super::Law); `supervisor` and the Python bindings
//! make them.

pub mod constrained;
pub mod norm_optimal;
pub mod pd;

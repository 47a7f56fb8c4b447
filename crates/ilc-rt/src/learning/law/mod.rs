//! The laws, one a file. Each implements [`Law`](super::Law); `supervisor` and the Python bindings
//! make them.

pub mod dynamic;
pub mod norm_optimal;
pub mod pd;
pub mod through_jacobian;

//! Convergence analysis of a learning law before the first run: monotone convergence, robustness,
//! transient growth, noise.
//!
//! A linear law and a model make each iteration a linear map of the input,
//! `u_{j+1} = T u_j + L_e r` with `T = L_u - L_e P` (the lifted system). This folder computes its
//! figures, from dense matrices in short runs and matrix-free in long ones. `design` (which refuses
//! a diverging law), [`tune`](super::tune) and the Python bindings import it.

mod columns;
mod condition;
mod dense;
mod figures;
mod frequency;
mod hessian;
mod iteration;
mod overreach;
mod plant;
mod question;
mod refuse;
mod uncertainty;
mod verdict;
mod weakest;

#[cfg(test)]
mod mismatch;
#[cfg(test)]
mod oracle;
#[cfg(test)]
mod wrapped;

pub use crate::learning::krylov::Estimate;
pub use columns::COLUMNS_MAX;
pub use condition::PdCondition;
pub use figures::{Analysis, Method};
pub(in crate::learning) use frequency::Spectrum;
pub(in crate::learning) use iteration::check_length;
pub use overreach::{Overreach, overreach};
pub use question::{DENSE_MAX, Question, analyze};
pub use refuse::{Verdict, divergence, refuse_divergent};
pub use uncertainty::Uncertainty;

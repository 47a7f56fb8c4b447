//! Linear models of axes: state space, transfer functions, discretisation, connection and
//! identification.
//!
//! This folder turns what is known about an axis into the discrete state-space model that the
//! learning laws work on. It runs when things are set up, never in the tick; `learning`, `servo`'s
//! set-up code, `config`, `design` and the Python bindings may import it.

mod algebra;
mod connect;
mod discretize;
mod error;
mod frequency;
pub mod identify;
mod minimal;
mod relative_degree;
mod rows;
mod sensitivity;
mod state_space;
mod time_varying;
mod transfer_function;
mod zeros;

pub use discretize::{Method, discretize};
pub use error::ModelError;
pub use frequency::{Bode, unwrap_phase};
pub use minimal::from_transfer_matrix;
pub use relative_degree::{delays, relative_degrees};
pub(crate) use rows::Stepper;
pub use state_space::StateSpace;
pub use time_varying::TimeVarying;
pub use transfer_function::{from_transfer_function, second_order};

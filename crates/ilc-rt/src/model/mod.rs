//! Linear models of axes: state space, transfer functions, discretisation and connection.
//!
//! This folder turns what is known about an axis into the discrete state-space model that the
//! learning laws work on. It runs when things are set up, never in the tick; `learning`, `servo`'s
//! set-up code, `config`, `supervisor` and the Python bindings may import it.

mod connect;
mod discretize;
mod error;
mod state_space;
mod time_varying;
mod transfer_function;

pub use discretize::{Method, discretize};
pub use error::ModelError;
pub use state_space::StateSpace;
pub use time_varying::TimeVarying;
pub use transfer_function::{from_transfer_function, second_order};

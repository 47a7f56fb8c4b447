//! The motion controller that learns.
//!
//! A fixed-rate servo loop on CiA 402 drives, an interpolator, and iterative learning control that
//! computes the next run's input while the axes return to the start. `ARCHITECTURE.md` at the root
//! of the project describes how the modules fit together; the head of each module states its
//! purpose and who may import it.

pub mod campaign;
pub mod cli;
pub mod commissioning;
pub mod config;
pub mod control;
pub mod design;
pub mod fieldbus;
pub mod identification;
pub mod interpolate;
pub mod interrupt;
pub mod kinematics;
pub mod learning;
pub mod library;
pub mod model;
pub mod record;
pub mod recording;
pub mod rt;
pub mod schema;
pub mod servo;
pub mod signal;
pub mod trajectory;

//! Simulated CiA 402 drives and plants that speak the real protocol.
//!
//! `plant` is physics, `node` is CANopen and the drive profile, `machine` joins them under one
//! clock. In process, a [`machine::Machine`] is the far side of a bus in memory; as a separate
//! process, the binary `ilc-sim` puts it on any bus. `ilc-rt` never imports this crate.

pub mod bus;
pub mod eds;
pub mod event;
pub mod machine;
pub mod node;
pub mod plant;
mod script;

pub use event::{Change, Event};
pub use machine::{ClockMode, Machine, MachineError};

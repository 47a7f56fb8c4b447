//! Filters of signals: Butterworth as second-order sections, causal and zero-phase.
//!
//! This folder designs filters when things are set up and runs them without allocating. It knows
//! nothing of axes or learning; every other module may import it, the hot ones only [`SosFilter`].

mod butterworth;
mod error;
mod sos;
mod zero_phase;

pub use butterworth::{MAX_ORDER, butterworth};
pub use error::SignalError;
pub use sos::{Section, SosFilter};
pub use zero_phase::ZeroPhase;

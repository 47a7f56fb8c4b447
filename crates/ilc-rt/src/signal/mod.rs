//! Filters, the instantaneous frequency of a signal, and white noise.
//!
//! Butterworth low-pass and high-pass as second-order sections; low-passes causal, zero-phase or switched along the run;
//! Gaussian and symmetric FIR smoothers. Filters are designed at set-up and run without allocation.
//! This folder knows nothing of axes or learning; every other module may import it, hot ones only
//! [`SosFilter`].

mod butterworth;
mod channel;
mod error;
mod fir;
mod gaussian;
mod hilbert;
mod noise;
mod segments;
mod sos;
mod switched;
mod symmetric;
mod zero_phase;

pub use butterworth::{MAX_ORDER, butterworth, butterworth_high_pass};
pub use error::SignalError;
pub use fir::FirFilter;
pub use gaussian::GaussianFilter;
pub use hilbert::{analytic, instantaneous_frequency};
pub use noise::WhiteNoise;
pub use segments::SwitchRule;
pub use sos::{Section, SosFilter};
pub use switched::{Segment, Switched, SwitchedFilter};
pub use symmetric::Symmetric;
pub use zero_phase::ZeroPhase;

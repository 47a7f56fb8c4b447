//! Real-time basics: integer time, clocks, thread set-up and latency histograms.
//!
//! For code that runs on an absolute time grid (`servo`, the simulator, the latency test). Imports
//! nothing of the project; every module may import it.

pub mod clock;
pub mod latency;
pub mod thread;

pub use clock::{MonotonicClock, Nanos};
pub use latency::{Latency, LatencyFigures};
pub use thread::{RtReport, RtRequest};

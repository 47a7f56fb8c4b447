//! Real-time basics: integer time, clocks, thread set-up, readiness, latency histograms and the flight recorder.
//!
//! For code that runs on an absolute time grid (`servo`, the simulator, the latency test). Imports
//! nothing of the project; every module may import it.

pub mod clock;
pub mod flight;
pub mod latency;
pub mod processor;
mod readiness;
pub mod thread;

pub use clock::{Clock, Interruptions, ManualClock, MonotonicClock, Nanos};
pub use flight::{Flight, Stamps};
pub use latency::{Latency, LatencyFigures};
pub use readiness::Readiness;
pub use thread::{Refused, RtReport, RtRequest};

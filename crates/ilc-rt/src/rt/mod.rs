//! Real-time ground: integer time, clocks, the set-up of the loop's thread and its latency figures.
//!
//! For whoever runs something on an absolute time grid (`servo`, the simulator, the latency test).
//! Imports nothing of the project; everything may import it.

pub mod clock;
pub mod latency;
pub mod thread;

pub use clock::{MonotonicClock, Nanos};
pub use latency::{Latency, LatencyFigures};
pub use thread::{RtReport, RtRequest};

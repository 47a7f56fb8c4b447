//! What remains of an iteration: its arrays, its figures, and the events that tell of it.
//!
//! The supervisor fills it, the library keeps it, telemetry and Python read it. Imports signal,
//! trajectory and models at most; never the loop, the library or the bus.

mod event;
mod figures;
mod iteration;

pub use event::{EndStatus, Event, StateName};
pub use figures::{Figures, infinity_norm, rms};
pub use iteration::{IterationRecord, Meta, fingerprint};

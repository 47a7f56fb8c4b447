//! A learned input outside of learning: chosen from the library, exported to a file, loaded again.
//!
//! An input fits one task only: cell, program, measurement, cycle and axes. Here each is compared, and
//! a difference is named. The campaign and `cli` import it; it imports no other room of the campaign.

mod choice;
mod error;
mod file;
mod take_over;
mod task;

pub use choice::{Chosen, Origin, Source, choose};
pub use error::InputError;
pub use file::{load, save};
pub use take_over::take_over;
pub use task::Task;

pub(super) use choice::FROZEN;

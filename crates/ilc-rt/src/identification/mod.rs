//! Experiments that identify an axis: their design within its limits, and the evaluation of their records.
//!
//! `campaign` runs them; `cli` and the Python bindings may import it as well. Cold.

mod band;
mod error;
mod experiment;
mod identified;
mod options;
mod search;

pub use band::{Band, BandSearch};
pub use error::IdentificationError;
pub use experiment::{Experiment, Signals};
pub use identified::{Described, Form, Identified};
pub use options::{ExperimentOptions, WAVEFORMS, waveform_name};
pub use search::identify;

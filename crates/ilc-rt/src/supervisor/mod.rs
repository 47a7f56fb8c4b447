//! The campaign: brings the nodes up, paces the loop, learns between runs, keeps every run, and says
//! what happens.
//!
//! The owner of loop, library and telemetry; only the binary and the Python bindings import it. Cold:
//! it reads the loop's mailbox and never shares anything else with it.

mod announce;
mod band;
mod campaign;
mod claim;
mod collect;
mod disturbance;
mod error;
mod experiment;
mod fingerprint;
mod forecast;
mod identified;
mod keeper;
mod law;
mod learner;
mod nodes;
mod options;
mod pace;
mod plan;
mod program;
mod progress;
mod reason;
mod telemetry;

pub use band::{Band, BandSearch};
pub use campaign::{identify, run};
pub use disturbance::Disturbance;
pub use error::SupervisorError;
pub use experiment::Experiment;
pub use forecast::{first_error, learning_model};
pub use identified::{Described, Identified};
pub use law::Prepared;
pub use nodes::drive_setup;
pub use options::{Options, Outcome};
pub use plan::Plan;

//! The campaign: brings the nodes up, paces the loop, learns between runs, stores every run, and
//! publishes events.
//!
//! The owner of loop, library and telemetry; only `cli`, the simulator (its buses) and the Python bindings import it. Cold: it
//! reads the loop's mailbox and never shares anything else with it.

mod announce;
mod before_run;
mod buses;
mod claim;
mod collect;
pub mod control;
mod disturbance;
mod ending;
mod error;
mod execute;
mod fault;
mod first_input;
mod frozen;
mod homing;
pub mod input;
mod inputs;
mod keep;
mod keeper;
mod late;
mod learner;
mod nodes;
mod options;
mod own;
mod pace;
mod reason;
mod recorded_late;
mod recording;
mod relearn;
pub mod replay;
mod resume;
mod rollback;
mod running;
mod runs;
pub mod summary;
mod telemetry;
pub mod traffic;
mod travel;

pub use buses::open_buses;
pub use disturbance::{Disturbance, DisturbanceError};
pub use error::{CampaignError, ResumeError};
pub use execute::{identify, run};
pub use homing::{Homed, HomedAxis, home, homing_axes};
pub use nodes::drive_setup;
pub use options::{Options, Outcome, Session, StartOn};
pub use recorded_late::late_of;
pub use travel::{Arrival, Goal, Travel, Traveling, travel};

//! CiA 402 drive profile: states, objects, process data, units and the bring-up of a drive.
//!
//! What the servo cycle needs of a drive (hot) and what set-up needs (cold: [`mod@bring_up`]); imported by
//! `servo`, `supervisor` and the simulator. Imports `canopen` and the frame only.

pub mod bring_up;
mod bring_up_error;
pub mod mode;
pub mod objects;
pub mod pdo_map;
mod process_data;
mod remote;
mod scaling;
mod setting;
mod settings;
pub mod state;
pub mod units;

pub use bring_up::{DriveIdentity, DriveSetup, EncoderIdentity, bring_up, bring_up_encoder};
pub use bring_up_error::BringUpError;
pub use mode::Mode;
pub use pdo_map::{Command, EncoderSample, Extra, Status};
pub use state::{Controlword, State, Statusword, next_command};
pub use units::Scale;

//! CiA 402 drive profile: states, objects, modes, process data and units.
//!
//! Imported by `servo`, `bring_up`, `campaign` and the simulator. Imports `canopen` and the frame only.

pub mod mode;
pub mod objects;
pub mod pdo_map;
pub mod process_data;
pub mod state;
pub mod units;

pub use mode::{InputKind, Mode};
pub use pdo_map::{CommandRpdo1, DriveMotionTpdo2, EncoderSample, StatusTpdo1};
pub use process_data::{MapError, OptionalObjects, PdoLayout, PdoMap, Reading, Supervision};
pub use state::{Controlword, State, Statusword, next_command};
pub use units::Scale;

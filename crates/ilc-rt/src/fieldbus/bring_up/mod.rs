//! Cold: the bring-up of nodes over SDO, and the checks of a bus before the loop begins.
//!
//! For `campaign`, the simulator and tests; never called in a tick. Imports the codecs of `canopen`
//! and `cia402`, and the bus.
//!
//! Family: `drive`, `own`, `scaling`, `setting` and `settings`: a drive is brought up from its own set-up.

mod drive;
mod error;
mod homed;
pub mod listen;
mod misfit;
mod own;
mod process_data;
mod remote;
mod scaling;
mod sdo_client;
mod setting;
mod settings;

pub use drive::{
    DriveIdentity, DriveSetup, EncoderIdentity, FOLLOWING_ERROR_TIME_MS, bring_up, bring_up_encoder,
};
pub use error::BringUpError;
pub use homed::{enter_homing_mode, is_homed};
pub use misfit::{Found, Required};
pub use own::{DriveOwn, HomingObjects, StartUpObject, is_keepable, is_set};
pub use sdo_client::{SdoClient, SdoError, Stray, TRIES};
pub use setting::{Kind, Need};

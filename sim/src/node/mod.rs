//! Simulated CANopen nodes: dictionary, SDO server, NMT slave, process data, and the CiA 402 drive.
//!
//! Nodes exchange frames on one side and demands and measurements on the other; they are
//! independent of plant and clock, and do not allocate after creation. Imported by `machine` and
//! `eds`.
//!
//! Family: `communication`, `drive`, `drive_objects`, `drive_slots`, `positioning`, `profile_modes`,
//! `profile_objects`, `step_objects` and `units`: the dictionary of a drive holds the parameters of its modes.

pub mod communication;
pub mod dictionary;
pub mod drive;
pub mod drive_mode;
pub mod drive_objects;
mod drive_slots;
mod emergencies;
pub mod encoder;
mod heartbeats;
mod homing;
pub mod motion;
mod object_access;
pub mod pdo_engine;
pub mod pdo_rules;
mod positioning;
pub mod profile;
mod profile_modes;
pub mod profile_objects;
mod reactions;
pub mod sdo_server;
mod shown;
pub mod standard_objects;
pub mod state_machine;
mod step_objects;
pub mod switches;
mod sync_service;
mod target;
pub mod units;
pub mod value;

pub use dictionary::Dictionary;
pub use drive::{DriveNode, DriveParameters};
pub use encoder::EncoderNode;

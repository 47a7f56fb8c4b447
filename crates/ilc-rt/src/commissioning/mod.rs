//! Commissioning of nodes over SDO: the bus is scanned, objects are read and written, drives are described, disabled
//! and reset. Nothing here moves an axis: moves belong to the servo loop of `campaign`.
//!
//! `campaign` and `cli` import it. Cold: it waits for answers.

mod company;
mod error;
mod faults;
mod object;
mod power;
mod scan;
mod status;
mod words;

pub use company::{Company, listen};
pub use error::CommissioningError;
pub use faults::{Faults, faults, reported};
pub use object::{DataType, ObjectValue, parse_address, read_object, write_object};
pub use power::{disable, reset};
pub use scan::{FoundDrive, FoundNode, scan};
pub use status::{AxisStatus, axis_status};
pub use words::{input_names, mode_name, mode_names, power_lost, warning_names};

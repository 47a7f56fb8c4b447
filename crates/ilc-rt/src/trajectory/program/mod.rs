//! Part programs: text that says where the tool goes, turned into segments. Cold.

mod gcode;

pub use gcode::{GcodeError, GcodeProgram, read_gcode};

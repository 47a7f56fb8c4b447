//! Programs as text: part programs that say where the tool goes, and tables of set points. Cold.

mod gcode;
mod table;

pub use gcode::{GcodeError, GcodeProgram, read_gcode};
pub use table::{SetPointTable, TableError, read_table};

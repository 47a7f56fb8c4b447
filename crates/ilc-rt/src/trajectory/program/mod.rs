//! Programs as text: part programs that say where the tool goes, and tables of set points. Cold.
//!
//! Both are read from bytes, whatever they are: what cannot be meant is refused with its line.

mod block;
mod code;
mod gcode;
mod modal;
mod table;
mod text;
mod token;

pub use gcode::{GcodeError, GcodeProgram, GcodeSetting, read_gcode};
pub use table::{SetPointTable, TableError, read_table};

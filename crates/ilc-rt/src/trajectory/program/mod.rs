//! Programs as text: part programs that say where the tool goes, and tables of set points. Cold.
//!
//! Both are read from bytes, whatever they are: what cannot be meant is refused with its line.

mod block;
mod code;
mod error;
mod gcode;
mod modal;
mod part_program;
mod table;
mod text;
mod token;

pub use error::GcodeError;
pub use gcode::read_gcode;
pub use part_program::{GcodeProgram, GcodeSetting};
pub use table::{SetPointTable, TableError, read_table};

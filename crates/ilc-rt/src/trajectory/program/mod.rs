//! Programs as text: part programs, and tables of set points. Cold.
//!
//! Both are read from arbitrary bytes: invalid text is refused with its line.

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

//! The kinds of path that `[program]` can name: a file and a line of the list below each.
//!
//! A kind has the table of its own numbers, says which other keys it reads, and plans a [`Job`].
//! `config` composes the cell description of it, `design` plans by it, and documents and the tests that
//! go over all kinds read it.
//!
//! Family: every file here, as the program is composed of the tables of its kinds, and a kind plans from
//! the whole of it.

mod butterfly;
mod gcode;
mod job;
mod modulated;
mod points;
mod program;
mod raster;
mod spiral;
mod spline;
mod table;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub use butterfly::ButterflySection;
pub use job::{Job, ProgramError};
pub use modulated::ModulatedSection;
pub use program::{Corner, Key, Program, Segment};
pub use raster::RasterSection;
pub use spiral::SpiralSection;

use crate::interpolate::Interpolator;

/// A kind of path, as the list has it.
#[derive(Debug)]
pub struct Kind {
    /// The keys and tables of `[program]` that it reads, of those that not every kind does.
    pub reads: &'static [Key],
    /// Those of them that it cannot do without.
    pub needs: &'static [Key],
    /// The part program or table that `file` names.
    pub file: Option<FileKind>,
    /// True for a shape in a plane, which needs a cell of two axes.
    pub is_plane: bool,
    /// Plans a run.
    pub plan: fn(&Job) -> Result<Interpolator, ProgramError>,
    /// A program in a few words.
    pub describe: fn(&Program) -> String,
    /// A `[program]` of this kind, for a cell of two axes at rest in 0.
    pub example: &'static str,
    /// The content of its file.
    pub example_file: &'static str,
}

/// A file that a program names.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// The name of its content, as `G-code`.
    pub content: &'static str,
    /// Largest size.
    pub bytes_max: u64,
}

macro_rules! kinds {
    ($($(#[$attribute:meta])* $kind:ident $file:ident;)*) => {
        /// The kind of a program's path.
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema,
        )]
        #[serde(rename_all = "snake_case")]
        pub enum PathKind {
            $($(#[$attribute])* $kind,)*
        }

        impl PathKind {
            /// Every kind.
            pub const ALL: &[Self] = &[$(Self::$kind),*];

            /// The name as a cell description has it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => stringify!($file),)*
                }
            }

            /// The entry of the list.
            pub const fn entry(self) -> &'static Kind {
                match self {
                    $(Self::$kind => &$file::KIND,)*
                }
            }
        }
    };
}

kinds! {
    /// Straight moves and arcs, `[[program.segment]]`.
    #[default]
    Points points;
    /// A smooth curve through the points of `[[program.segment]]`.
    Spline spline;
    /// `[program.butterfly]`.
    Butterfly butterfly;
    /// `[program.spiral]`.
    Spiral spiral;
    /// `[program.raster]`.
    Raster raster;
    /// The legs of `[[program.segment]]` with the oscillation of `[program.modulated]`.
    Modulated modulated;
    /// A part program, `file`.
    Gcode gcode;
    /// Set points, one row a servo cycle, `file`.
    Table table;
}

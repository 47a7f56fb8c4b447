//! The kinds of path that `[program]` can name: a file and a line of the list below each.
//!
//! A kind has the table of its own numbers, declares the other keys that it reads, and plans a
//! [`Job`]. `config` builds the cell description from the kinds, `design` plans with them, and
//! documents and the tests over all kinds read them.
//!
//! Family: every file here, since the program consists of the tables of its kinds, and a kind plans
//! from all of it.

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

/// A kind of path, as an entry of the list.
#[derive(Debug)]
pub struct Kind {
    /// Keys and tables of `[program]` that it reads, apart from those common to all kinds.
    pub reads: &'static [Key],
    /// Required keys among them.
    pub needs: &'static [Key],
    /// Part program or table named by `file`.
    pub file: Option<FileKind>,
    /// True for a plane shape, which requires a cell of two axes.
    pub is_plane: bool,
    /// Its path in the words of the documents, Markdown.
    pub summary: &'static str,
    /// Plans a run.
    pub plan: fn(&Job) -> Result<Interpolator, ProgramError>,
    /// A program in a few words.
    pub describe: fn(&Program) -> String,
    /// A `[program]` of this kind, for a cell of two axes at rest in 0.
    pub example: &'static str,
    /// The content of its file.
    pub example_file: &'static str,
}

/// A file named by a program.
#[derive(Clone, Copy, Debug)]
pub struct FileKind {
    /// Name of its content, such as `G-code`.
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

            /// Name in a cell description.
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
    /// Set points, one row per servo cycle, `file`.
    Table table;
}

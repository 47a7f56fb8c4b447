//! Electronic data sheets of drives (EDS) and their configured form (DCF), CiA 306: read, and turned
//! into the section `[axis.drive]` of a cell description.
//!
//! For `ilc-rt drive import`. Files of vendors are seldom flawless: what is not understood is left out,
//! and only a drive that could not run is refused.

mod error;
mod import;
mod number;
mod section;
mod sheet;

pub use error::DataSheetError;
pub use import::{Imported, Lack, import};
pub use section::{section, with_section};
pub use sheet::{Access, DataSheet, SheetObject};

//! `ilc-rt schema`: the JSON schema of the cell description.

use clap::Args;

use super::{EXIT_FAILURE, show};
use crate::config::Cell;
use crate::schema::for_editors;

#[derive(Args)]
#[command(after_help = "Example:
  ilc-rt schema > cell.schema.json")]
pub(super) struct SchemaArguments {}

/// Prints the schema; returns the exit status.
pub(super) fn schema(_: &SchemaArguments) -> u8 {
    if show::print(&format!("{:#}\n", for_editors::<Cell>())) { 0 } else { EXIT_FAILURE }
}

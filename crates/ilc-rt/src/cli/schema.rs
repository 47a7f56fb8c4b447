//! `ilc-rt schema`: the JSON schema of the cell description, and the derived tables of documents.

use std::path::PathBuf;

use clap::Args;

use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::config::{Cell, read_file};
use crate::schema::{fill, for_editors, inlined};

/// Largest document.
const DOCUMENT_BYTES_MAX: u64 = 16 << 20;

#[derive(Args)]
#[command(after_help = "Example:
  ilc-rt schema > cell.schema.json")]
pub(super) struct SchemaArguments {
    /// Print this document instead, with the tables between its marks written from the schema.
    #[arg(long, value_name = "FILE", hide = true)]
    document: Option<PathBuf>,
}

/// Prints the schema; returns the exit status.
pub(super) fn schema(arguments: &SchemaArguments) -> u8 {
    let text = match &arguments.document {
        None => Ok(format!("{:#}\n", for_editors::<Cell>())),
        Some(path) => read_file(path, DOCUMENT_BYTES_MAX)
            .and_then(|bytes| fill(&String::from_utf8_lossy(&bytes), inlined::<Cell>().as_value()))
            .map_err(|reason| format!("{}: {reason}", path.display())),
    };
    match text {
        Ok(text) if show::print(&text) => 0,
        Ok(_) => EXIT_FAILURE,
        Err(reason) => {
            show::complain(&reason);
            EXIT_BAD_INPUT
        }
    }
}

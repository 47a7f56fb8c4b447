//! `ilc-rt input`: learned inputs as files.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};

use super::{EXIT_BAD_INPUT, show};
use crate::campaign::CampaignError;
use crate::campaign::input::{self, Chosen, InputError, Source};
use crate::config::{Cell, Measure};
use crate::design::Plan;
use crate::library::Library;

#[derive(Args)]
pub(super) struct InputArguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// Write the learned input of a run of the library to a file.
    Export(ExportArguments),
}

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt input export gantry.toml --from best gantry-input.json
  ilc-rt input export gantry.toml --from 2 --library gantry.db gantry-input.json")]
struct ExportArguments {
    /// Cell description.
    cell: PathBuf,
    /// File to write.
    file: PathBuf,
    /// Run of the library: its id, best or last.
    #[arg(long, value_name = "ID|best|last", default_value = "best")]
    from: Source,
    /// Library file.
    #[arg(long, value_name = "FILE", default_value = "ilc-library.db")]
    library: PathBuf,
    /// Measurement that was learned from, in place of the cell's.
    #[arg(long, value_parser = PossibleValuesParser::new(["encoder", "tcp"]).map(|name| measure(&name)))]
    measure: Option<Measure>,
}

fn measure(name: &str) -> Measure {
    if name == "tcp" { Measure::Tcp } else { Measure::Encoder }
}

/// Runs a verb on inputs; returns the exit status.
pub(super) fn input(arguments: &InputArguments) -> u8 {
    let Verb::Export(arguments) = &arguments.verb;
    match export(arguments) {
        Ok(chosen) => {
            show::say(&format!(
                "{}: input of {}, {} samples",
                arguments.file.display(),
                chosen.origin,
                chosen.task.n_samples()
            ));
            0
        }
        Err(error) => {
            show::complain(&error);
            EXIT_BAD_INPUT
        }
    }
}

fn export(arguments: &ExportArguments) -> Result<Chosen, CampaignError> {
    let cell = Cell::load(&arguments.cell)?;
    let plan = Plan::new(&cell, arguments.measure, false)?;
    let path = arguments.library.display().to_string();
    if !arguments.library.exists() {
        return Err(InputError::NoLibrary { path }.into());
    }
    let chosen = Library::read_with(&arguments.library, |library| {
        input::choose(library, &path, arguments.from, (&cell, &plan), |figures| {
            figures.is_incomplete()
        })
    })??;
    input::save(&chosen, cell.n_axes(), &arguments.file)?;
    Ok(chosen)
}

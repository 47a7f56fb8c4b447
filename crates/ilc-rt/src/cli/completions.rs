//! `ilc-rt completions`: a script for the shell that completes verbs, options and their values.

use clap::{Args, Command};
use clap_complete::{Shell, generate};

use super::{EXIT_FAILURE, show};

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt completions bash > /etc/bash_completion.d/ilc-rt
  ilc-rt completions zsh > ~/.zfunc/_ilc-rt")]
pub(super) struct CompletionsArguments {
    /// The shell.
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the script; returns the exit status.
pub(super) fn completions(arguments: &CompletionsArguments, mut command: Command) -> u8 {
    let mut script = Vec::new();
    generate(arguments.shell, &mut command, "ilc-rt", &mut script);
    // The generator for bash writes one name in two ways if it has a hyphen, and then completes no
    // options.
    let script = String::from_utf8_lossy(&script).replace("ilc__subcmd__rt__", "ilc__rt__");
    if show::print(&script) { 0 } else { EXIT_FAILURE }
}

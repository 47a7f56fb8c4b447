//! `ilc-rt init`: a cell description to begin with, written from the schema.

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};
use crate::config::Cell;
use crate::schema::{inlined, template};

/// The cell with the values of the template.
const EXAMPLE: &str =
    include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_gantry.toml"));
/// First lines of the template.
const HEAD: &str = "\
# A cell description for ilc-rt. What stands here moves a gantry of two axes on simulated drives; each key is
# explained above it, with what is allowed. Keys behind # have the value that they have when they are left out.
#
# `ilc-rt schema > cell.schema.json` makes editors complete and check the keys:
#:schema ./cell.schema.json
";

#[derive(Args)]
#[command(after_help = "Example:
  ilc-rt init mill.toml")]
pub(super) struct InitArguments {
    /// File to write, - for standard output; one that is there already is left as it is.
    #[arg(default_value = "cell.toml")]
    file: PathBuf,
}

/// Writes the template; returns the exit status.
pub(super) fn init(arguments: &InitArguments) -> u8 {
    let text = text();
    let path = arguments.file.display();
    if arguments.file.as_os_str() == "-" {
        return if show::print(&text) { 0 } else { EXIT_FAILURE };
    }
    let opened = OpenOptions::new().write(true).create_new(true).open(&arguments.file);
    match opened.and_then(|mut file| file.write_all(text.as_bytes())) {
        Ok(()) => {
            show::say(&format!("{path} is written; `ilc-rt check {path}` tells what it would do"));
            0
        }
        Err(error) => {
            show::complain(&format!("{path}: cannot be written: {error}"));
            EXIT_BAD_INPUT
        }
    }
}

fn text() -> String {
    let example = EXAMPLE.parse().unwrap_or_default();
    format!("{HEAD}{}", template(inlined::<Cell>().as_value(), &example))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_is_the_example_with_every_key_explained() {
        let (found, example) = (text(), EXAMPLE);
        let parse = |text: &str| Cell::parse(text, "cell.toml").unwrap();
        assert_eq!(parse(&found), parse(example));
        for part in [
            "# [learning.relevance]",
            "# Jerk limit. (0.001 to 10000000)",
            "# [[learning.norm_optimal.phase]]",
        ] {
            assert!(found.contains(part), "{part}: {found}");
        }
        let longest = found.lines().map(|line| line.chars().count()).max();
        assert!(longest < Some(120), "{longest:?}");
        // Uncommenting a section enables it.
        let pd =
            found.replace("# [learning.pd]", "[learning.pd]").replace("# kp = 0.5", "kp = 0.4");
        assert!((parse(&pd).learning.pd.kp - 0.4).abs() < 1e-12);
    }
}

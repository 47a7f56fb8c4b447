//! Options as data: their description for other programs, and their parsing from those programs'
//! words.
//!
//! `ilc` and the Python package offer the options of [`crate::campaign::Options`] and
//! [`crate::identification::ExperimentOptions`] under the same names, with the same defaults and help.

use std::any::TypeId;
use std::path::PathBuf;

use clap::{Arg, ArgAction, Args, Command};
use serde::Serialize;

use super::refusal_text;

/// Description of an option.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OptionSpec {
    /// Identifier, as a keyword in Python.
    pub name: String,
    /// Names on a command line, the long one first.
    pub flags: Vec<String>,
    /// Help text, one sentence.
    pub help: String,
    /// Kind of its value: `flag`, `inverse_flag`, `integer`, `number`, `choice`, `path`, `text`,
    /// or `renamed`: refused with the new name, which is its help.
    pub kind: &'static str,
    /// Default, as on a command line.
    pub default: Option<String>,
    /// Allowed values of a choice.
    pub choices: Vec<String>,
    /// Placeholder of the value in a help text.
    pub placeholder: Option<String>,
}

/// Returns the description of every option of a kind.
pub fn described<T: Args>() -> Vec<OptionSpec> {
    command::<T>().get_arguments().map(spec).collect()
}

/// Parses options from the words of a command line.
///
/// # Errors
/// One line that names the option, its value and what is allowed.
pub fn parse<T: Args>(words: &[String]) -> Result<T, String> {
    let parsed = command::<T>().try_get_matches_from(words);
    parsed.and_then(|matches| T::from_arg_matches(&matches)).map_err(|error| refusal_text(&error))
}

fn command<T: Args>() -> Command {
    let command = Command::new("options").no_binary_name(true).disable_help_flag(true);
    T::augment_args(command)
}

fn spec(argument: &Arg) -> OptionSpec {
    let long = argument.get_long().map(|name| format!("--{name}"));
    let short = argument.get_short().map(|name| format!("-{name}"));
    let choices = argument.get_possible_values();
    let value = argument.get_value_parser().type_id();
    let kind = match argument.get_action() {
        _ if argument.is_hide_set() => "renamed",
        ArgAction::SetTrue => "flag",
        ArgAction::SetFalse => "inverse_flag",
        _ if !choices.is_empty() => "choice",
        _ if value == TypeId::of::<u32>() || value == TypeId::of::<usize>() => "integer",
        _ if value == TypeId::of::<f64>() => "number",
        _ if value == TypeId::of::<PathBuf>() => "path",
        _ => "text",
    };
    let has_value = !matches!(kind, "flag" | "inverse_flag");
    let default = argument.get_default_values().first().filter(|_| has_value);
    let placeholder = argument.get_value_names().and_then(|names| names.first());
    OptionSpec {
        name: argument.get_id().to_string(),
        flags: long.into_iter().chain(short).collect(),
        help: argument.get_help().map_or_else(String::new, |help| {
            if kind == "renamed" { help.to_string() } else { format!("{help}.") }
        }),
        kind,
        default: default.map(|text| text.to_string_lossy().into_owned()),
        choices: if has_value {
            choices.iter().map(|choice| choice.get_name().to_owned()).collect()
        } else {
            Vec::new()
        },
        placeholder: placeholder.filter(|_| has_value).map(ToString::to_string),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Options;

    #[test]
    fn options_are_described_as_they_are_parsed() {
        let specs = described::<Options>();
        let of = |name: &str| specs.iter().find(|spec| spec.name == name).unwrap();
        let iterations = of("iterations");
        assert_eq!(iterations.flags, ["--iterations", "-n"]);
        assert_eq!((iterations.kind, iterations.default.as_deref()), ("integer", Some("10")));
        assert!(iterations.help.ends_with('.'), "{}", iterations.help);
        assert_eq!((of("learning").kind, of("resume").kind), ("inverse_flag", "flag"));
        assert_eq!(of("measure").choices, ["encoder", "tcp"]);
        assert_eq!(of("library").kind, "path");
        let defaults: Options = parse(&[]).unwrap();
        assert!(defaults.learning && defaults.session.telemetry && !defaults.resume);
        let words = ["--no-learning", "-n", "3", "--measure", "tcp"].map(str::to_owned);
        let given: Options = parse(&words).unwrap();
        assert!(!given.learning && given.iterations == 3 && given.session.measure.is_some());
    }

    #[test]
    fn a_refusal_names_option_value_and_what_is_allowed() {
        let refused = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|word| (*word).to_owned()).collect();
            parse::<Options>(&words).unwrap_err()
        };
        let line = refused(&["--iterations", "0"]);
        assert_eq!(line, "invalid value '0' for '--iterations <N>': allowed 1 to 4294967295");
        assert!(refused(&["--measure", "nose"]).contains("[possible values: encoder, tcp]"));
        assert!(refused(&["--frobnicate"]).contains("'--frobnicate'"));
    }
}

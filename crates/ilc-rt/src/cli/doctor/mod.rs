//! `ilc-rt doctor`: what keeps this computer from being punctual, and the command that mends it; only reads.

mod can;
mod host;

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::figures::FiguresFile;
use super::{EXIT_BAD_INPUT, EXIT_FAILURE, show};

#[derive(Args)]
#[command(after_help = "Examples:
  ilc-rt doctor
  ilc-rt doctor --json doctor.json")]
pub(super) struct DoctorArguments {
    /// Write the findings to a file; - for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
struct Finding {
    /// Part of the computer.
    what: String,
    verdict: Verdict,
    /// State of it.
    found: String,
    /// Command that mends it; absent if nothing has to be.
    mend: Option<String>,
}

/// Verdict on a part of the computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Verdict {
    /// As it should be.
    Good,
    /// The loop runs, but can be late.
    Poor,
    /// Not to be found out, or not on this computer.
    Unknown,
}

impl Finding {
    fn good(what: &str, found: impl Into<String>) -> Self {
        Self { what: what.to_owned(), verdict: Verdict::Good, found: found.into(), mend: None }
    }

    fn poor(what: &str, found: impl Into<String>, mend: impl Into<String>) -> Self {
        let mend = Some(mend.into());
        Self { what: what.to_owned(), verdict: Verdict::Poor, found: found.into(), mend }
    }

    fn unknown(what: &str, found: impl Into<String>) -> Self {
        Self { verdict: Verdict::Unknown, ..Self::good(what, found) }
    }
}

/// Examines this computer; returns the exit status.
pub(super) fn doctor(arguments: &DoctorArguments) -> u8 {
    let file = match &arguments.json {
        None => None,
        Some(path) => match FiguresFile::reserve(path, false) {
            None => return EXIT_BAD_INPUT,
            reserved => reserved,
        },
    };
    let root = Path::new("/");
    let mut findings = host::examine(root);
    findings.extend(host::rights());
    findings.extend(can::examine(root));
    for finding in &findings {
        show::say(&line(finding));
        if let Some(mend) = &finding.mend {
            show::say(&format!("{:<18}{mend}", ""));
        }
    }
    let n_poor = findings.iter().filter(|finding| finding.verdict == Verdict::Poor).count();
    show::say(&match n_poor {
        0 => "nothing to mend; ilc-rt latency measures how punctual this computer is".to_owned(),
        1 => "1 finding to mend".to_owned(),
        n => format!("{n} findings to mend"),
    });
    match file {
        Some(file) if !file.write(&serde_json::json!({ "findings": findings })) => EXIT_FAILURE,
        _ => 0,
    }
}

fn line(finding: &Finding) -> String {
    let verdict = match finding.verdict {
        Verdict::Good => "good",
        Verdict::Poor => "poor",
        Verdict::Unknown => "-",
    };
    format!("{verdict:<6}{:<12}{}", finding.what, finding.found)
}

/// Returns the first line of a file of the system, below a root.
fn first_line(root: &Path, path: &str) -> Option<String> {
    let text = std::fs::read_to_string(root.join(path.trim_start_matches('/'))).ok()?;
    text.lines().next().map(|line| line.trim().to_owned())
}

/// Returns the names in a folder of the system, below a root, sorted.
fn names(root: &Path, path: &str) -> Vec<String> {
    let entries = std::fs::read_dir(root.join(path.trim_start_matches('/')));
    let mut names: Vec<String> = entries
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with files of a system, removed when dropped.
    pub(super) struct System(pub(super) PathBuf);

    impl System {
        pub(super) fn new(name: &str, files: &[(&str, &str)]) -> Self {
            let root = std::env::temp_dir().join(format!("ilc-{name}-{}", std::process::id()));
            for (path, text) in files {
                let path = root.join(path);
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                std::fs::write(path, text).unwrap();
            }
            Self(root)
        }
    }

    impl Drop for System {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn a_finding_is_a_line() {
        let finding = Finding::poor("governor", "powersave", "cpupower");
        assert_eq!(line(&finding), "poor  governor    powersave");
    }
}

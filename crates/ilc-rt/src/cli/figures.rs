//! Target of `--json`, a file or standard output: checked before anything moves, written at the end.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use super::show;
use crate::record::{TEXT_MAX, printable, printable_json};

/// Name of standard output in place of a file.
const STANDARD_OUTPUT: &str = "-";

/// A writable place for figures, as far as the system can tell.
pub(super) struct FiguresFile {
    path: PathBuf,
    is_new: bool,
}

impl FiguresFile {
    /// Opens the file without changing it; otherwise prints the reason in one line. For `-` all
    /// other lines go to standard error from now on, so that the figures stand alone, which they
    /// cannot beside `events`.
    pub(super) fn reserve(path: &Path, events: bool) -> Option<Self> {
        if path.as_os_str() == STANDARD_OUTPUT {
            if events {
                show::complain(&"--json -: not with --events, which go to standard output as well");
                return None;
            }
            show::leave_standard_output();
            return Some(Self { path: path.to_owned(), is_new: false });
        }
        let is_new = !path.exists();
        match OpenOptions::new().create(true).append(true).open(path) {
            Ok(_) => Some(Self { path: path.to_owned(), is_new }),
            Err(error) => {
                complain(path, &error);
                None
            }
        }
    }

    /// Deletes a file that did not exist before.
    pub(super) fn give_up(&self) {
        if self.is_new {
            // A failure is harmless: an empty file remains.
            let _ = std::fs::remove_file(&self.path);
        }
    }

    /// Writes the figures; returns true on success.
    pub(super) fn write(&self, figures: &serde_json::Value) -> bool {
        let text = printable_json(&format!("{figures:#}\n"));
        if self.path.as_os_str() == STANDARD_OUTPUT {
            return show::print(&text);
        }
        match std::fs::write(&self.path, text) {
            Ok(()) => true,
            Err(error) => {
                complain(&self.path, &error);
                false
            }
        }
    }
}

fn complain(path: &Path, error: &std::io::Error) {
    show::complain(&format!(
        "--json {}: cannot be written: {error}; allowed: a file in a folder that exists, or - for \
         standard output",
        printable(&path.display().to_string(), TEXT_MAX)
    ));
}

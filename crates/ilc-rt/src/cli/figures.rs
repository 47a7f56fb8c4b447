//! The file that `--json` names: looked at before anything moves, written when all is over.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use super::show;

/// A file that can be written, as far as the system can tell.
pub(super) struct FiguresFile {
    path: PathBuf,
    is_new: bool,
}

impl FiguresFile {
    /// Opens the file without changing it; says in one line why it cannot be, if so.
    pub(super) fn reserve(path: &Path) -> Option<Self> {
        let is_new = !path.exists();
        match OpenOptions::new().create(true).append(true).open(path) {
            Ok(_) => Some(Self { path: path.to_owned(), is_new }),
            Err(error) => {
                complain(path, &error);
                None
            }
        }
    }

    /// Leaves no trace of a file that was not there before.
    pub(super) fn give_up(&self) {
        if self.is_new {
            // Nothing depends on it: what remains would be an empty file.
            let _ = std::fs::remove_file(&self.path);
        }
    }

    /// Writes the figures; returns whether they are there now.
    pub(super) fn write(&self, figures: &serde_json::Value) -> bool {
        match std::fs::write(&self.path, format!("{figures:#}\n")) {
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
        "--json {}: cannot be written: {error}; allowed: a file in a folder that exists",
        path.display()
    ));
}

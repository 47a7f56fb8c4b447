//! The folder of recordings: names of new ones, and the deletion of the oldest.

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::error::RecordingError;

/// End of the name of a recording.
pub const SUFFIX: &str = ".mcap";
/// Largest number in a name.
const NUMBER_MAX: u32 = 100_000;

/// Returns whether recordings go into a folder, under names of their own: it is one, or ends with `/`.
pub fn is_folder(path: &Path) -> bool {
    path.is_dir() || path.to_string_lossy().ends_with('/')
}

/// Makes the file of a recording, locked as long as it is open; returns it with its path.
pub(super) fn create(path: &Path, name: &str) -> Result<(File, PathBuf), RecordingError> {
    let refused = |path: &Path, error: std::io::Error| RecordingError::Create {
        path: path.to_owned(),
        reason: error.to_string(),
    };
    if !is_folder(path) {
        let file = make(path).map_err(|error| refused(path, error))?;
        return Ok((file, path.to_owned()));
    }
    std::fs::create_dir_all(path).map_err(|error| refused(path, error))?;
    let mut number = 1;
    loop {
        let end = if number == 1 { String::new() } else { format!("-{number}") };
        let file = path.join(format!("{name}{end}{SUFFIX}"));
        match make(&file) {
            Ok(made) => return Ok((made, file)),
            Err(error)
                if error.kind() == std::io::ErrorKind::AlreadyExists && number < NUMBER_MAX =>
            {
                number += 1;
            }
            Err(error) => return Err(refused(&file, error)),
        }
    }
}

fn make(path: &Path) -> std::io::Result<File> {
    let file = OpenOptions::new().write(true).create_new(true).open(path)?;
    // A file system without locks: the file could be deleted as an old one by another program only.
    let _ = file.try_lock();
    Ok(file)
}

/// Deletes the oldest recordings of a cell in the folder of one, until at most `files` are left, and `bytes` in
/// them. One that is being written is left alone, this one included.
pub(super) fn thin(own: &Path, cell: &str, files: u32, bytes: Option<u64>) {
    let Some(folder) = own.parent() else { return };
    let mut found = recordings(folder, cell);
    found.sort();
    let mut n_files = found.len();
    let mut n_bytes: u64 = found.iter().map(|(_, _, size)| size).sum();
    for (_, path, size) in found {
        if n_files <= files as usize && bytes.is_none_or(|max| n_bytes <= max) {
            return;
        }
        if path == own || is_written(&path) {
            continue;
        }
        match std::fs::remove_file(&path) {
            Ok(()) => (n_files, n_bytes) = (n_files - 1, n_bytes - size),
            Err(error) => {
                tracing::warn!("{}: an old recording stays: {error}", path.display());
            }
        }
    }
}

/// Returns the recordings of a cell: time, path, size.
fn recordings(folder: &Path, cell: &str) -> Vec<(SystemTime, PathBuf, u64)> {
    let begin = format!("{cell}@");
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let of = |entry: std::fs::DirEntry| {
        let name = entry.file_name().to_string_lossy().into_owned();
        let known = entry.metadata().ok().filter(std::fs::Metadata::is_file)?;
        (name.starts_with(&begin) && name.ends_with(SUFFIX))
            .then(|| Some((known.modified().ok()?, entry.path(), known.len())))?
    };
    entries.filter_map(of).collect()
}

/// Returns whether another program writes a recording.
fn is_written(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return true };
    matches!(file.try_lock_shared(), Err(std::fs::TryLockError::WouldBlock))
}

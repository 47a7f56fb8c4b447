//! Files that contain a cell description, or that it names: regular ones of a bounded size.

use std::fs::OpenOptions;
use std::io::Read as _;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Component, Path};

/// Largest cell description.
pub const CELL_BYTES_MAX: u64 = 16 << 20;

/// Reads a regular file of a bounded size.
///
/// Pipes and devices are refused without waiting for them.
///
/// # Errors
/// The reason in a few words.
pub fn read_file(path: &Path, bytes_max: u64) -> Result<Vec<u8>, String> {
    // Otherwise opening a pipe would wait for its writer.
    let file = OpenOptions::new()
        .read(true)
        .custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY)
        .open(path)
        .map_err(|error| error.to_string())?;
    let found = file.metadata().map_err(|error| error.to_string())?;
    if !found.is_file() {
        return Err("not a regular file".to_owned());
    }
    let too_large = || format!("more than {bytes_max} bytes");
    if found.len() > bytes_max {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    // The size may have changed since, and some files do not report theirs.
    file.take(bytes_max + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() as u64 > bytes_max {
        return Err(too_large());
    }
    Ok(bytes)
}

/// Reads a file in the folder of a cell description, or below it.
///
/// # Errors
/// The reason in a few words: a name or a link that leads out of the folder, or as [`read_file`].
pub fn read_beside(cell_file: &Path, name: &Path, bytes_max: u64) -> Result<Vec<u8>, String> {
    let inside = |part: Component| matches!(part, Component::Normal(_) | Component::CurDir);
    if !name.components().all(inside) {
        return Err("it must be in the folder of the cell description".to_owned());
    }
    let folder = match cell_file.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let folder = folder.canonicalize().map_err(|error| error.to_string())?;
    let path = folder.join(name).canonicalize().map_err(|error| error.to_string())?;
    if !path.starts_with(&folder) {
        return Err("it must be in the folder of the cell description, and a link leads out of it"
            .to_owned());
    }
    read_file(&path, bytes_max)
}

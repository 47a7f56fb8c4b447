//! Place of the socket: a folder that no other user can change.

use std::fs::{self, DirBuilder, File, Metadata, OpenOptions, TryLockError};
use std::os::unix::fs::{DirBuilderExt as _, MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

use super::error::ControlError;

/// Mode of a folder for its owner alone.
const OWNER_ONLY: u32 = 0o700;
/// Mode bits with which others can write.
const OTHERS_WRITE: u32 = 0o022;
/// Mode bit with which others cannot replace what is not theirs.
const STICKY: u32 = 0o1000;

/// Returns the socket of a cell, without touching it: in `$XDG_RUNTIME_DIR/ilc-rt`, or without that
/// variable in `/tmp/ilc-rt-<user>`.
pub(super) fn socket(cell: &str) -> PathBuf {
    let given = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let folder = match given.filter(|folder| folder.is_absolute()) {
        Some(folder) => folder.join("ilc-rt"),
        None => std::env::temp_dir().join(format!("ilc-rt-{}", user())),
    };
    folder.join(format!("{cell}.sock"))
}

/// Prepares the folder of a socket, and takes the lock of its cell: it lasts as long as the file stays
/// open, and ends with its process, however that ends.
///
/// # Errors
/// [`ControlError::Unsafe`] for a folder that others can change; [`ControlError::Taken`] if another
/// controller holds the cell.
pub(super) fn prepare(socket: &Path) -> Result<File, ControlError> {
    let system = |path: &Path, source| ControlError::System { path: path.to_owned(), source };
    let folder = socket.parent().unwrap_or(Path::new("/"));
    match DirBuilder::new().mode(OWNER_ONLY).create(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::AlreadyExists => {
            return Err(system(folder, error));
        }
        _ => {}
    }
    let above = folder.parent().unwrap_or(Path::new("/"));
    let found = fs::metadata(above).map_err(|error| system(above, error))?;
    let is_shared = found.mode() & OTHERS_WRITE != 0 && found.mode() & STICKY == 0;
    require(above, &found, [0, user()].contains(&found.uid()) && !is_shared)?;
    check(folder)?;
    let path = socket.with_extension("lock");
    let lock = OpenOptions::new()
        .create(true)
        .truncate(false)
        .write(true)
        .mode(0o600)
        .custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK)
        .open(&path)
        .map_err(|error| system(&path, error))?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(TryLockError::WouldBlock) => Err(ControlError::Taken { path: socket.to_owned() }),
        Err(TryLockError::Error(error)) => Err(system(&path, error)),
    }
}

/// Ensures that a folder is one of this user that no other user can open.
pub(super) fn check(folder: &Path) -> Result<(), ControlError> {
    // Not of a link's target: a link could be changed by its owner.
    let found = fs::symlink_metadata(folder)
        .map_err(|source| ControlError::System { path: folder.to_owned(), source })?;
    let is_own = found.is_dir() && found.uid() == user() && found.mode() & 0o777 == OWNER_ONLY;
    require(folder, &found, is_own)
}

fn require(path: &Path, found: &Metadata, is_safe: bool) -> Result<(), ControlError> {
    if is_safe {
        return Ok(());
    }
    let kind = if found.is_dir() { "a folder" } else { "no folder" };
    let found = format!("{kind} of user {} with mode {:o}", found.uid(), found.mode() & 0o7777);
    Err(ControlError::Unsafe { path: path.to_owned(), found })
}

/// Returns the effective user of this process.
///
/// The owner of `/proc/self` is another one for a program with capabilities.
fn user() -> u32 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("Uid:"));
    line.and_then(|ids| ids.split_whitespace().nth(1)?.parse().ok()).unwrap_or(u32::MAX)
}

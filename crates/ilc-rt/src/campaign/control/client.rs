//! The client's side: one command, one reply.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::time::Duration;

use super::command::{Command, Reply};
use super::error::ControlError;
use super::folder;

/// Time that a controller may take to reply.
const PATIENCE: Duration = Duration::from_secs(5);
/// Bytes of a reply.
const REPLY_BYTES_MAX: u64 = 65_536;

/// Sends a command to the controller of a cell, and returns its reply.
///
/// # Errors
/// [`ControlError::Nobody`] if no controller listens; [`ControlError::Unsafe`] if the socket may belong
/// to another user; [`ControlError::Reply`].
pub fn send(cell: &str, command: Command) -> Result<Reply, ControlError> {
    let path = folder::socket(cell);
    let nobody = |source| {
        let (cell, path) = (cell.to_owned(), path.clone());
        ControlError::Nobody { cell, path, source }
    };
    let unreadable = |reason: String| ControlError::Reply { path: path.clone(), reason };
    let mut stream = UnixStream::connect(&path).map_err(nobody)?;
    if let Some(folder) = path.parent() {
        folder::check(folder)?;
    }
    let _ = stream.set_read_timeout(Some(PATIENCE));
    let text = serde_json::to_string(&command).map_err(|error| unreadable(error.to_string()))?;
    stream.write_all((text + "\n").as_bytes()).map_err(|error| unreadable(error.to_string()))?;
    let mut line = String::new();
    let mut reader = BufReader::new(stream.take(REPLY_BYTES_MAX));
    reader.read_line(&mut line).map_err(|error| unreadable(error.to_string()))?;
    if line.is_empty() {
        return Err(unreadable("the controller has too many clients".to_owned()));
    }
    serde_json::from_str(&line).map_err(|error| unreadable(error.to_string()))
}

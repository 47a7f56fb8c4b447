//! Reasons that a controller cannot be commanded.

use std::io;
use std::path::PathBuf;

/// Reason that there is no control, in one line.
#[derive(Debug, thiserror::Error)]
pub enum ControlError {
    /// Another controller of the same cell is at work.
    #[error("{}: another controller of this cell is at work; stop it first", path.display())]
    Taken {
        /// Its socket.
        path: PathBuf,
    },
    /// The folder of the socket is open to others.
    #[error(
        "{}: {found}; allowed: a folder of this user that no other user can write, as XDG_RUNTIME_DIR",
        path.display()
    )]
    Unsafe {
        /// Folder.
        path: PathBuf,
        /// Its owner or its mode.
        found: String,
    },
    /// Folder or socket cannot be created.
    #[error("{}: {source}", path.display())]
    System {
        /// Folder or socket.
        path: PathBuf,
        /// Reason given by the system.
        source: io::Error,
    },
    /// No controller listens.
    #[error("cell {cell}: no controller can be commanded ({} {source}); allowed: a cell that `ilc-rt run --ctl` runs", path.display())]
    Nobody {
        /// Cell.
        cell: String,
        /// Socket.
        path: PathBuf,
        /// Reason given by the system.
        source: io::Error,
    },
    /// The reply is unreadable.
    #[error("{}: no readable reply: {reason}", path.display())]
    Reply {
        /// Socket.
        path: PathBuf,
        /// Reason.
        reason: String,
    },
}

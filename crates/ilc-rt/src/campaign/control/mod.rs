//! Local control of a running campaign: start, pause, resume, feed, stop and status, over a Unix socket.
//!
//! Nothing on a network reaches it: the socket belongs to the user of the controller alone, in a folder
//! that is checked. It has its own thread, and passes orders to the loop through atomics: no client can
//! make the loop wait. The campaign and `cli` import it; it imports no other room of the campaign.

mod client;
mod command;
mod error;
mod folder;
mod server;
mod shared;

pub use client::send;
pub use command::{Command, Reply};
pub use error::ControlError;
pub use server::Server;
pub use shared::{Shared, Status};

/// Stop request of a client, in place of the number of a signal.
pub const STOPPED_BY_COMMAND: i32 = 1000;

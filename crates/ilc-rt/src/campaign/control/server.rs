//! The thread that answers clients.
//!
//! Bounded in everything: clients, bytes, and time. A client that is slow, silent or one too many is
//! closed; none can hold another up, and none is ever waited for by the loop.

use std::fs::{self, File, Permissions};
use std::io::{ErrorKind, Read as _, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use super::command::{Reply, execute};
use super::error::ControlError;
use super::folder;
use super::shared::Shared;

/// Clients at the same time; further ones are closed.
const CLIENTS_MAX: usize = 8;
/// Bytes of a command.
const LINE_BYTES_MAX: usize = 256;
/// Pause between two looks at the socket.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Looks from the connection to the whole command: two seconds, of which none pass while the computer stalls.
const LOOKS: u32 = 200;

/// The socket of a cell, with its thread.
#[derive(Debug)]
pub struct Server {
    path: PathBuf,
    ends: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    /// Held while the cell can be commanded.
    _lock: File,
}

impl Server {
    /// Opens the socket of a cell; that of a controller that was killed is replaced.
    ///
    /// # Errors
    /// [`ControlError`] for an unsafe folder, or if another controller has the cell.
    pub fn open(cell: &str, shared: Arc<Shared>) -> Result<Self, ControlError> {
        let path = folder::socket(cell);
        let lock = folder::prepare(&path)?;
        let system = |source| ControlError::System { path: path.clone(), source };
        // The lock says that no controller is behind it any more.
        match fs::remove_file(&path) {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(system(error)),
            _ => {}
        }
        let listener = UnixListener::bind(&path).map_err(system)?;
        fs::set_permissions(&path, Permissions::from_mode(0o600)).map_err(system)?;
        listener.set_nonblocking(true).map_err(system)?;
        let ends = Arc::new(AtomicBool::new(false));
        let thread = std::thread::Builder::new()
            .name("ilc-ctl".to_owned())
            .spawn({
                let ends = Arc::clone(&ends);
                move || serve(&listener, &shared, &ends)
            })
            .map_err(system)?;
        Ok(Self { path, ends, thread: Some(thread), _lock: lock })
    }

    /// Returns the path of the socket.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        let _ = fs::remove_file(&self.path);
    }
}

/// A connected client.
struct Client {
    stream: UnixStream,
    line: Vec<u8>,
    looks_left: u32,
}

fn serve(listener: &UnixListener, shared: &Shared, ends: &AtomicBool) {
    let mut clients: Vec<Client> = Vec::with_capacity(CLIENTS_MAX);
    while !ends.load(Ordering::Relaxed) {
        // As many at a time as may wait: a flood cannot keep the thread from its clients.
        for _ in 0..CLIENTS_MAX {
            let Ok((stream, _)) = listener.accept() else { break };
            if clients.len() < CLIENTS_MAX && stream.set_nonblocking(true).is_ok() {
                clients.push(Client { stream, line: Vec::new(), looks_left: LOOKS });
            }
        }
        clients.retain_mut(|client| !is_done(client, shared));
        std::thread::sleep(LOOK_EVERY);
    }
}

/// Reads what a client has sent, and answers a whole line; returns true when it is to be closed.
fn is_done(client: &mut Client, shared: &Shared) -> bool {
    let mut bytes = [0; LINE_BYTES_MAX];
    match client.stream.read(&mut bytes) {
        Ok(0) => true,
        Ok(n) => {
            client.line.extend_from_slice(&bytes[..n]);
            let end = client.line.iter().position(|byte| *byte == b'\n');
            if let Some(end) = end {
                answer(client, &execute(shared, &client.line[..end.min(LINE_BYTES_MAX)]));
            }
            end.is_some() || client.line.len() > LINE_BYTES_MAX
        }
        Err(error) if error.kind() == ErrorKind::WouldBlock => {
            client.looks_left = client.looks_left.saturating_sub(1);
            client.looks_left == 0
        }
        Err(_) => true,
    }
}

/// Sends a reply, which fits the buffer of a new socket; a client that does not take it gets none.
fn answer(client: &mut Client, reply: &Reply) {
    if let Ok(text) = serde_json::to_string(reply) {
        let _ = client.stream.write_all((text + "\n").as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::super::command::Command;
    use super::*;
    use crate::servo::Orders;

    fn shared() -> Arc<Shared> {
        Arc::new(Shared::new(Arc::new(Orders::new(false)), Arc::default()))
    }

    fn ask(path: &Path, bytes: &[u8]) -> Option<Reply> {
        let mut stream = UnixStream::connect(path).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        let _ = stream.write_all(bytes);
        let mut text = String::new();
        let _ = stream.read_to_string(&mut text);
        serde_json::from_str(&text).ok()
    }

    #[test]
    fn commands_become_orders_and_garbage_does_not() {
        let cell = format!("ctl-{}-orders", std::process::id());
        let shared = shared();
        let server = Server::open(&cell, Arc::clone(&shared)).unwrap();
        let path = server.path().to_owned();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        let send = |command: Command| {
            ask(&path, (serde_json::to_string(&command).unwrap() + "\n").as_bytes()).unwrap()
        };
        assert_eq!(send(Command::Feed { percent: 40 }).status.feed_percent, 40);
        for percent in [0, 101, u32::MAX] {
            let reply = send(Command::Feed { percent });
            assert!(reply.refused.unwrap().contains("allowed 1 to 100"), "{percent}");
            assert_eq!(reply.status.feed_percent, 40);
        }
        assert!(send(Command::Pause).status.paused && shared.orders.is_paused());
        assert!(!send(Command::Resume).status.paused);
        assert!(send(Command::Start).refused.unwrap().contains("allowed while it is waiting"));
        let garbage: [&[u8]; 5] =
            [b"\n", b"{}\n", b"\xff\xfe\n", b"{\"command\":\"jump\"}\n", b"[1,2]\n"];
        for line in garbage {
            assert!(ask(&path, line).unwrap().refused.unwrap().contains("not a command"));
        }
        assert!(
            ask(&path, "x".repeat(100_000).as_bytes()).is_none(),
            "too long a line gets no reply"
        );
        assert_eq!(shared.stop_number(), 0);
        send(Command::Stop);
        assert_eq!(shared.stop_number(), super::super::STOPPED_BY_COMMAND);
        drop(server);
        assert!(!path.exists());
    }

    #[test]
    fn silent_clients_keep_no_other_out_for_long() {
        let cell = format!("ctl-{}-slow", std::process::id());
        let server = Server::open(&cell, shared()).unwrap();
        let path = server.path().to_owned();
        let silent: Vec<_> = (0..50).map(|_| UnixStream::connect(&path).unwrap()).collect();
        let status = b"{\"command\":\"status\"}\n";
        let answered = (0..1000).any(|_| {
            std::thread::sleep(Duration::from_millis(20));
            ask(&path, status).is_some()
        });
        assert!(answered, "after the patience with the silent ones");
        drop(silent);
    }

    #[test]
    fn a_second_controller_is_refused_and_a_stale_socket_replaced() {
        let cell = format!("ctl-{}-two", std::process::id());
        let first = Server::open(&cell, shared()).unwrap();
        let path = first.path().to_owned();
        let refused = Server::open(&cell, shared()).unwrap_err();
        assert!(matches!(refused, ControlError::Taken { .. }), "{refused}");
        assert!(ask(&path, b"{\"command\":\"status\"}\n").is_some(), "the first one goes on");
        drop(first);
        // As a killed controller leaves it: a socket without a listener.
        drop(UnixListener::bind(&path).unwrap());
        assert!(path.exists());
        let again = Server::open(&cell, shared()).unwrap();
        assert!(ask(again.path(), b"{\"command\":\"status\"}\n").is_some());
    }

    #[test]
    fn a_folder_of_others_is_refused() {
        let folder = std::env::temp_dir().join(format!("ilc-ctl-open-{}", std::process::id()));
        fs::create_dir(&folder).unwrap();
        fs::set_permissions(&folder, Permissions::from_mode(0o755)).unwrap();
        let refused = folder::check(&folder).unwrap_err().to_string();
        assert!(refused.contains("mode 755") && refused.contains("no other user"), "{refused}");
        fs::set_permissions(&folder, Permissions::from_mode(0o700)).unwrap();
        assert!(folder::check(&folder).is_ok());
        fs::remove_dir(&folder).unwrap();
    }
}

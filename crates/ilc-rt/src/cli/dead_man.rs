//! Dead man's switch of a verb that moves axes by hand: the axes come to rest when input, output, terminal or parent
//! is gone.

use std::io::{IsTerminal, Read};
use std::os::fd::AsFd;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::process::parent_id;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Polling period while waiting for the first input.
const POLL: Duration = Duration::from_millis(10);

/// Kind of standard input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Input {
    /// A terminal.
    Terminal,
    /// A pipe or a socket, whose other end a program holds.
    Pipe,
    /// A file or a device such as `/dev/null`, which no one holds.
    Other,
}

/// Notes input as it arrives, and its end.
pub(super) struct DeadMan {
    began: Instant,
    parent: u32,
    /// Longest time without input; `None`: input is not needed.
    hold: Option<Duration>,
    watch: Arc<Watch>,
    is_watched: bool,
}

#[derive(Default)]
struct Watch {
    /// Time of the last input in milliseconds since the start, plus 1; 0 before the first.
    last_ms: AtomicU64,
    closed: AtomicBool,
}

impl DeadMan {
    /// Watches standard input if it is a pipe, or if input is needed within `hold`.
    ///
    /// # Errors
    /// One line, if input is needed and standard input cannot give any.
    pub(super) fn new(hold: Option<Duration>) -> Result<Self, String> {
        let kind = kind_of_input();
        if hold.is_some() && kind == Input::Other {
            return Err(
                "--speed moves only while input arrives: allowed with a terminal or a pipe at \
                        standard input"
                    .to_owned(),
            );
        }
        let man = Self {
            began: Instant::now(),
            parent: parent_id(),
            hold,
            watch: Arc::new(Watch::default()),
            // A terminal that is not needed is left alone: its end arrives as SIGHUP.
            is_watched: kind == Input::Pipe || hold.is_some(),
        };
        if man.is_watched {
            let (watch, began) = (Arc::clone(&man.watch), man.began);
            std::thread::Builder::new()
                .name("dead-man".to_owned())
                .spawn(move || read(&watch, began))
                .map_err(|error| format!("standard input cannot be watched: {error}"))?;
        }
        Ok(man)
    }

    /// Waits for the first input, if input is needed; returns false if a signal or the end came first.
    pub(super) fn wait_for_first(&self, is_over: impl Fn() -> bool) -> bool {
        if self.hold.is_none() {
            return true;
        }
        while self.watch.last_ms.load(Ordering::Relaxed) == 0 {
            if is_over() || self.watch.closed.load(Ordering::Relaxed) || parent_id() != self.parent
            {
                return false;
            }
            std::thread::sleep(POLL);
        }
        true
    }

    /// Returns the reason to come to rest, if there is one.
    pub(super) fn released(&self) -> Option<String> {
        if parent_id() != self.parent {
            return Some("the program that started this one is gone".to_owned());
        }
        if self.is_watched && self.watch.closed.load(Ordering::Relaxed) {
            return Some("standard input was closed".to_owned());
        }
        let hold = self.hold?;
        let last = Duration::from_millis(self.watch.last_ms.load(Ordering::Relaxed));
        (self.began.elapsed() > last + hold)
            .then(|| format!("released: no input for {} s", hold.as_secs_f64()))
    }
}

fn read(watch: &Watch, began: Instant) {
    let mut said = [0; 256];
    let mut input = std::io::stdin().lock();
    loop {
        match input.read(&mut said) {
            Ok(0) => break,
            Ok(_) => {
                let now = u64::try_from(began.elapsed().as_millis()).unwrap_or(u64::MAX - 1);
                watch.last_ms.store(now + 1, Ordering::Relaxed);
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
            Err(_) => break,
        }
    }
    watch.closed.store(true, Ordering::Relaxed);
}

fn kind_of_input() -> Input {
    let input = std::io::stdin();
    if input.is_terminal() {
        return Input::Terminal;
    }
    let kind = input
        .as_fd()
        .try_clone_to_owned()
        .and_then(|descriptor| std::fs::File::from(descriptor).metadata())
        .map(|found| found.file_type());
    match kind {
        Ok(kind) if kind.is_fifo() || kind.is_socket() => Input::Pipe,
        _ => Input::Other,
    }
}

//! A load of this computer: one thread a processor that computes, copies memory and writes a file.

use std::fs::File;
use std::io::{Seek as _, Write as _};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, available_parallelism, spawn};

/// Memory that each thread copies: more than its share of any cache.
const N_BYTES: usize = 16 << 20;
/// Size at which a file is written from its start again.
const FILE_MAX: u64 = 64 << 20;

/// The load, until it is dropped.
pub(super) struct Load {
    ends: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Load {
    pub(super) fn start() -> Self {
        let ends = Arc::new(AtomicBool::new(false));
        let n_threads = available_parallelism().map_or(1, usize::from);
        let threads = (0..n_threads).map(|number| {
            let ends = Arc::clone(&ends);
            spawn(move || work(number, &ends))
        });
        Self { threads: threads.collect(), ends }
    }
}

impl Drop for Load {
    fn drop(&mut self) {
        self.ends.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// Returns a file without a name: it is gone with the program, however that ends.
fn nameless_file(number: usize) -> std::io::Result<File> {
    let name = format!("ilc-rt-load-{}-{number}", std::process::id());
    let path = std::env::temp_dir().join(name);
    let file = File::create_new(&path)?;
    std::fs::remove_file(path)?;
    Ok(file)
}

fn work(number: usize, ends: &AtomicBool) {
    let (from, mut to) = (vec![1_u8; N_BYTES], vec![0_u8; N_BYTES]);
    // Without a place to write, the rest is load enough.
    let mut file = nameless_file(number).ok();
    let mut written = 0;
    while !ends.load(Ordering::Relaxed) {
        to.copy_from_slice(&from);
        std::hint::black_box(&mut to);
        if let Some(open) = &mut file {
            let is_full = written >= FILE_MAX;
            if is_full && open.rewind().is_err() || open.write_all(&to[..1 << 20]).is_err() {
                file = None;
            }
            written = if is_full { 0 } else { written + (1 << 20) };
        }
    }
}

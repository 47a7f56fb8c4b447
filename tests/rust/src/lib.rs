//! Shared set-up of the integration tests: the example cells, whole campaigns on simulated drives,
//! and a servo cycle ticked by hand.
//!
//! [`campaign`] runs a campaign as a user does; [`far_side`] puts the simulated machine on a bus in
//! a thread of its own; [`rig`] is the loop alone, on a bus that records every command and lets a test
//! break things in the middle of a run; [`faulty`] is a bus that loses, delays and spoils frames by seed;
//! [`catalogue`] builds every law; [`counting`] is an allocator that counts;
//! [`nonblocking`] marks what a sanitizer watches; [`source`] reads the project's own source.

#![expect(clippy::expect_used, reason = "a test fails where its set-up does")]

pub mod campaign;
pub mod catalogue;
pub mod counting;
pub mod derived;
pub mod far_side;
pub mod faulty;
pub mod nonblocking;
pub mod rig;
pub mod source;

use std::io::ErrorKind;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use ilc_rt::config::Cell;

pub use derived::{hold_derived, hold_derived_file};

/// An example of every mode, with its default input.
pub const MODES: [&str; 3] = ["01_gantry.toml", "02_parallel.toml", "10_cst.toml"];

/// An example of every mode with each of its inputs.
pub const INPUTS: [&str; 6] = [
    "01_gantry.toml",
    "02_parallel.toml",
    "10_cst.toml",
    "11_csp_torque.toml",
    "12_csp_velocity.toml",
    "13_csv_torque.toml",
];

/// Returns the root of this checkout.
///
/// Asked of cargo at run time: one target folder may serve several checkouts, and a test built in
/// another one must still look at its own.
pub fn root() -> PathBuf {
    let compiled = env!("CARGO_MANIFEST_DIR").into();
    PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or(compiled)).join("../..")
}

/// Returns the path of an example, e.g. `01_gantry.toml`.
pub fn example_path(name: &str) -> PathBuf {
    root().join("examples").join(name)
}

/// Returns the text of an example.
///
/// # Panics
/// If there is no such example.
pub fn example_text(name: &str) -> String {
    std::fs::read_to_string(example_path(name)).expect("the example is there")
}

/// Returns a validated example.
///
/// # Panics
/// If the example is invalid.
pub fn example(name: &str) -> Cell {
    Cell::load(&example_path(name)).expect("the example is valid")
}

/// Returns the gantry with a program of two short moves: a run takes 0.7 s.
///
/// # Panics
/// If the example is invalid.
pub fn short(name: &str) -> Cell {
    let text = example_text(name);
    let program = text.find("[[program.segment]]").expect("a program");
    let learning = text.find("[learning]").expect("a learning section");
    let segments =
        "[[program.segment]]\nto_m = [0.08, 0.02]\n[[program.segment]]\nto_m = [0.06, 0.04]\n\n";
    let text = format!("{}{segments}{}", &text[..program], &text[learning..]);
    Cell::parse(&text, name).expect("the shortened example is valid")
}

/// Lets a cell that runs by the clock wait for this computer: a stall of some seconds is no stop.
pub fn patient(mut cell: Cell) -> Cell {
    cell.safety.overrun_cycles_max = 5000;
    cell
}

/// A temporary folder, deleted when dropped.
#[derive(Debug)]
pub struct Scratch(PathBuf);

impl Scratch {
    /// Creates an empty folder.
    ///
    /// # Panics
    /// If it cannot be created.
    pub fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let name = format!("ilc-test-{}-{number}", std::process::id());
            let path = std::env::temp_dir().join(name);
            match std::fs::create_dir(&path) {
                Ok(()) => return Self(path),
                // Emulated machines share the folder, but not the numbers of their processes.
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => panic!("{}: {error}", path.display()),
            }
        }
    }

    /// Returns the path of a file in it.
    pub fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Default for Scratch {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

//! The gantry of `01_gantry.toml`, ten runs inside this process: the Rust version of
//! `01_gantry.py`.
//!
//! `cargo run --release -p ilc-tests --example 01_gantry`

#![expect(clippy::print_stdout, reason = "an example tells what it did")]

use std::error::Error;
use std::path::Path;

use ilc_rt::campaign::{self, Options};
use ilc_rt::cli::parse;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::transport::loopback::InProcess;
use ilc_rt::record::Event;
use ilc_sim::{ClockMode, Machine};

fn main() -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let cell = Cell::load(&root.join("examples/01_gantry.toml"))?;
    // The drives run in this thread, one cycle per SYNC: no clock, the same numbers every time.
    let drives = Machine::from_cell(&cell, ClockMode::LockStep)?;
    let bus = Box::new(InProcess::new(drives, 1024));
    // The defaults of the command line.
    let options: Options =
        parse(&["--lockstep", "--library", ":memory:", "--no-telemetry"].map(str::to_owned))?;
    println!("run  max tracking um  max contour um");
    let outcome = campaign::run(&cell, &options, bus, None, &mut |event| {
        if let Event::Iteration { index, figures, .. } = event {
            let tracking = figures.tracking_inf_m * 1e6;
            // Absent if only one axis moves.
            let contour = figures.contour_inf_m.unwrap_or_default() * 1e6;
            println!("{index:>3}  {tracking:>15.1}  {contour:>14.1}");
        }
    })?;
    println!("{}", outcome.reason);
    Ok(())
}

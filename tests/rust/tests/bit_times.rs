//! A bus in memory with a bit rate: a cell that `check` accepts runs on it, and one that it refuses does not.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::campaign;
use ilc_rt::config::{Cell, Measure};
use ilc_rt::design::Plan;
use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::transport;
use ilc_rt::record::EndStatus;
use ilc_tests::campaign::{Kept, in_process, machine, options, run_on};
use ilc_tests::{Scratch, short};

const RUNS: u32 = 2;

/// The gantry at 1 kHz without its tool, planned for a bus.
fn cell(address: &str) -> Cell {
    let mut cell = short("01_gantry.toml");
    cell.cell.cycle_us = 1000;
    cell.tcp_encoder = None;
    cell.learning.measure = Measure::Encoder;
    cell.bus.load_max = 1.0;
    address.clone_into(&mut cell.bus.address);
    cell
}

/// Runs a cell that is planned for a bus without a bit rate on one that has it.
fn run_in_time(cell: &Cell, address: &str) -> Kept {
    let mut timed = cell.clone();
    address.clone_into(&mut timed.bus.address);
    let drives = machine(&timed);
    let bus: Box<dyn Bus> = transport::in_process(address, drives, cell.cell.cycle_us, 256);
    run_on(cell, bus, RUNS, None)
}

#[test]
fn what_check_accepts_runs_and_what_it_refuses_does_not() {
    let plain = cell("loopback:");
    // The full process data: 1000 us, with the reserve of a frame, at 1 Mbit/s.
    let alone = run_on(&plain, in_process(&plain), RUNS, None);
    let mut outcomes = Vec::new();
    for (bitrate, format) in [
        (1_000_000, ""),
        (800_000, ""),
        (500_000, ""),
        (250_000, ""),
        (1_000_000, "&fd=1&data_bitrate=5000000"),
        (250_000, "&fd=1"),
    ] {
        let address = format!("loopback:?bitrate={bitrate}{format}");
        let mut planned = cell(&address);
        let mut run = plain.clone();
        if !format.is_empty() {
            run.bus.address = "loopback:?fd=1".to_owned();
        }
        // The same process data for both: on a classical bus without a bit rate it would be more.
        for cell in [&mut planned, &mut run] {
            for axis in &mut cell.axes {
                let full = ["0x6040", "0x607A", "0x60B2"];
                axis.drive.pdo.command =
                    Some(full.iter().map(|name| name.parse().unwrap()).collect());
            }
        }
        let is_accepted = Plan::new(&planned, None, true).is_ok();
        let kept = run_in_time(&run, &address);
        let is_run = kept.outcome.status == EndStatus::Completed;
        assert_eq!(is_run, is_accepted, "{address}: {}", kept.outcome.reason);
        if is_run {
            assert_eq!(kept.digests, alone.digests, "{address}");
        } else {
            assert!(kept.outcome.reason.contains("silent"), "{address}: {}", kept.outcome.reason);
            // Without a clock, what fails fails at the same place again.
            let again = run_in_time(&run, &address);
            assert_eq!(again.outcome.reason, kept.outcome.reason);
        }
        outcomes.push(is_run);
    }
    assert_eq!(outcomes, [true, true, false, false, true, false]);
}

#[test]
fn a_cell_whose_address_has_a_bit_rate_is_checked_for_it() {
    let cell = cell("loopback:?bitrate=250000");
    let scratch = Scratch::new();
    let options = options(scratch.file("library.db"), 1);
    let error = campaign::run(&cell, &options, in_process(&cell), None, &mut |_| {}).err().unwrap();
    assert!(error.to_string().contains("us at worst"), "{error}");
}

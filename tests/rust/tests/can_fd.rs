//! A cell on a bus with CAN FD: more in one frame, and the same records.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::net::UdpSocket;

use ilc_rt::campaign::{self, drive_setup};
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::transport;
use ilc_rt::record::EndStatus;
use ilc_tests::campaign::{in_process, machine, options, run, run_on};
use ilc_tests::far_side::FarSide;
use ilc_tests::{Scratch, example_text, short};

const RUNS: u32 = 2;

fn lengths(cell: &Cell) -> Vec<usize> {
    drive_setup(cell, &cell.axes[0], true).unwrap().map.frame_bytes().collect()
}

#[test]
fn a_drive_answers_in_one_frame_and_the_records_are_the_same() {
    let classical = run(&short("01_gantry.toml"), RUNS, None);
    let mut cell = short("01_gantry.toml");
    assert_eq!(lengths(&cell), [8, 8, 8]);
    cell.bus.address = "loopback:?fd=1".to_owned();
    assert_eq!(lengths(&cell), [8, 16]);
    let kept = run_on(&cell, in_process(&cell), RUNS, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    assert_eq!(kept.digests, classical.digests);

    let holder = UdpSocket::bind("127.0.0.1:0").unwrap();
    let port = holder.local_addr().unwrap().port();
    cell.bus.address = format!("udp:239.74.163.96:{port}?fd=1");
    cell.safety.answer_timeout_s = 20.0;
    let open = || transport::open(&cell.bus.address).unwrap();
    let far_side = FarSide::serve(open(), machine(&cell));
    let kept = run_on(&cell, open(), RUNS, None);
    drop(far_side);
    assert_eq!(kept.digests, classical.digests, "{}", kept.outcome.reason);
}

/// The gantry with process data of its first drive, on a bus.
fn stated(address: &str) -> Result<Cell, String> {
    let text =
        example_text("01_gantry.toml").replace("udp:239.74.163.2\"", &format!("{address}\""));
    let pdo = "[axis.drive.pdo]\nstatus = [\"0x6041\", \"0x6064\", \"0x606C\", \"0x60F4\"]\n\n[axis.simulation]";
    Cell::parse(&text.replacen("[axis.simulation]", pdo, 1), "cell.toml").map_err(|e| e.to_string())
}

#[test]
fn stated_process_data_may_fill_a_frame_of_the_bus_and_no_more() {
    let cell = stated("loopback:?fd=1").unwrap();
    // 14 bytes travel in a frame of 16.
    assert_eq!(lengths(&cell), [6, 16]);
    let kept = run_on(&cell, in_process(&cell), 1, None);
    assert_eq!(kept.outcome.status, EndStatus::Completed, "{}", kept.outcome.reason);
    let line = stated("loopback:").unwrap_err();
    assert!(line.contains("a PDO of 14 bytes is not allowed: at most 8 fit"), "{line}");
}

#[test]
fn drives_without_can_fd_refuse_what_does_not_fit() {
    let mut cell = short("01_gantry.toml");
    cell.bus.address = "loopback:?fd=1".to_owned();
    let mut drives = cell.clone();
    drives.bus.address = "loopback:".to_owned();
    let scratch = Scratch::new();
    let options = options(scratch.file("library.db"), 1);
    let outcome = campaign::run(&cell, &options, in_process(&drives), None, &mut |_| {});
    let line = outcome.err().unwrap().to_string();
    assert!(line.contains("0x06040042"), "{line}");
}

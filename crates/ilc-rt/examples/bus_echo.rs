//! Answers every frame on a bus with the same payload and the next identifier, until 0x7FF comes.
//!
//! `cargo run --release --example bus_echo -- udp:239.74.163.2` is something to talk to when another
//! program's side of a bus is to be tried out.

use std::io::Write;
use std::process::ExitCode;
use std::time::Duration;

use ilc_rt::fieldbus::{Bus, Frame, transport};

/// The identifier that ends the program.
const STOP: u16 = 0x7FF;

fn main() -> ExitCode {
    let Some(address) = std::env::args().nth(1) else {
        return fail(&"usage: bus_echo ADDRESS, such as udp:239.74.163.2");
    };
    match transport::open(&address) {
        Err(error) => fail(&error),
        Ok(mut bus) => {
            // The parent process waits for this line: from here on no frame is missed.
            let _ = writeln!(std::io::stdout(), "ready on {address}");
            match echo(&mut *bus) {
                Err(error) => fail(&error),
                Ok(()) => ExitCode::SUCCESS,
            }
        }
    }
}

fn echo(bus: &mut dyn Bus) -> Result<(), ilc_rt::fieldbus::BusError> {
    loop {
        let Some(frame) = bus.recv(Duration::from_secs(1))? else { continue };
        if frame.id() == STOP {
            return Ok(());
        }
        if let Some(answer) = Frame::fd(frame.id() + 1, frame.payload()) {
            bus.send(&answer)?;
        }
    }
}

fn fail(why: &dyn std::fmt::Display) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "{why}");
    ExitCode::from(2)
}

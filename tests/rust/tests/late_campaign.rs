//! Events, faults and flight records of campaigns in real time with late cycles.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Mutex;

use ilc_rt::campaign;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_rt::record::{EndStatus, Event, FaultKind, FlightRecord, LateCause, LateCycle};
use ilc_tests::campaign::options;
use ilc_tests::rig::{Tap, node};
use ilc_tests::{Scratch, patient, short};

/// A bus to the simulated machine on which a node falls silent after some SYNCs.
struct Muting {
    tap: Tap,
    n_syncs: usize,
}

impl Bus for Muting {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if self.tap.line().n_syncs() == self.n_syncs {
            self.tap.line().meddle(|machine, _| assert!(machine.mute(node(2))));
        }
        self.tap.send(frame)
    }

    fn recv(&mut self, timeout: std::time::Duration) -> Result<Option<Frame>, BusError> {
        self.tap.recv(timeout)
    }
}

/// Runs a campaign in real time, and returns its events and the record beside its library.
fn campaign(cell: &Cell, bus: Box<dyn Bus>) -> (EndStatus, Vec<Event>, FlightRecord) {
    let scratch = Scratch::new();
    let library = scratch.file("library.db");
    let mut options = options(library.clone(), 1);
    options.session.lockstep = false;
    let events = Mutex::new(Vec::new());
    let outcome = campaign::run(cell, &options, bus, None, &mut |event| {
        events.lock().unwrap().push(event.clone());
    });
    let path = FlightRecord::path(&library, &cell.cell.name);
    let record = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    (outcome.unwrap().status, events.into_inner().unwrap(), record)
}

#[test]
fn a_fault_of_a_campaign_names_the_node_that_was_silent() {
    let mut cell = patient(short("01_gantry.toml"));
    cell.safety.silent_cycles_max = 100;
    let muting = Muting { tap: Tap::new(&cell), n_syncs: 300 };
    let (status, events, record) = campaign(&cell, Box::new(muting));
    assert_eq!(status, EndStatus::Fault);
    let fault = events.iter().find_map(|event| match event {
        Event::Fault { fault, .. } => Some(fault),
        _ => None,
    });
    let fault = fault.unwrap();
    assert_eq!(fault.kind, FaultKind::SilentDrive);
    let is_y = |late: &LateCycle| {
        (late.cause, late.axis.as_deref(), late.node) == (LateCause::Receive, Some("y"), Some(2))
    };
    assert!(fault.late.as_ref().is_some_and(is_y), "{:?}", fault.late);
    let stop = record.fault.unwrap();
    assert!(stop.late.as_ref().is_some_and(is_y) && stop.reason.contains('y'));
    assert!(stop.before.len() > 30 && stop.before.is_sorted_by_key(|row| row.tick));
    assert_eq!(record.answers.iter().map(|times| times.node).collect::<Vec<_>>(), [1, 2, 10]);
    assert!(record.answers[0].count > record.answers[1].count);
}

#[test]
fn a_campaign_tells_each_late_cycle_once_and_keeps_the_worst() {
    let mut cell = patient(short("01_gantry.toml"));
    // Every cycle of it is late: none is done in a twentieth of nothing.
    cell.realtime.late_share = 0.05;
    cell.safety.silent_cycles_max = 1000;
    cell.cell.cycle_us = 500;
    let busy = Busy { tap: Tap::new(&cell) };
    let (_, events, record) = campaign(&cell, Box::new(busy));
    let latency = events.iter().find(|event| matches!(event, Event::Latency { .. }));
    let Some(Event::Latency { late, worst, file, wake_late_us, .. }) = latency else {
        panic!("no timing");
    };
    assert!(late.all() > wake_late_us.count / 2, "{late:?} of {}", wake_late_us.count);
    assert_eq!(
        (record.late, record.worst.first().map(|case| &case.cycle)),
        (*late, worst.as_ref())
    );
    assert!(record.worst.len() == 16 && file.is_some());
    let told = events.iter().filter_map(|event| match event {
        Event::Late { count, .. } => Some(*count),
        _ => None,
    });
    let told: Vec<u64> = told.collect();
    assert!(!told.is_empty() && told.iter().sum::<u64>() <= late.all());
    assert!((told.len() as u64) < late.all() / 2, "{} of {}", told.len(), late.all());
}

/// A bus whose SYNC takes a while.
struct Busy {
    tap: Tap,
}

impl Bus for Busy {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        if frame.id() == 0x80 {
            let until = std::time::Instant::now() + std::time::Duration::from_micros(60);
            while std::time::Instant::now() < until {}
        }
        self.tap.send(frame)
    }

    fn recv(&mut self, timeout: std::time::Duration) -> Result<Option<Frame>, BusError> {
        self.tap.recv(timeout)
    }
}

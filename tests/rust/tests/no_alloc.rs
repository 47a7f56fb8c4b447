//! A tick allocates nothing and frees nothing, whatever happens in it.
//!
//! Every tick of whole campaigns is counted, phase by phase: with the simulated machine inside, which
//! allocates nothing either once it is set up.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]
#![expect(unsafe_code, reason = "a global allocator is an unsafe trait")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell as Counter;
use std::collections::BTreeSet;

use ilc_rt::config::Cell;
use ilc_rt::fieldbus::canopen::NmtCommand;
use ilc_rt::fieldbus::transport::Responder;
use ilc_rt::servo::{PhaseName, StopReason, TickStatus};
use ilc_tests::rig::{Rig, node, write_object};
use ilc_tests::short;

struct Counting;

thread_local! {
    // Per thread, because the test harness allocates on its own threads meanwhile.
    static COUNTING: Counter<bool> = const { Counter::new(false) };
    static ALLOCATIONS: Counter<u64> = const { Counter::new(0) };
    static DEALLOCATIONS: Counter<u64> = const { Counter::new(0) };
}

fn count(what: &'static std::thread::LocalKey<Counter<u64>>) {
    if COUNTING.get() {
        what.set(what.get() + 1);
    }
}

// SAFETY: every call is handed to the system allocator unchanged; counting touches no memory but
// thread-local cells that need no set-up.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(&ALLOCATIONS);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(&DEALLOCATIONS);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(&ALLOCATIONS);
        count(&DEALLOCATIONS);
        // SAFETY: the caller's contract is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const CELLS: [&str; 2] = ["01_gantry.toml", "02_parallel.toml"];
const MIDDLE: u32 = 150;

/// A rig whose ticks are counted.
struct Watched {
    rig: Rig,
    phases: BTreeSet<&'static str>,
    n_ticks: u32,
}

impl Watched {
    fn new(cell: &Cell, runs: u32) -> Self {
        Self { rig: Rig::new(cell, runs), phases: BTreeSet::new(), n_ticks: 0 }
    }

    fn tick(&mut self, missed: u32) -> TickStatus {
        let n_syncs = self.rig.tap.line().n_syncs();
        ALLOCATIONS.set(0);
        DEALLOCATIONS.set(0);
        COUNTING.set(true);
        let status = self.rig.cycle.tick(missed);
        COUNTING.set(false);
        let counted = (ALLOCATIONS.get(), DEALLOCATIONS.get());
        self.rig.read_mail(n_syncs);
        let phase = name(self.rig.phase.0);
        assert_eq!(counted, (0, 0), "allocations and deallocations in {phase}");
        self.phases.insert(phase);
        self.n_ticks += 1;
        status
    }

    fn into_run(&mut self, run: u32, sample: u32) {
        while self.rig.samples.last().is_none_or(|last| last.at != Some((run, sample))) {
            assert_eq!(self.tick(0), TickStatus::Running, "{:?}", self.rig.reason);
        }
    }

    fn to_end(&mut self) {
        while self.tick(0) == TickStatus::Running {
            assert!(self.n_ticks < 100_000, "never stopped");
        }
    }
}

fn name(phase: PhaseName) -> &'static str {
    match phase {
        PhaseName::Enabling => "enabling",
        PhaseName::Returning => "returning",
        PhaseName::Settling => "settling",
        PhaseName::Running => "running",
        PhaseName::Stopping => "stopping",
        PhaseName::Disabling => "disabling",
        PhaseName::Stopped => "stopped",
    }
}

/// A table that is worth swapping in.
fn table(n_samples: usize) -> Box<[f64]> {
    (0..2 * n_samples).map(|i| 1e-4 * (i as f64 * 0.01).sin()).collect()
}

#[test]
fn the_counter_counts() {
    COUNTING.set(true);
    drop(std::hint::black_box(Box::new(1)));
    COUNTING.set(false);
    assert_eq!((ALLOCATIONS.get(), DEALLOCATIONS.get()), (1, 1));
}

#[test]
fn whole_campaigns_with_swapped_tables() {
    for name in CELLS {
        let mut watched = Watched::new(&short(name), 4);
        for number in 1..4 {
            watched.into_run(number - 1, MIDDLE);
            // Two tables at once: the older one is skipped, and both it and the last go back.
            for newer in [0, 1] {
                let size = table(watched.rig.n_samples);
                watched.rig.mail.send_table(2 * number + newer, size).unwrap();
            }
        }
        watched.to_end();
        assert_eq!(watched.rig.started, [(0, 0), (1, 3), (2, 5), (3, 7)], "{name}");
        assert_eq!(watched.rig.reason, None);
        let expected = ["disabling", "enabling", "returning", "running", "settling", "stopped"];
        assert_eq!(watched.phases, BTreeSet::from(expected));
        println!("{name}: {} ticks", watched.n_ticks);
    }
}

#[test]
fn stops_of_every_kind() {
    type Break = fn(&mut Watched);
    let breaks: [(&str, Break); 7] = [
        ("asked", |watched| watched.rig.ask_to_stop(15)),
        ("silent drive", |watched| {
            watched.rig.tap.line().meddle(|machine, _| assert!(machine.mute(node(1))));
        }),
        ("silent tool", |watched| {
            watched.rig.tap.line().meddle(|machine, _| assert!(machine.mute(node(10))));
        }),
        ("drive fault", |watched| {
            // A window of 10 um: the drive faults, with an emergency.
            watched.rig.tap.line().meddle(|machine, _| write_object(1, 0x6065, 1000)(machine));
        }),
        ("node restarts", |watched| {
            watched.rig.tap.line().meddle(|machine, reply| {
                machine.receive(&NmtCommand::ResetNode.frame(Some(node(2))), reply);
            });
        }),
        ("overrun", |watched| {
            watched.tick(1_000_000);
        }),
        ("no number", |watched| {
            let mut bad = table(watched.rig.n_samples);
            bad[100] = f64::NAN;
            watched.rig.mail.send_table(1, bad).unwrap();
        }),
    ];
    for name in CELLS {
        for (what, break_it) in breaks {
            let mut watched = Watched::new(&short(name), 2);
            watched.into_run(0, MIDDLE);
            break_it(&mut watched);
            watched.to_end();
            // A velocity-commanded drive has no following error of its own.
            let has_reason = !(what == "drive fault" && name == CELLS[1]);
            assert_eq!(watched.rig.reason.is_some(), has_reason, "{name} {what}");
            assert!(watched.phases.contains("stopping") == has_reason, "{name} {what}");
            if what == "drive fault" && has_reason {
                assert!(matches!(watched.rig.reason, Some(StopReason::DriveFault { .. })));
            }
        }
    }
}

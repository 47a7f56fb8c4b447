//! A tick neither allocates nor frees memory, whatever happens in it.
//!
//! Every tick of whole campaigns is counted, phase by phase, including the simulated machine, which
//! does not allocate after set-up either, the flight recorder, to which every cycle is late, and the taps of a
//! recording, whose rings are too small for it.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]

use std::collections::BTreeSet;
use std::sync::Arc;

use ilc_rt::config::{Cell, Direction, Input, InputUse, Level};
use ilc_rt::fieldbus::canopen::NmtCommand;
use ilc_rt::fieldbus::transport::Responder;
use ilc_rt::rt::{Clock, MonotonicClock, Nanos};
use ilc_rt::servo::{PhaseName, StopReason, TickStatus};
use ilc_tests::counting::{Counting, allocations, deallocations, live_bytes};
use ilc_tests::nonblocking::nonblocking;
use ilc_tests::rig::{Rig, node, write_object};
use ilc_tests::short;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const CELLS: [&str; 2] = ["01_gantry.toml", "02_parallel.toml"];
const MIDDLE: u32 = 150;

/// Share of a cycle that none can keep.
const NO_TIME: f64 = 1e-9;

/// A rig with counted ticks.
struct Watched {
    rig: Rig,
    clock: Arc<MonotonicClock>,
    phases: BTreeSet<&'static str>,
    n_ticks: u32,
}

impl Watched {
    fn new(cell: &Cell, runs: u32) -> Self {
        Self::of(Rig::new(cell, runs))
    }

    fn of(rig: Rig) -> Self {
        let clock = Arc::new(MonotonicClock::new(Nanos(0)));
        let rig = rig.with_recorder(Arc::clone(&clock) as Arc<dyn Clock>, NO_TIME).tapped(&clock);
        Self { rig, clock, phases: BTreeSet::new(), n_ticks: 0 }
    }

    fn tick(&mut self, missed: u32) -> TickStatus {
        let n_syncs = self.rig.tap.line().n_syncs();
        let before = (allocations(), deallocations());
        let due = self.clock.now();
        let cycle = &mut self.rig.cycle;
        let (status, recorded) = nonblocking(|| {
            cycle.begin(due, due, missed);
            (cycle.tick(missed), cycle.end())
        });
        let after = (allocations(), deallocations());
        assert!(recorded.is_some_and(|stamps| stamps.late && stamps.ended > due));
        self.rig.read_mail(n_syncs);
        assert!(!self.rig.recorded.is_empty());
        self.rig.recorded.clear();
        let phase = name(self.rig.phase.0);
        assert_eq!(after, before, "allocations and deallocations in {phase}");
        self.phases.insert(phase);
        self.n_ticks += 1;
        status
    }

    fn tick_into_run(&mut self, run: u32, sample: u32) {
        while self.rig.samples.last().is_none_or(|last| last.at != Some((run, sample))) {
            assert_eq!(self.tick(0), TickStatus::Running, "{:?}", self.rig.reason);
        }
    }

    fn tick_to_end(&mut self) {
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
        PhaseName::Waiting => "waiting",
        PhaseName::Running => "running",
        PhaseName::Paused => "paused",
        PhaseName::Stopping => "stopping",
        PhaseName::Disabling => "disabling",
        PhaseName::Stopped => "stopped",
    }
}

/// A valid table to swap in.
fn table(n_samples: usize) -> Box<[f64]> {
    (0..2 * n_samples).map(|i| 1e-4 * (i as f64 * 0.01).sin()).collect()
}

#[test]
fn the_counter_counts() {
    let before = (allocations(), deallocations());
    drop(std::hint::black_box(Box::new(1)));
    assert_eq!((allocations(), deallocations()), (before.0 + 1, before.1 + 1));
}

#[test]
fn whole_campaigns_with_swapped_tables() {
    for name in CELLS {
        let mut watched = Watched::new(&short(name), 4);
        for number in 1..4 {
            watched.tick_into_run(number - 1, MIDDLE);
            // Two tables at once: the older one is skipped, and both it and the last go back.
            for newer in [0, 1] {
                let size = table(watched.rig.n_samples);
                watched.rig.mail.send_table(2 * number + newer, size).unwrap();
            }
        }
        watched.tick_to_end();
        assert_eq!(watched.rig.started, [(0, 0), (1, 3), (2, 5), (3, 7)], "{name}");
        assert_eq!(watched.rig.reason, None);
        // The rings of the taps are not read: they fill up, and count.
        assert!(watched.rig.n_lost() > 1000, "{}", watched.rig.n_lost());
        let expected = ["disabling", "enabling", "returning", "running", "settling", "stopped"];
        assert_eq!(watched.phases, BTreeSet::from(expected));
        println!("{name}: {} ticks", watched.n_ticks);
    }
}

/// The sanitizer of `make rtsan` stops a program that allocates where it must not.
#[cfg(rtsan)]
#[test]
fn the_sanitizer_finds_an_allocation() {
    let program = std::env::current_exe().unwrap();
    let planted = std::process::Command::new(program)
        .args(["--exact", "a_planted_allocation", "--ignored"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&planted.stderr);
    assert!(!planted.status.success() && said.contains("RealtimeSanitizer"), "{said}");
    assert!(said.contains("malloc"), "{said}");
}

#[cfg(rtsan)]
#[test]
#[ignore = "it is stopped by the sanitizer"]
fn a_planted_allocation() {
    nonblocking(|| drop(std::hint::black_box(Box::new(1))));
}

/// Five hours and a half of the gantry. `make soak` makes them.
#[test]
#[ignore = "takes a minute"]
fn ten_million_ticks_without_a_byte_of_growth() {
    const ROUND: u32 = 100_000;
    let mut watched = Watched::new(&short(CELLS[0]), u32::MAX);
    let mut first = None;
    for _ in 0..100 {
        for _ in 0..ROUND {
            assert_eq!(watched.tick(0), TickStatus::Running, "{:?}", watched.rig.reason);
        }
        watched.rig.tap.line().forget();
        watched.rig.samples.clear();
        watched.rig.started.clear();
        watched.rig.ended.clear();
        let bytes = live_bytes();
        assert_eq!(bytes, *first.get_or_insert(bytes), "after {} ticks", watched.n_ticks);
    }
    println!("{} ticks, {:?} bytes", watched.n_ticks, first);
}

#[test]
fn inputs_presses_and_an_open_guard() {
    for name in CELLS {
        let mut cell = short(name);
        for (name, bit, purpose) in [
            ("door", 16, InputUse::Guard),
            ("go", 17, InputUse::Start),
            ("end", 20, InputUse::Limit),
        ] {
            cell.inputs.push(Input {
                name: name.to_owned(),
                axis: "x".to_owned(),
                bit,
                active: Level::High,
                purpose,
                direction: (purpose == InputUse::Limit).then_some(Direction::Positive),
                debounce_cycles: 5,
            });
        }
        cell.axes[0].simulation.digital_inputs = 1 << 16;
        let rig = Rig::waiting(&cell, 1);
        let mut watched = Watched::of(rig);
        while watched.rig.phase.0 != PhaseName::Waiting {
            watched.tick(0);
        }
        let set = |watched: &Watched, inputs: u32| {
            watched
                .rig
                .tap
                .line()
                .meddle(|machine, _| assert!(machine.set_inputs(node(1), inputs)));
        };
        set(&watched, 0b11 << 16);
        watched.tick_into_run(0, MIDDLE);
        set(&watched, 0b10 << 16);
        watched.tick_to_end();
        assert_eq!(watched.rig.reason, Some(StopReason::GuardOpen { input: 0 }), "{name}");
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
            // A window of 10 um: following error, with an emergency.
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
            watched.tick_into_run(0, MIDDLE);
            break_it(&mut watched);
            watched.tick_to_end();
            // A velocity-commanded drive (CSV) has no following error of its own.
            let has_reason = !(what == "drive fault" && name == CELLS[1]);
            assert_eq!(watched.rig.reason.is_some(), has_reason, "{name} {what}");
            assert!(watched.phases.contains("stopping") == has_reason, "{name} {what}");
            if what == "drive fault" && has_reason {
                assert!(matches!(watched.rig.reason, Some(StopReason::DriveFault { .. })));
            }
        }
    }
}

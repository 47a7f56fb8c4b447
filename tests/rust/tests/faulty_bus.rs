//! Campaigns on a bus that loses, delays, duplicates, reorders and corrupts frames, or that a
//! foreign node uses.
//!
//! In every case the campaign completes with the figures of an undisturbed one, or stops with a
//! message; nothing panics or hangs, and no axis exceeds its limits.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::{Arc, Mutex};
use std::time::Duration;

use ilc_rt::campaign::{self, CampaignError, Outcome};
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::canopen::sync;
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_rt::record::{EndStatus, Figures};
use ilc_tests::campaign::options;
use ilc_tests::faulty::{Faults, FaultyBus, Way};
use ilc_tests::rig::Tap;
use ilc_tests::{Scratch, short};

const CELLS: [&str; 2] = ["01_gantry.toml", "02_parallel.toml"];
const RUNS: u32 = 4;
/// Largest overshoot of an axis whose set point is within limits.
const OVERSHOOT_M: f64 = 0.005;

/// Range of an axis's positions.
type Reach = Arc<Mutex<Vec<(f64, f64)>>>;

/// The machine of a cell, with the range of its axes' positions at every SYNC.
struct Watched {
    tap: Tap,
    reach: Reach,
}

impl Watched {
    fn new(cell: &Cell) -> (Self, Reach) {
        let reach = Reach::new(Mutex::new(vec![(f64::MAX, f64::MIN); cell.axes.len()]));
        (Self { tap: Tap::new(cell), reach: Arc::clone(&reach) }, reach)
    }
}

impl Bus for Watched {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let sent = self.tap.send(frame);
        if sync::is_sync(frame) {
            let line = self.tap.line();
            for (axis, (low, high)) in self.reach.lock().unwrap().iter_mut().enumerate() {
                let at_m = line.machine().plant().encoder_m(axis);
                (*low, *high) = (low.min(at_m), high.max(at_m));
            }
        }
        sent
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.tap.recv(timeout)
    }
}

/// A kind of fault with its name.
type Kind = (&'static str, Faults);

fn kinds(probability: f64) -> [Kind; 6] {
    let none = Faults::default();
    [
        ("loss", Faults { loss: probability, ..none }),
        ("delay", Faults { delay: probability, delay_syncs_max: 5, ..none }),
        ("duplication", Faults { duplication: probability, ..none }),
        ("reordering", Faults { reordering: probability, ..none }),
        ("corruption", Faults { corruption: probability, ..none }),
        ("foreign frames", Faults { foreign: (50.0 * probability).min(1.0), ..none }),
    ]
}

/// Runs a campaign and checks the invariants.
fn campaign(
    cell: &Cell,
    lockstep: bool,
    faults: Faults,
    way: Way,
    during: std::ops::Range<u32>,
    seed: u64,
) -> Result<Outcome, CampaignError> {
    let (watched, reach) = Watched::new(cell);
    let bus = FaultyBus::new(Box::new(watched), faults, way, during, seed);
    let scratch = Scratch::new();
    let mut options = options(scratch.file("library.db"), RUNS);
    options.session.lockstep = lockstep;
    options.session.simulated = !lockstep;
    let ended = campaign::run(cell, &options, Box::new(bus), None, &mut |_| {});
    let said = match &ended {
        Ok(outcome) => outcome.reason.clone(),
        Err(error) => error.to_string(),
    };
    assert!(!said.is_empty() && !said.contains('\n'), "{said:?}");
    for (axis, (low, high)) in cell.axes.iter().zip(reach.lock().unwrap().iter()) {
        let limits = &axis.limits;
        assert!(
            *high <= limits.position_max_m + OVERSHOOT_M
                && *low >= limits.position_min_m - OVERSHOOT_M,
            "axis {} was at {low} to {high} m: {said}",
            axis.name
        );
    }
    if let Ok(outcome) = &ended {
        for (run, figures) in &outcome.runs {
            assert!(figures.tracking_inf_m.is_finite(), "run {run}: {said}");
        }
        if outcome.status == EndStatus::Completed {
            assert_eq!(outcome.runs.len(), RUNS as usize, "{said}");
        }
    }
    ended
}

fn undisturbed(cell: &Cell) -> Outcome {
    campaign(cell, true, Faults::default(), Way::ToController, 0..0, 0).unwrap()
}

/// Returns the figures of the runs, except the learning time.
fn figures(outcome: &Outcome) -> Vec<(u32, Figures)> {
    let still =
        |(run, figures): &(u32, Figures)| (*run, Figures { update_ms: 0.0, ..figures.clone() });
    outcome.runs.iter().map(still).collect()
}

#[test]
fn without_faults_it_is_the_bus_behind_it() {
    let cell = short(CELLS[0]);
    let plain = ilc_tests::campaign::run(&cell, RUNS, None).outcome;
    let through = undisturbed(&cell);
    assert_eq!(through.status, EndStatus::Completed, "{}", through.reason);
    assert_eq!(figures(&through), figures(&plain));
}

#[test]
fn a_misfortune_can_be_had_again() {
    let cell = short(CELLS[0]);
    for (name, faults) in kinds(0.01) {
        let ends: Vec<_> = (0..2)
            .map(|_| campaign(&cell, true, faults, Way::ToController, 400..9_000, 7).unwrap())
            .collect();
        assert_eq!(ends[0].reason, ends[1].reason, "{name}");
        assert_eq!(figures(&ends[0]), figures(&ends[1]), "{name}");
    }
}

#[test]
fn lock_step_completes_or_stops_with_a_sentence() {
    for cell in CELLS {
        let cell = short(cell);
        let clean = undisturbed(&cell);
        let clean_m = clean.runs[0].1.tracking_inf_m;
        for (name, faults) in kinds(0.002).into_iter().chain(kinds(0.05)) {
            for way in [Way::ToController, Way::ToNodes] {
                for seed in 1..3 {
                    let what = format!("{name} {way:?} seed {seed}");
                    let end = campaign(&cell, true, faults, way, 100..u32::MAX, seed).unwrap();
                    if end.status == EndStatus::Completed {
                        for (run, figures) in &end.runs {
                            assert!(
                                figures.tracking_inf_m <= 1.2 * clean_m,
                                "{what}, run {run}: {} of {clean_m} m",
                                figures.tracking_inf_m
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn bring_up_comes_through_or_says_what_failed() {
    let cell = short(CELLS[0]);
    for (_, faults) in kinds(0.02).into_iter().chain(kinds(0.3)) {
        for way in [Way::ToController, Way::ToNodes] {
            for seed in 1..4 {
                // The invariants are checked inside.
                let _ = campaign(&cell, true, faults, way, 0..50, seed);
            }
        }
    }
}

#[test]
fn by_the_clock_it_completes_or_stops_with_a_sentence() {
    // Simulated time advances with SYNC, so that a stalled host does not cause a fault of a drive.
    let text = ilc_tests::example_text(CELLS[0]);
    let (program, learning) =
        (text.find("[[program.segment]]").unwrap(), text.find("[learning]").unwrap());
    let text = format!(
        "{}[[program.segment]]\nto_m = [0.08, 0.02]\n\n{}\n[safety]\noverrun_cycles_max = 5000\n",
        &text[..program],
        &text[learning..]
    );
    let cell = Cell::parse(&text, CELLS[0]).unwrap();
    let clean = undisturbed(&cell).runs[0].1.clone();
    let (clean_m, contour_m) = (clean.tracking_inf_m, clean.contour_inf_m);
    std::thread::scope(|scope| {
        for (name, faults) in kinds(0.005) {
            let cell = &cell;
            scope.spawn(move || {
                let end =
                    campaign(cell, false, faults, Way::ToController, 100..u32::MAX, 3).unwrap();
                // A corrupted position is followed like any other; all other measurements are true,
                // if incomplete or late.
                if end.status != EndStatus::Completed || name == "corruption" {
                    return;
                }
                for (run, figures) in &end.runs {
                    let error_m = figures.tracking_inf_m;
                    assert!(
                        error_m <= 2.0 * clean_m,
                        "{name}, run {run}: {error_m} of {clean_m} m"
                    );
                    // If a disturbed run had been learned from, the next one would be far off.
                    if let (Some(is_m), Some(was_m)) = (figures.contour_inf_m, contour_m)
                        && figures.missing_samples == 0
                    {
                        assert!(is_m <= 1.3 * was_m, "{name}, run {run}: {is_m} of {was_m} m");
                    }
                }
            });
        }
    });
}

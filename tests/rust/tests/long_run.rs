//! A campaign that runs until it is stopped: what it keeps in memory does not grow with its runs.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use ilc_rt::campaign::{self, Options};
use ilc_rt::config::{Keep, LawName};
use ilc_rt::library::Library;
use ilc_rt::record::{EndStatus, Event};
use ilc_tests::campaign::{in_process, options};
use ilc_tests::counting::{Counting, live_bytes};
use ilc_tests::{Scratch, short};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Runs after which everything that is bounded has reached its bound.
const WARM: u32 = 260;
/// Runs in which nothing may be added.
const MORE: u32 = 240;
/// Bytes that are no growth: the length of a number in a text.
const SLACK: i64 = 256;

/// Runs until it has counted, and returns the growth, and the runs of the outcome.
fn grows(law: LawName, keep: Keep) -> (i64, usize) {
    let (mut cell, scratch) = (short("01_gantry.toml"), Scratch::new());
    cell.learning.law = law;
    cell.program.settle_s = 0.0;
    // One axis moves a little.
    cell.program.segments.truncate(1);
    let stop = Arc::new(AtomicI32::new(0));
    let library = scratch.file("a.db");
    let mut options = Options { forever: true, keep: Some(keep), ..options(library.clone(), 1) };
    options.session.stop = Arc::clone(&stop);
    let mut at = [0; 2];
    let mut observe = |event: &Event| {
        if let Event::Iteration { index, .. } = event {
            match *index {
                WARM => at[0] = live_bytes(),
                index if index == WARM + MORE => {
                    at[1] = live_bytes();
                    stop.store(libc_sigint(), Ordering::Relaxed);
                }
                _ => {}
            }
        }
    };
    let bus = in_process(&cell);
    let outcome = campaign::run(&cell, &options, bus, None, &mut observe).unwrap();
    assert_eq!(outcome.status, EndStatus::Interrupted, "{}", outcome.reason);
    let kept = Library::read(&library).unwrap().list(None).unwrap().len();
    let all = (WARM + MORE + 1) as usize;
    match keep {
        Keep::All => assert!(kept >= all, "{kept} runs in the library"),
        Keep::Every(_) | Keep::Best => assert!(kept < all / 2, "{kept} runs in the library"),
    }
    (at[1] - at[0], outcome.runs.len())
}

/// The number of SIGINT.
const fn libc_sigint() -> i32 {
    2
}

#[test]
fn memory_does_not_grow_with_the_runs() {
    for (law, keep) in [(LawName::None, Keep::Every(50)), (LawName::NormOptimal, Keep::All)] {
        let (growth, n_runs) = grows(law, keep);
        assert!(growth <= SLACK, "{law:?}: {growth} bytes in {MORE} runs");
        assert_eq!(n_runs, 200, "{law:?}");
    }
}

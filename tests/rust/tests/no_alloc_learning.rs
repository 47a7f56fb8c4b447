//! A learning update allocates nothing, whatever the law: it may run while the axes return.

#![expect(unsafe_code, reason = "a global allocator is an unsafe trait")]
#![expect(clippy::unwrap_used, reason = "set-up shared by the tests must not fail")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use ilc_rt::learning::Law;
use ilc_rt::learning::law::norm_optimal::{NormOptimal, Weights};
use ilc_rt::learning::law::pd::{Pd, PdGains, QFilter};
use ilc_rt::model::{Method, StateSpace, discretize, second_order};
use ilc_rt::signal::butterworth;

struct Counting;

thread_local! {
    // Per thread, because the test harness allocates on its own threads meanwhile.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is handed to the system allocator unchanged; counting touches no memory but a
// thread-local cell that needs no set-up.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's contract is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's contract is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

const N_SAMPLES: usize = 1500;

fn axis(damping: f64) -> StateSpace {
    let model = second_order(94.0, damping).unwrap();
    discretize(&model, 4e-3, Method::ZeroOrderHold).unwrap()
}

fn allocations_of_an_update(law: &mut dyn Law) -> u64 {
    let input: Vec<f64> = (0..2 * N_SAMPLES).map(|k| (k as f64 * 0.37).sin()).collect();
    let error: Vec<f64> = (0..2 * N_SAMPLES).map(|k| (k as f64 * 0.11).cos()).collect();
    let mut next = vec![0.0; 2 * N_SAMPLES];
    let before = ALLOCATIONS.get();
    law.update(&input, &error, &mut next).unwrap();
    law.reset();
    let after = ALLOCATIONS.get();
    assert!(next.iter().all(|value| value.is_finite()) && next != input);
    after - before
}

#[test]
fn the_counter_counts() {
    let before = ALLOCATIONS.get();
    drop(std::hint::black_box(vec![0_u8; 100]));
    assert_eq!(ALLOCATIONS.get(), before + 1);
}

#[test]
fn no_law_allocates_in_an_update() {
    let separate = axis(1.0).append(&axis(0.6).delayed(1).unwrap()).unwrap();
    // The second axis shows in the first one's output, so that neither can be solved alone.
    let mut c = separate.c().clone();
    c[(0, 2)] = 0.1;
    let coupled = StateSpace::discrete(
        separate.a().clone(),
        separate.b().clone(),
        c,
        separate.d().clone(),
        4e-3,
    )
    .unwrap();
    let weights = Weights { q: 1.0, s: 0.0, r: 1e-6, rate: 3.0 };
    let sections = || butterworth(2, 50.0, 4e-3).unwrap();
    let gains = PdGains { kp: 1.0, kd: 3.25, lead: 1 };
    let mut laws: Vec<Box<dyn Law>> = vec![
        Box::new(NormOptimal::new(&separate, N_SAMPLES, weights).unwrap()),
        Box::new(NormOptimal::new(&coupled, N_SAMPLES, weights).unwrap()),
        Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::None).unwrap()),
        Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::ZeroPhase(sections())).unwrap()),
        Box::new(Pd::new(gains, N_SAMPLES, 2, QFilter::Causal(sections())).unwrap()),
    ];
    for law in &mut laws {
        assert_eq!(allocations_of_an_update(law.as_mut()), 0, "{}", law.describe());
    }
}

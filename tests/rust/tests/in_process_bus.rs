//! The bus inside one process: frames are handed to a responder, whose answers queue up.

#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a test may panic, and prints figures"
)]

use std::time::{Duration, Instant};

use ilc_rt::fieldbus::transport::{InProcess, Responder};
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_tests::counting::{Counting, allocations};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Answers a frame as often as its first byte says, with increasing identifiers.
#[derive(Debug, Default)]
struct Repeater {
    received: Vec<Frame>,
}

impl Responder for Repeater {
    fn receive(&mut self, frame: &Frame, reply: &mut dyn FnMut(Frame)) {
        self.received.push(*frame);
        for n in 0..u16::from(frame.payload().first().copied().unwrap_or(0)) {
            reply(Frame::new(frame.id() + 1 + n, frame.payload()).unwrap());
        }
    }
}

#[test]
fn whole_frames_are_handed_over_and_answers_come_in_order() {
    let mut bus = InProcess::new(Repeater::default(), 8);
    let frame = |n: u16| Frame::new(n, &n.to_le_bytes()[..usize::from(n % 3)]).unwrap();
    for n in 0..1000 {
        bus.send(&frame(n)).ok();
        while bus.recv(Duration::ZERO).unwrap().is_some() {}
    }
    assert!(bus.responder().received.iter().copied().eq((0..1000).map(frame)));
    for start in [0x100, 0x200] {
        bus.send(&Frame::new(start, &[2]).unwrap()).unwrap();
        bus.send(&Frame::new(start + 8, &[1]).unwrap()).unwrap();
        for id in [start + 1, start + 2, start + 9] {
            assert_eq!(bus.recv(Duration::ZERO).unwrap().map(|frame| frame.id()), Some(id));
        }
    }
}

#[test]
fn it_never_waits_and_never_echoes() {
    let mut bus = InProcess::new(Repeater::default(), 8);
    bus.send(&Frame::new(1, &[]).unwrap()).unwrap();
    let start = Instant::now();
    let before = allocations();
    assert_eq!(bus.recv(Duration::from_secs(60)).unwrap(), None);
    assert_eq!(allocations(), before);
    assert!(start.elapsed() < Duration::from_secs(30));
}

#[test]
fn it_says_when_answers_do_not_fit() {
    let mut bus = InProcess::new(Repeater::default(), 3);
    bus.send(&Frame::new(0x10, &[2]).unwrap()).unwrap();
    assert_eq!(bus.send(&Frame::new(0x20, &[2]).unwrap()), Err(BusError::Full));
    for id in [0x11, 0x12, 0x21] {
        assert_eq!(bus.recv(Duration::ZERO).unwrap().map(|frame| frame.id()), Some(id));
    }
    assert_eq!(bus.recv(Duration::ZERO).unwrap(), None);
}

/// Prints the ticks per second; run it by name with `--run-ignored all`.
#[test]
#[ignore = "prints figures, asserts nothing about them"]
fn ticks_per_second() {
    let mut bus = InProcess::new(Repeater::default(), 8);
    bus.responder_mut().received.reserve(2_000_000);
    let start = Instant::now();
    let n_ticks = 1_000_000;
    let mut n_answers = 0;
    for _ in 0..n_ticks {
        // Set point and SYNC out, two answers in: one axis and one tick.
        bus.send(&Frame::new(0x201, &[0; 8]).unwrap()).unwrap();
        bus.send(&Frame::new(0x80, &[2]).unwrap()).unwrap();
        while let Some(frame) = bus.recv(Duration::ZERO).unwrap() {
            n_answers += usize::from(frame.id());
        }
    }
    assert_eq!(n_answers, n_ticks * (0x81 + 0x82));
    let ticks_per_s = f64::from(u32::try_from(n_ticks).unwrap()) / start.elapsed().as_secs_f64();
    println!("in process: {ticks_per_s:.0} ticks/s with 2 frames out and 2 in");
}

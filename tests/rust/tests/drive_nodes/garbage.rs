//! Random traffic: no panic, no undefined state, no jump of the axis.

use std::time::Duration;

use ilc_rt::fieldbus::bring_up::bring_up;
use ilc_rt::fieldbus::canopen::{NmtCommand, sync};
use ilc_rt::fieldbus::cia402::Mode;
use ilc_rt::fieldbus::{Bus, Frame};
use proptest::prelude::*;

use crate::bench::{Bench, CYCLE_US, START_M, VELOCITY_MAX_M_S, counts, node, setup};

/// Draws frames that reach inner parts more often than purely random ones.
fn frame() -> impl Strategy<Value = Frame> {
    let id = prop_oneof![
        Just(0x000_u16),
        Just(0x080),
        Just(0x080),
        Just(0x201),
        Just(0x301),
        Just(0x601),
        Just(0x601),
        Just(0x60A),
        Just(0x77F),
        0_u16..0x800,
    ];
    let index = prop_oneof![
        Just(0x6040_u16),
        Just(0x6060),
        Just(0x607A),
        Just(0x6098),
        Just(0x6099),
        Just(0x6081),
        Just(0x2002),
        Just(0x60C2),
        Just(0x6065),
        Just(0x1017),
        Just(0x1400),
        Just(0x1600),
        Just(0x1800),
        Just(0x1A00),
        Just(0x2000),
        any::<u16>(),
    ];
    let request = (any::<u8>(), index, 0_u8..9, any::<[u8; 4]>()).prop_map(|(c, i, s, d)| {
        let [low, high] = i.to_le_bytes();
        vec![c, low, high, s, d[0], d[1], d[2], d[3]]
    });
    let command =
        (prop_oneof![Just(0x06_u8), Just(0x07), Just(0x0F), any::<u8>()], any::<[u8; 7]>())
            .prop_map(|(word, rest)| [vec![word, 0], rest[1..].to_vec()].concat());
    let nmt = prop_oneof![Just(1_u8), Just(2), Just(0x80), Just(0x81), Just(0x82)]
        .prop_map(|command| vec![command, 0]);
    let payload =
        prop_oneof![prop::collection::vec(any::<u8>(), 0..=8), request, command, nmt, Just(vec![])];
    (id, payload).prop_map(|(id, payload)| Frame::new(id, &payload).unwrap())
}

/// Frames of a stranger: one number after the other, from a seed.
struct Strangers(u64);

impl Strangers {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn frame(&mut self) -> Frame {
        let [a, b, len, ..] = self.next().to_le_bytes();
        let payload = self.next().to_le_bytes();
        let id = u16::from_le_bytes([a, b]) & 0x7FF;
        Frame::new(id, &payload[..usize::from(len % 9)]).unwrap()
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(1))]

    #[test]
    fn a_million_random_frames_leave_the_drive_alive_and_its_axis_still(seed in 1_u64..) {
        let mut bench = Bench::started(Mode::Csp);
        let mut strangers = Strangers(seed);
        let start_m = bench.bus.responder().plant().encoder_m(0);
        for _ in 0..1_000_000 {
            bench.bus.send(&strangers.frame()).unwrap();
            while bench.bus.recv(Duration::ZERO).unwrap().is_some() {}
        }
        let end_m = bench.bus.responder().plant().encoder_m(0);
        prop_assert_eq!(end_m.to_bits(), start_m.to_bits());
        // Whatever state the strangers left: it boots, answers and can be enabled.
        bring_up(&mut bench.bus, &setup(Mode::Csp)).unwrap();
        bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
        bench.enable(counts(START_M));
    }
}

proptest! {
    #![proptest_config(ilc_cases::cases(96))]

    #[test]
    fn random_frames_never_break_a_drive(
        frames in prop::collection::vec(frame(), 1..200), is_velocity: bool
    ) {
        let mode = if is_velocity { Mode::Csv } else { Mode::Csp };
        let mut bench = Bench::enabled(mode);
        let limit_m = VELOCITY_MAX_M_S * f64::from(CYCLE_US) * 1e-6 + 1e-9;
        // 0x607F may be overwritten, so the limit holds only until then.
        let touches_limit =
            |frame: &Frame| frame.id() == 0x601 && frame.payload().get(1..3) == Some(&[0x7F, 0x60]);
        let is_free = frames.iter().any(touches_limit);
        let mut before_m = bench.bus.responder().plant().encoder_m(0);
        for frame in frames {
            bench.bus.send(&frame).unwrap();
            bench.bus.send(&sync::frame()).unwrap();
            while bench.bus.recv(Duration::ZERO).unwrap().is_some() {}
            let machine = bench.bus.responder();
            let word = machine.dictionary(node(1)).unwrap().entries().iter()
                .find(|entry| entry.address.index == 0x6041).unwrap().value().number();
            let word = ilc_rt::fieldbus::cia402::Statusword(u16::try_from(word).unwrap());
            prop_assert!(word.state().is_some(), "statusword 0x{:04X}", word.0);
            let now_m = machine.plant().encoder_m(0);
            prop_assert!(now_m.is_finite());
            // A frame may be a SYNC: at most two cycles have passed.
            prop_assert!(is_free || (now_m - before_m).abs() <= 2.0 * limit_m);
            before_m = now_m;
        }
    }
}

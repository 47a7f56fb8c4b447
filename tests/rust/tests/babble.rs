//! A million random frames at the drives and at the controller: both stay alive, and the axes stay where they are.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::design::Plan;
use ilc_rt::fieldbus::bring_up::bring_up;
use ilc_rt::fieldbus::cia402::{State, StatusTpdo1};
use ilc_rt::fieldbus::network::{AnswerPart, Arrival};
use ilc_rt::fieldbus::transport::{InProcess, Responder};
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_rt::servo::TickStatus;
use ilc_tests::campaign::machine;
use ilc_tests::faulty::Draws;
use ilc_tests::rig::{Rig, node};
use ilc_tests::short;

const MILLION: u32 = 1_000_000;
const CELL: &str = "01_gantry.toml";

/// A frame of any identifier, length and payload; most are classical.
fn random(draws: &mut Draws) -> Frame {
    let id = u16::try_from(draws.below(0x800)).unwrap();
    let mut payload = [0; 64];
    for chunk in payload.chunks_exact_mut(8) {
        chunk.copy_from_slice(&draws.bits().to_le_bytes());
    }
    let n_bytes = if draws.chance(0.1) { [12, 16, 24, 64][draws.below(4)] } else { draws.below(9) };
    Frame::fd(id, &payload[..n_bytes]).unwrap()
}

#[test]
fn the_drives_stay_alive_and_still() {
    let cell = short(CELL);
    let mut drives = machine(&cell);
    let n_axes = drives.plant().n_axes();
    let before_m: Vec<f64> = (0..n_axes).map(|axis| drives.plant().encoder_m(axis)).collect();
    let mut draws = Draws::new(1);
    let mut n_answers = 0_u32;
    for _ in 0..MILLION {
        drives.receive(&random(&mut draws), &mut |_| n_answers += 1);
    }
    assert!(n_answers > 1000, "some were requests and SYNCs: {n_answers} answers");
    for (axis, before_m) in before_m.into_iter().enumerate() {
        let (now_m, state) =
            (drives.plant().encoder_m(axis), drives.drive_state(node(cell.axes[axis].node)));
        assert!((now_m - before_m).abs() < 1e-9, "axis {axis} moved to {now_m} m");
        assert_ne!(state, Some(State::OperationEnabled));
    }
    // Alive: each of them is brought up as if nothing had been.
    let mut bus = InProcess::new(drives, 256);
    for axis in &cell.axes {
        bring_up(&mut bus, &drive_setup(&cell, axis, true).unwrap()).unwrap();
    }
}

/// A bus on which random frames arrive, then one from a drive.
struct Babble {
    draws: Draws,
    left: u32,
}

impl Bus for Babble {
    fn send(&mut self, _frame: &Frame) -> Result<(), BusError> {
        Ok(())
    }

    fn recv(&mut self, _timeout: Duration) -> Result<Option<Frame>, BusError> {
        if self.left == 0 {
            return Ok(Some(StatusTpdo1::default().encode(node(2))));
        }
        self.left -= 1;
        Ok(Some(random(&mut self.draws)))
    }
}

#[test]
fn the_controller_reads_them_all_and_then_an_answer() {
    let cell = short(CELL);
    let plan = Plan::new(&cell, None, true).unwrap();
    let maps: Vec<_> =
        cell.axes.iter().map(|axis| drive_setup(&cell, axis, true).unwrap().map).collect();
    let bus = Babble { draws: Draws::new(2), left: MILLION };
    let mut network = plan.network(Box::new(bus), &maps);
    let (mut strangers, mut others) = (0_u32, 0_u32);
    for _ in 0..MILLION {
        match network.next(Duration::ZERO).unwrap() {
            Some(Arrival::Stranger(_)) => strangers += 1,
            Some(Arrival::Other) => others += 1,
            _ => {}
        }
    }
    assert!(strangers > 1000 && others > MILLION / 2, "{strangers} {others}");
    let last = network.next(Duration::ZERO).unwrap();
    let is_answer = |arrival: &Arrival| {
        matches!(arrival, Arrival::Answer { axis: 1, part: AnswerPart::Status, .. })
    };
    assert!(last.as_ref().is_some_and(is_answer), "{last:?}");
}

#[test]
fn the_loop_stops_the_axes_and_ends() {
    let cell = short(CELL);
    let mut draws = Draws::new(3);
    for n in 0..30_u32 {
        let mut rig = Rig::new(&cell, 1);
        let start_m: Vec<f64> =
            (0..2).map(|axis| rig.tap.line().machine().plant().encoder_m(axis)).collect();
        // Before the drives are enabled, and in the middle of a run.
        let is_moving = n % 3 == 0;
        if is_moving {
            rig.tick_into_run(0, 50 + n);
        }
        for _ in 0..5_000 {
            rig.tap.line().meddle(|_, reply| (0..100).for_each(|_| reply(random(&mut draws))));
            if rig.tick(0) == TickStatus::Stopped {
                break;
            }
        }
        assert!(rig.reason.is_some(), "the loop did not notice");
        if is_moving {
            assert!(
                rig.rest_m_s.iter().all(|velocity_m_s| velocity_m_s.abs() < 0.02),
                "{:?}",
                rig.rest_m_s
            );
        } else {
            for (axis, start_m) in start_m.iter().enumerate() {
                let now_m = rig.tap.line().machine().plant().encoder_m(axis);
                assert!((now_m - start_m).abs() < 1e-6, "axis {axis} moved to {now_m} m");
            }
        }
    }
}

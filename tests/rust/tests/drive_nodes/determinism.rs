//! Determinism: in lock-step the same commands give bit-identical frames, on the gantry with
//! friction.

use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::bring_up::{DriveSetup, bring_up};
use ilc_rt::fieldbus::canopen::{NmtCommand, NodeId, sync};
use ilc_rt::fieldbus::cia402::{CommandRpdo1, StatusTpdo1, next_command};
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::fieldbus::{Bus, Frame};
use ilc_sim::{ClockMode, Machine};

fn run() -> Vec<Frame> {
    let path = ilc_tests::example_path("01_gantry.toml");
    let cell = Cell::load(&path).unwrap();
    let mut bus = InProcess::new(Machine::from_cell(&cell, ClockMode::LockStep).unwrap(), 256);
    let nodes: Vec<NodeId> = cell.axes.iter().map(|a| NodeId::new(a.node).unwrap()).collect();
    for axis in &cell.axes {
        let setup = DriveSetup {
            following_error_max_counts: 1_000_000,
            ..drive_setup(&cell, axis, true).unwrap()
        };
        bring_up(&mut bus, &setup).unwrap();
    }
    bus.send(&NmtCommand::Start.frame(None)).unwrap();
    let mut frames = Vec::new();
    let mut status = [StatusTpdo1::default(); 2];
    let mut start: [Option<i32>; 2] = [None; 2];
    for cycle in 0..1000 {
        bus.send(&sync::frame()).unwrap();
        while let Some(frame) = bus.recv(Duration::ZERO).unwrap() {
            for (axis, &node) in nodes.iter().enumerate() {
                status[axis] = StatusTpdo1::decode(&frame, node).unwrap_or(status[axis]);
            }
            frames.push(frame);
        }
        for (axis, &node) in nodes.iter().enumerate() {
            let start = *start[axis].get_or_insert(status[axis].position_counts);
            let phase = f64::from(cycle) * 0.02;
            #[expect(clippy::cast_possible_truncation, reason = "a small count")]
            let swing = (1e6 * (1.0 - phase.cos())) as i32;
            let command = CommandRpdo1 {
                controlword: next_command(status[axis].statusword.state().unwrap()),
                target_counts: if cycle < 20 { start } else { start + swing },
                ..CommandRpdo1::default()
            };
            bus.send(&command.encode(node)).unwrap();
        }
    }
    frames
}

#[test]
fn two_runs_are_one_run() {
    let (first, second) = (run(), run());
    assert!(first.len() > 4000);
    let positions: Vec<i32> = first
        .iter()
        .filter_map(|frame| StatusTpdo1::decode(frame, NodeId::new(1).unwrap()))
        .map(|status| status.position_counts)
        .collect();
    let spread = positions.iter().max().unwrap() - positions.iter().min().unwrap();
    assert!(spread > 1_000_000, "the axis moved {spread} counts only");
    assert_eq!(first, second);
}

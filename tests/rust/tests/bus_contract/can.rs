//! SocketCAN alone: what it skips, filters, time stamps, error frames, an interface that goes down, and whole runs.

use std::cell::Cell;
use std::fs::File;
use std::process::Command;
use std::time::{Duration, SystemTime};

use ilc_rt::campaign::{self, Outcome};
use ilc_rt::fieldbus::transport;
use ilc_rt::fieldbus::{Bus, BusError, CanFact, Frame};
use ilc_rt::record::{EndStatus, Event, Fault, FaultKind, StateName};
use ilc_tests::campaign::{machine, options};
use ilc_tests::far_side::FarSide;
use ilc_tests::{Scratch, short};
use socketcan::{
    CanDataFrame, CanErrorFrame, CanFdFrame, CanFdSocket, CanRemoteFrame, EmbeddedFrame,
    ExtendedId, Socket, StandardId,
};

use super::{Ends, PATIENCE, receive, udp_ends};

/// Returns the CAN interface for tests, locked by one test at a time; `None` without one.
pub(super) fn can_interface() -> Option<String> {
    thread_local!(static LOCK: Cell<Option<File>> = const { Cell::new(None) });
    let name = match std::env::var("ILC_TEST_CAN") {
        Ok(name) => name,
        Err(_) if std::path::Path::new("/sys/class/net/vcan0").exists() => "vcan0".to_owned(),
        Err(_) => {
            eprintln!("SKIPPED: no vcan0 and ILC_TEST_CAN is not set; see tests/vcan/run");
            return None;
        }
    };
    let lock = File::create(std::env::temp_dir().join("ilc-rt-can-test.lock")).unwrap();
    lock.lock().unwrap();
    LOCK.set(Some(lock));
    Some(name)
}

pub(super) fn can_ends(interface: &str, options: &str) -> Ends {
    udp_ends(&format!("can:{interface}{options}"))
}

#[test]
fn socketcan_skips_what_is_no_frame_of_ours() {
    let Some(interface) = can_interface() else { return };
    let mut bus = transport::open(&format!("can:{interface}")).unwrap();
    let stranger = CanFdSocket::open(&interface).unwrap();
    let standard = StandardId::new(0x181).unwrap();
    let extended = ExtendedId::new(0x181).unwrap();
    stranger.write_frame(&CanDataFrame::new(extended, &[1]).unwrap()).unwrap();
    stranger.write_frame(&CanRemoteFrame::new_remote(standard, 2).unwrap()).unwrap();
    // An interface for classical frames only refuses it, which is as good as ignoring it.
    let _ = stranger.write_frame(&CanFdFrame::new(standard, &[0; 16]).unwrap());
    stranger.write_frame(&CanDataFrame::new(standard, &[2, 3]).unwrap()).unwrap();
    assert_eq!(receive(&mut *bus), Frame::new(0x181, &[2, 3]).unwrap());
    assert_eq!(bus.recv(Duration::ZERO).unwrap(), None);
}

#[test]
fn an_interface_that_is_not_there_is_named() {
    let error = transport::open("can:nocan7").err().expect("opened what is not there").to_string();
    assert!(error.contains("can:nocan7"), "{error}");
    assert!(error.contains("has no CAN") || error.contains("no such CAN interface"), "{error}");
}

/// Injects an error frame as the driver of a controller makes it: classes, and eight bytes.
fn report(stranger: &CanFdSocket, classes: u32, data: [u8; 8]) {
    stranger.write_frame(&CanErrorFrame::new_error(classes, &data).unwrap()).unwrap();
}

#[test]
fn the_kernel_drops_what_is_for_other_nodes() {
    let Some(interface) = can_interface() else { return };
    let (mut near, mut far) = can_ends(&interface, "");
    near.keep_to(&[1, 127]).unwrap();
    let all = [
        0x000, 0x001, 0x07F, 0x080, 0x081, 0x082, 0x0FF, 0x100, 0x181, 0x182, 0x201, 0x281, 0x2FF,
        0x302, 0x501, 0x581, 0x582, 0x601, 0x67F, 0x680, 0x701, 0x702, 0x77F, 0x7FE,
    ];
    for id in all {
        far.send(&Frame::new(id, &[7]).unwrap()).unwrap();
    }
    let is_kept = |id: &u16| [0x000, 0x080].contains(id) || [1, 127].contains(&(id & 0x7F));
    for id in all.into_iter().filter(is_kept) {
        assert_eq!(receive(&mut *near).id(), id);
    }
    assert_eq!(near.recv(Duration::ZERO), Ok(None));
}

#[test]
fn the_kernel_tells_when_a_frame_came() {
    let Some(interface) = can_interface() else { return };
    for format in ["", "?fd=1"] {
        let (mut near, mut far) = can_ends(&interface, format);
        assert_eq!(near.arrival(), None);
        let now = || SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
        let before = now();
        far.send(&Frame::new(0x181, &[1]).unwrap()).unwrap();
        receive(&mut *near);
        let came = near.arrival().expect("a time");
        // Read later, it is still the time of arrival.
        assert!(came >= before && came <= now(), "{before:?}, {came:?}");
        far.send(&Frame::new(0x181, &[2]).unwrap()).unwrap();
        receive(&mut *near);
        assert!(near.arrival().unwrap() >= came);
    }
}

#[test]
fn what_the_controller_reports_is_told_once_and_frames_go_on() {
    let Some(interface) = can_interface() else { return };
    let (mut near, mut far) = can_ends(&interface, "");
    let stranger = CanFdSocket::open(&interface).unwrap();
    let (transmit, receive_errors) = (140, 3);
    let counted = |problem| [0, problem, 0, 0, 0, 0, transmit, receive_errors];
    let passive = CanFact::ErrorPassive { transmit, receive: receive_errors };
    for (classes, data, expected) in [
        (0x040, counted(0), Some(CanFact::BusOff)),
        (0x100, counted(0), Some(CanFact::Restarted)),
        (0x204, counted(0x20), Some(passive)),
        (0x020, counted(0), Some(CanFact::NoAcknowledgement)),
        (0x004, counted(0x08), None),
        (0x002, counted(0), None),
    ] {
        for _ in 0..3 {
            report(&stranger, classes, data);
        }
        far.send(&Frame::new(0x181, &[9]).unwrap()).unwrap();
        if let Some(fact) = expected {
            assert_eq!(near.recv(PATIENCE), Err(BusError::Controller(fact)), "0x{classes:03X}");
        }
        assert_eq!(receive(&mut *near).id(), 0x181, "0x{classes:03X}");
        assert_eq!(near.recv(Duration::ZERO), Ok(None));
        // `far` has been told the same.
        while far.recv(Duration::ZERO) != Ok(None) {}
    }
}

/// Runs `ip` with some arguments; false where this user may not.
fn ip(arguments: &str) -> bool {
    let output = Command::new("ip").args(arguments.split(' ')).output();
    let is_done = output.as_ref().is_ok_and(|output| output.status.success());
    if !is_done {
        eprintln!("SKIPPED: `ip {arguments}`: {output:?}");
    }
    is_done
}

#[test]
fn an_interface_that_goes_down_is_named_and_works_again_when_it_is_up() {
    let Some(interface) = can_interface() else { return };
    let (mut near, mut far) = can_ends(&interface, "");
    if !ip(&format!("link set {interface} down")) {
        return;
    }
    let down = (near.recv(PATIENCE), near.send(&Frame::new(1, &[]).unwrap()));
    assert!(ip(&format!("link set {interface} up")));
    assert_eq!(down, (Err(BusError::Down), Err(BusError::Down)));
    while far.recv(Duration::ZERO) != Ok(None) {}
    far.send(&Frame::new(0x181, &[1]).unwrap()).unwrap();
    assert_eq!(receive(&mut *near).id(), 0x181);
}

#[test]
fn an_interface_that_is_unplugged_is_named() {
    if can_interface().is_none() || !ip("link add dev vcan9 type vcan") {
        return;
    }
    assert!(ip("link set vcan9 up"));
    let classical = transport::open("can:vcan9").unwrap();
    // An interface that carries classical frames only.
    assert!(ip("link set vcan9 down") && ip("link set vcan9 mtu 16") && ip("link set vcan9 up"));
    let error = transport::open("can:vcan9?fd=1").err().unwrap().to_string();
    assert!(error.contains("carries classical frames only"), "{error}");
    let mut near = classical;
    while near.recv(Duration::ZERO) == Err(BusError::Down) {}
    assert!(ip("link del dev vcan9"));
    let told: Vec<_> = (0..3).map(|_| near.recv(Duration::from_millis(50))).collect();
    assert!(told.contains(&Err(BusError::Gone)), "{told:?}");
    assert_eq!(near.send(&Frame::new(1, &[]).unwrap()), Err(BusError::Gone));
}

/// Runs a campaign in lock-step on an interface; `meddle` is called when run 1 begins.
fn run_on(
    address: &str,
    scratch: &Scratch,
    resume: bool,
    mut meddle: impl FnMut(),
) -> (Outcome, Option<Fault>) {
    let mut cell = short("01_gantry.toml");
    address.clone_into(&mut cell.bus.address);
    cell.safety.answer_timeout_s = 20.0;
    let mut options = options(scratch.file("library.db"), 3);
    options.resume = resume;
    let far_side = FarSide::serve(transport::open(address).unwrap(), machine(&cell));
    let near = transport::open(address).unwrap();
    let mut told = None;
    let outcome = campaign::run(&cell, &options, near, None, &mut |event| match event {
        Event::State { state: StateName::Running, iteration: 1 } => meddle(),
        Event::Fault { fault, .. } => told = Some(fault.clone()),
        _ => {}
    });
    drop(far_side);
    (outcome.unwrap(), told)
}

#[test]
fn a_controller_off_the_bus_ends_the_runs_and_they_are_resumed_when_it_is_back() {
    let Some(interface) = can_interface() else { return };
    for format in ["", "?fd=1"] {
        let address = format!("can:{interface}{format}");
        let scratch = Scratch::new();
        let stranger = CanFdSocket::open(&interface).unwrap();
        let (ended, fault) = run_on(&address, &scratch, false, || report(&stranger, 0x040, [0; 8]));
        assert_eq!(ended.status, EndStatus::Fault);
        assert!(ended.reason.contains("off the bus (bus-off)"), "{}", ended.reason);
        let fault = fault.expect("a fault");
        assert_eq!((fault.kind, fault.code), (FaultKind::CanController, Some(0x40)));
        let (resumed, _) = run_on(&address, &scratch, true, || {});
        assert_eq!(resumed.status, EndStatus::Completed, "{}", resumed.reason);
        assert_eq!(resumed.campaign, ended.campaign);
    }
}

//! The object dictionary of a drive: its refusals, and its agreement with the data sheet.

use ilc_rt::fieldbus::Bus;
use ilc_rt::fieldbus::bring_up::{SdoClient, SdoError};
use ilc_rt::fieldbus::canopen::{AbortCode, NmtCommand};
use ilc_rt::fieldbus::cia402::Mode;
use ilc_sim::node::dictionary::Access;
use ilc_sim::{ClockMode, eds};

use crate::bench::{ANSWER, Bench, node};

fn refused(bench: &mut Bench, index: u16, sub: u8, bytes: &[u8]) -> Option<AbortCode> {
    let client = SdoClient::new(node(1), ANSWER);
    match client.download(&mut bench.bus, index, sub, bytes) {
        Ok(()) => None,
        Err(SdoError::Aborted { code, .. }) => Some(code),
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn wrong_writes_are_refused_for_the_right_reason() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let table: [(u16, u8, &[u8], AbortCode); 14] = [
        (0x6041, 0, &[0, 0], AbortCode::ReadOnly),
        (0x1000, 0, &[0; 4], AbortCode::ReadOnly),
        (0x5000, 0, &[0], AbortCode::NoObject),
        (0x1018, 9, &[0], AbortCode::NoSubIndex),
        (0x6040, 0, &[0], AbortCode::TooShort),
        (0x6040, 0, &[0; 4], AbortCode::TooLong),
        (0x6060, 0, &[7], AbortCode::ValueRange),
        (0x60C2, 1, &[0], AbortCode::ValueTooLow),
        (0x60C2, 2, &[1], AbortCode::ValueTooHigh),
        (0x1800, 2, &[245], AbortCode::ValueRange),
        (0x1400, 1, &0x80_u32.to_le_bytes(), AbortCode::ValueRange),
        (0x1400, 1, &0x301_u32.to_le_bytes(), AbortCode::DeviceState),
        (0x1600, 0, &[0], AbortCode::DeviceState),
        (0x1003, 0, &[1], AbortCode::ValueRange),
    ];
    for (index, sub, bytes, code) in table {
        assert_eq!(
            refused(&mut bench, index, sub, bytes),
            Some(code),
            "0x{index:04X}:{sub:02X} = {bytes:02X?}"
        );
    }
}

#[test]
fn a_mapping_is_checked_entry_by_entry_and_as_a_whole() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let mut write = |index, sub, bytes: &[u8]| refused(&mut bench, index, sub, bytes);
    assert_eq!(write(0x1A00, 1, &[0; 4]), Some(AbortCode::DeviceState), "while valid");
    assert_eq!(write(0x1800, 1, &0xC000_0181_u32.to_le_bytes()), None);
    assert_eq!(write(0x1A00, 1, &[0; 4]), Some(AbortCode::UnsupportedAccess), "while counted");
    assert_eq!(write(0x1A00, 0, &[0]), None);
    let entry = |entry: u32| entry.to_le_bytes();
    assert_eq!(write(0x1A00, 1, &entry(0x6064_0010)), Some(AbortCode::NotMappable), "length");
    assert_eq!(write(0x1A00, 1, &entry(0x1008_0020)), Some(AbortCode::NotMappable), "text");
    assert_eq!(write(0x1A00, 1, &entry(0x5000_0020)), Some(AbortCode::NoObject));
    for sub in 1..=3 {
        assert_eq!(write(0x1A00, sub, &entry(0x6064_0020)), None);
    }
    assert_eq!(write(0x1A00, 0, &[3]), Some(AbortCode::PdoTooLong), "96 bits");
    assert_eq!(write(0x1A00, 0, &[4]), Some(AbortCode::NoObject), "an empty entry");
    assert_eq!(write(0x1A00, 0, &[2]), None);
    assert_eq!(write(0x1800, 1, &0x4000_0181_u32.to_le_bytes()), None);
    bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
    let position = bench.read(0x6064, 0).to_le_bytes();
    let frames = bench.sync().frames;
    let sent = frames.iter().find(|frame| frame.id() == 0x181).unwrap();
    assert_eq!(sent.payload(), [position, position].concat());
}

#[test]
fn transmission_types_say_when_a_pdo_is_sent() {
    let mut bench = Bench::started(Mode::Csp);
    bench.bus.send(&NmtCommand::PreOperational.frame(None)).unwrap();
    bench.write(0x1801, 2, &[3]);
    bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
    let sent: Vec<bool> = (0..9).map(|_| bench.sync().extra.is_some()).collect();
    assert_eq!(sent, [false, false, true, false, false, true, false, false, true]);

    bench.bus.send(&NmtCommand::PreOperational.frame(None)).unwrap();
    bench.write(0x1801, 2, &[0]);
    bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
    let sent: Vec<bool> = (0..4).map(|_| bench.sync().extra.is_some()).collect();
    assert_eq!(sent, [true, false, false, false], "type 0: on change only");

    bench.bus.send(&NmtCommand::PreOperational.frame(None)).unwrap();
    bench.write(0x1801, 2, &[255]);
    bench.write(0x1801, 5, &4_u16.to_le_bytes());
    bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
    let sent: Vec<bool> = (0..8).map(|_| bench.sync().extra.is_some()).collect();
    assert_eq!(sent, [true, false, false, false, true, false, false, false], "by its timer");
}

#[test]
fn no_process_data_outside_operational() {
    let mut bench = Bench::started(Mode::Csp);
    assert!(bench.sync().status.is_some());
    for command in [NmtCommand::PreOperational, NmtCommand::Stop] {
        bench.bus.send(&command.frame(None)).unwrap();
        assert_eq!(bench.sync().frames, [], "{command:?}");
    }
    let short = std::time::Duration::from_millis(1);
    let error = SdoClient::new(node(1), short).upload(&mut bench.bus, 0x1000, 0);
    assert!(matches!(error, Err(SdoError::Timeout { .. })), "stopped: not even SDO");
}

#[test]
fn a_short_command_is_an_emergency_not_a_command() {
    let mut bench = Bench::enabled(Mode::Csp);
    let short = ilc_rt::fieldbus::Frame::new(0x201, &[0, 0]).unwrap();
    bench.bus.send(&short).unwrap();
    let answer = bench.sync();
    assert_eq!(answer.emergencies, [0x8210]);
    assert_eq!(answer.state(), ilc_rt::fieldbus::cia402::State::OperationEnabled);
}

#[test]
fn of_a_long_command_the_first_bytes_count_and_it_is_told_once() {
    let mut bench = Bench::enabled(Mode::Csp);
    bench.write(0x1400, 1, &0x8000_0201_u32.to_le_bytes());
    bench.write(0x1600, 0, &[2]);
    bench.write(0x1400, 1, &0x0000_0201_u32.to_le_bytes());
    let quick_stop = [0x02, 0, 0, 0, 0, 0, 0, 0];
    let long = ilc_rt::fieldbus::Frame::new(0x201, &quick_stop).unwrap();
    let told: Vec<Vec<u16>> = (0..3)
        .map(|_| {
            bench.bus.send(&long).unwrap();
            bench.sync().emergencies
        })
        .collect();
    assert_eq!(told, [vec![0x8220], vec![], vec![]]);
    assert_eq!(bench.sync().state(), ilc_rt::fieldbus::cia402::State::QuickStopActive);
}

#[test]
fn every_object_of_the_data_sheet_can_be_read_and_has_its_default() {
    let mut bench = Bench::new(ClockMode::LockStep);
    let client = SdoClient::new(node(1), ANSWER);
    let entries = bench.bus.responder().dictionary(node(1)).unwrap().entries().to_vec();
    let text = eds::write(bench.bus.responder().dictionary(node(1)).unwrap(), "drive");
    assert!(entries.len() > 150, "{} objects", entries.len());
    for entry in entries {
        if entry.access == Access::WriteOnly {
            let refusal = client.upload(&mut bench.bus, entry.address.index, entry.address.sub);
            assert!(
                matches!(refusal, Err(SdoError::Aborted { code: AbortCode::WriteOnly, .. })),
                "{}",
                entry.address
            );
            continue;
        }
        let found = client.upload(&mut bench.bus, entry.address.index, entry.address.sub).unwrap();
        if entry.access == Access::Constant {
            assert_eq!(found, entry.power_on.encode().as_bytes(), "{}", entry.address);
        }
        let section = format!("[{:04X}]", entry.address.index);
        assert!(text.contains(&section), "{section}");
    }
}

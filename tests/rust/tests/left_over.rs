//! Objects left over in a drive by an earlier master: each wrong value is corrected at bring-up, or
//! the drive is refused with one line that names the object; the axes never move because of it.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use ilc_rt::campaign;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::ObjectAddress;
use ilc_rt::fieldbus::canopen::sdo::{Data, Expedited, SdoRequest};
use ilc_rt::fieldbus::transport::{InProcess, Responder};
use ilc_rt::library::Library;
use ilc_sim::Machine;
use ilc_tests::campaign::{machine, options};
use ilc_tests::{Scratch, short};

/// An SDO write, as any master could make it: index, sub-index, bytes.
type Write = (u16, u8, Vec<u8>);

fn u8(index: u16, sub: u8, value: u8) -> Write {
    (index, sub, vec![value])
}

fn i16(index: u16, value: i16) -> Write {
    (index, 0, value.to_le_bytes().to_vec())
}

fn u32(index: u16, sub: u8, value: u32) -> Write {
    (index, sub, value.to_le_bytes().to_vec())
}

fn i32(index: u16, sub: u8, value: i32) -> Write {
    (index, sub, value.to_le_bytes().to_vec())
}

fn u16(index: u16, value: u16) -> Write {
    (index, 0, value.to_le_bytes().to_vec())
}

/// Writes an object of node 1 and checks that the node took it.
fn leave(machine: &mut Machine, (index, sub, bytes): &Write) {
    let data = Data::Expedited(ObjectAddress::new(*index, *sub), Expedited::new(bytes).unwrap());
    let request = SdoRequest::Download(data).encode();
    let mut answers = Vec::new();
    let mut note = |answer: Frame| answers.push(answer);
    machine.receive(&Frame::new(0x601, &request).unwrap(), &mut note);
    let answer = answers.iter().find(|answer| answer.id() == 0x581).unwrap();
    assert_eq!(answer.payload()[0], 0x60, "0x{index:04X}:{sub:02X} is not taken: {answer:?}");
}

fn left_with(cell: &Cell, writes: &[Write]) -> Machine {
    let mut machine = machine(cell);
    for write in writes {
        leave(&mut machine, write);
    }
    // Persistent across a reset of communication as well.
    leave(&mut machine, &u32(0x1010, 1, u32::from_le_bytes(*b"save")));
    machine
}

/// Returns the digest of the only run, or the refusal.
fn run(cell: &Cell, machine: Machine) -> Result<String, String> {
    let scratch = Scratch::new();
    let library = scratch.file("library.db");
    let bus = Box::new(InProcess::new(machine, 256));
    let outcome = campaign::run(cell, &options(library.clone(), 1), bus, None, &mut |_| {})
        .map_err(|error| error.to_string())?;
    let library = Library::open(&library).unwrap();
    let rows = library.list(Some(&outcome.campaign)).unwrap();
    assert_eq!(rows.len(), 1, "{}", outcome.reason);
    Ok(library.load(rows[0].id).unwrap().digest)
}

/// Single objects, each with a value that would misplace the axis, change its stop or prevent it.
fn wrong_values() -> Vec<Vec<Write>> {
    let mut all: Vec<Vec<Write>> = vec![
        vec![i32(0x60B0, 0, 500_000)],
        vec![i32(0x60B0, 0, -1)],
        vec![i32(0x60B1, 0, 1_000_000)],
        vec![i16(0x60B2, 300)],
        vec![i32(0x607D, 1, 5_500_000)],
        vec![i32(0x607D, 2, 4_500_000)],
        vec![i32(0x607D, 1, 0), i32(0x607D, 2, 0)],
        vec![i32(0x607B, 1, 0), i32(0x607B, 2, 5_000_000)],
        vec![u32(0x607F, 0, 1000)],
        vec![u32(0x607F, 0, 0)],
        vec![u32(0x6080, 0, 1)],
        vec![u32(0x6083, 0, 1)],
        vec![u32(0x6084, 0, 1)],
        vec![u32(0x6085, 0, 1)],
        vec![u32(0x6085, 0, u32::MAX)],
        vec![u32(0x60C5, 0, 1)],
        vec![u32(0x60C6, 0, 1)],
        vec![u16(0x6072, 10)],
        vec![u16(0x6073, 0)],
        vec![u16(0x60E0, 10)],
        vec![u16(0x60E1, 10)],
        vec![i16(0x6007, 0)],
        vec![i16(0x6007, 2)],
        vec![i16(0x605A, 0)],
        vec![i16(0x605A, 1)],
        vec![i16(0x605A, 5)],
        vec![i16(0x605E, 0)],
        vec![u32(0x6065, 0, 1)],
        vec![u32(0x6065, 0, u32::MAX)],
        vec![u16(0x6066, 60_000)],
        vec![u8(0x60C2, 1, 200)],
        vec![u8(0x60C2, 2, 0)],
        vec![u8(0x6060, 0, 9)],
        vec![u32(0x60A8, 0, 0xFD01_0000)],
        vec![u32(0x60A9, 0, 0x0001_0300)],
        vec![u32(0x6096, 1, 2)],
        vec![u32(0x6097, 2, 1000)],
        vec![u32(0x6090, 1, 3)],
        vec![u32(0x1005, 0, 0x4000_0080), u32(0x1006, 0, 500)],
        vec![u32(0x1005, 0, 0x81)],
        vec![u32(0x1006, 0, 123)],
        vec![u32(0x1007, 0, 1)],
        vec![u8(0x1019, 0, 10)],
        vec![u32(0x1016, 1, 0x0063_0001)],
        vec![u8(0x1029, 1, 1)],
        vec![(0x1400, 5, 1_u16.to_le_bytes().to_vec())],
        vec![(0x1800, 5, 7_u16.to_le_bytes().to_vec())],
        vec![u8(0x1400, 2, 255)],
        vec![u8(0x1800, 2, 10)],
    ];
    for polarity in [0x40, 0x80, 0xC0] {
        all.push(vec![u8(0x607E, 0, polarity)]);
    }
    all
}

/// Returns the writes that move a PDO of node 1 (0x1401 for RPDO2) to an identifier and map it to
/// one object.
fn pdo(communication: u16, cob_id: u32, entry: u32) -> Vec<Write> {
    let mapping = communication + 0x200;
    vec![
        u32(communication, 1, 0xC000_0000 | cob_id),
        u8(communication, 2, 1),
        u8(mapping, 0, 0),
        u32(mapping, 1, entry),
        u8(mapping, 0, 1),
        u32(communication, 1, 0x4000_0000 | cob_id),
    ]
}

#[test]
fn a_wrong_value_is_put_right_and_the_run_is_the_same_to_the_last_bit() {
    let cell = short("01_gantry.toml");
    let clean = run(&cell, machine(&cell)).unwrap();
    for writes in wrong_values() {
        let found = run(&cell, left_with(&cell, &writes));
        assert_eq!(found.as_ref(), Ok(&clean), "{writes:04X?}");
    }
}

#[test]
fn foreign_process_data_is_switched_off() {
    let cell = short("01_gantry.toml");
    let clean = run(&cell, machine(&cell)).unwrap();
    for writes in [
        // The commands of the other axis and of this one, and a TPDO, taken for an offset or a
        // target.
        pdo(0x1401, 0x202, 0x60B0_0020),
        pdo(0x1402, 0x201, 0x60FF_0020),
        pdo(0x1403, 0x282, 0x607A_0020),
        // TPDOs on identifiers of the other axis and of the controller.
        pdo(0x1802, 0x182, 0x6064_0020),
        pdo(0x1803, 0x202, 0x6064_0020),
        // The loop's own PDOs, on other identifiers and with another mapping.
        pdo(0x1400, 0x333, 0x60FF_0020),
        pdo(0x1800, 0x333, 0x6041_0010),
    ] {
        let found = run(&cell, left_with(&cell, &writes));
        assert_eq!(found.as_ref(), Ok(&clean), "{writes:04X?}");
    }
}

#[test]
fn what_cannot_be_put_right_without_asking_refuses_the_drive() {
    let cell = short("01_gantry.toml");
    for (write, expected) in [
        (
            i32(0x607C, 0, 500_000),
            "node 1: object 0x607C:00 (Home offset): found 500000, needed 0; positions would be \
             shifted against the cell description",
        ),
        (
            u32(0x608F, 1, 2),
            "node 1: object 0x608F:00 (Position encoder resolution): found 2/1 with 0x6091 = 1/1 and \
             0x6092 = 1/1, needed one count per encoder increment",
        ),
        (u32(0x6091, 2, 7), "found 1/1 with 0x6091 = 1/7 and 0x6092 = 1/1"),
        (u32(0x6092, 1, 10), "found 1/1 with 0x6091 = 1/1 and 0x6092 = 10/1"),
    ] {
        let line = run(&cell, left_with(&cell, std::slice::from_ref(&write))).unwrap_err();
        assert!(line.contains(expected), "{write:04X?}: {line}");
        assert!(!line.contains('\n'), "{line}");
    }
}

#[test]
fn the_objects_of_the_table_are_those_that_the_simulated_drive_has() {
    // With a drive that ignored left-over values the other tests would pass trivially.
    let cell = short("01_gantry.toml");
    let machine = left_with(&cell, &[i32(0x60B0, 0, 500_000), u32(0x6085, 0, 1)]);
    let dictionary = machine.dictionary(ilc_tests::rig::node(1)).unwrap();
    let number = |index| dictionary.number(dictionary.find(ObjectAddress::new(index, 0)).unwrap());
    assert_eq!((number(0x60B0), number(0x6085)), (500_000, 1));
}

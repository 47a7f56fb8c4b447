//! Tests of the maps.

use proptest::prelude::*;

use super::super::pdo_map::{
    CommandRpdo1, DRIVE_MOTION_MAP, DriveMotionTpdo2, STATUS_MAP, StatusTpdo1, command_map,
};
use super::super::state::{Controlword, Statusword};
use super::*;
use crate::fieldbus::canopen::NodeId;
use crate::fieldbus::canopen::pdo::MappedObject;

fn bytes(map: &PdoMap) -> Vec<usize> {
    map.frame_bytes().collect()
}

#[test]
fn the_full_map_is_the_fixed_one_and_the_small_one_has_the_target() {
    for mode in Mode::ALL {
        let full = PdoMap::full(mode);
        assert_eq!(full.command.objects(), command_map(mode));
        assert_eq!(full.answers[0].objects(), STATUS_MAP);
        assert_eq!(full.answers[1].objects(), DRIVE_MOTION_MAP);
        let command = 2 + usize::from(mode.target().1 / 8);
        assert_eq!(bytes(&PdoMap::small(mode)), [command, 6]);
        assert_eq!(PdoMap::small(mode).check(mode, 8), Ok(()));
        assert_eq!(full.check(mode, 8), Ok(()));
    }
}

#[test]
fn what_fits_shares_a_frame() {
    let of = |wanted, bytes_max| {
        bytes(&PdoMap::choose(Mode::Csp, wanted, OptionalObjects::ALL, bytes_max))
    };
    assert_eq!(of(OptionalObjects::ALL, 64), [8, 16]);
    let error = OptionalObjects { following_error: true, ..OptionalObjects::NONE };
    assert_eq!(of(error, 8), [6, 6, 4]);
    let torque = OptionalObjects { torque: true, torque_offset: true, ..OptionalObjects::NONE };
    assert_eq!(of(torque, 8), [8, 8]);
}

#[test]
fn what_a_drive_lacks_is_not_mapped() {
    let lacks = OptionalObjects { torque_offset: false, ..OptionalObjects::ALL };
    let map = PdoMap::choose(Mode::Csv, OptionalObjects::ALL, lacks, 8);
    assert_eq!(bytes(&map), [6, 8, 8]);
    assert!(!map.carries(objects::TORQUE_OFFSET) && map.carries(objects::FOLLOWING_ERROR_ACTUAL));
    assert_eq!(PdoMap::full(Mode::Csv).without(objects::TORQUE_OFFSET), map);
}

#[test]
fn a_map_that_cannot_be_used_is_refused_by_name() {
    let object = |index, bits| MappedObject { address: ObjectAddress::new(index, 0), bits };
    let small = PdoMap::small(Mode::Csp);
    let with_command = |objects: &[MappedObject]| {
        PdoMap { command: PdoLayout::new(objects).unwrap(), ..small }
            .check(Mode::Csp, 8)
            .unwrap_err()
            .to_string()
    };
    let (word, target) = (object(0x6040, 16), object(0x607A, 32));
    assert!(with_command(&[word]).contains("no object 0x607A:00, which every RPDO1 needs"));
    assert!(with_command(&[word, object(0x607A, 16)]).contains("with 16 bits"));
    assert!(with_command(&[word, target, object(0x60FE, 16)]).contains("object 0x60FE:00 in a"));
    let long = with_command(&[word, target, object(0x60B1, 32)]);
    assert!(long.contains("10 bytes is not allowed: at most 8"), "{long}");
    assert_eq!(PdoLayout::new(&[word; 9]), Err(MapError::Objects { found: 9 }));
    let blind = PdoMap { answers: [small.answers[1], small.answers[0]], ..small };
    assert!(blind.check(Mode::Csp, 8).unwrap_err().to_string().contains("0x6041:00"));
}

proptest! {
    #![proptest_config(ilc_cases::cases(ilc_cases::CASES))]

    #[test]
    fn the_full_map_has_the_bytes_of_the_fixed_codecs(
        word: u16, a: i32, b: i32, last: i16
    ) {
        let node = NodeId::new(5).unwrap();
        let map = PdoMap::full(Mode::Csp);
        let command =
            CommandRpdo1 {
                controlword: Controlword(word),
                target_counts: a,
                torque_offset: last,
                ..CommandRpdo1::default()
            };
        let mut payload = [0; 8];
        prop_assert_eq!(map.command.write(Mode::Csp, &command, &mut payload), 8);
        let encoded = command.encode(node);
        prop_assert_eq!(&payload[..], encoded.payload());
        let status =
            StatusTpdo1 { statusword: Statusword(word), position_counts: a, torque: last };
        let read = map.answers[0].read(status.encode(node).payload()).unwrap();
        prop_assert_eq!(
            (read.statusword, read.position_counts, read.torque, read.velocity_counts_s),
            (Some(Statusword(word)), Some(a), Some(last), None)
        );
        let motion = DriveMotionTpdo2 { velocity_counts_s: a, following_error_counts: b };
        let read = map.answers[1].read(motion.encode(node).payload()).unwrap();
        prop_assert_eq!(read.velocity_counts_s, Some(a));
        prop_assert_eq!(read.following_error_counts, Some(b));
    }

    #[test]
    fn any_length_but_its_own_is_unreadable(
        payload in prop::collection::vec(any::<u8>(), 0..=8)
    ) {
        for layout in PdoMap::small(Mode::Csp).answers {
            prop_assert_eq!(layout.read(&payload).is_some(), payload.len() == layout.n_bytes());
        }
    }
}

#[test]
fn a_torque_is_the_target_in_torque_mode_and_an_offset_in_the_others() {
    let command = CommandRpdo1 {
        controlword: Controlword(0x0F),
        target_counts: 0x0102_0304,
        torque_offset: -2,
        velocity_offset: 5,
    };
    let mut payload = [0; 8];
    let small = PdoMap::small(Mode::Cst);
    assert_eq!(small.check(Mode::Cst, 8), Ok(()));
    assert_eq!(small.command.write(Mode::Cst, &command, &mut payload), 4);
    assert_eq!(payload[..4], [0x0F, 0, 0xFE, 0xFF]);
    let full = PdoMap::full(Mode::Cst);
    assert_eq!(full.check(Mode::Cst, 8), Ok(()));
    assert_eq!(full.command.write(Mode::Cst, &command, &mut payload), 8);
    assert_eq!(payload, [0x0F, 0, 4, 3, 2, 1, 0xFE, 0xFF]);
    let offset = PdoLayout::new(&[MappedObject {
        address: ObjectAddress::new(objects::TORQUE_OFFSET, 0),
        bits: 16,
    }])
    .unwrap();
    assert_eq!(offset.write(Mode::Csv, &command, &mut payload), 2);
    assert_eq!(payload[..2], [0xFE, 0xFF]);
    // In torque mode the drive would add it to the target.
    offset.write(Mode::Cst, &command, &mut payload);
    assert_eq!(payload[..2], [0, 0]);
}

#[test]
fn a_velocity_offset_is_in_the_second_command_unless_the_first_carries_it() {
    let plain = PdoMap::full(Mode::Csp);
    let map = plain.with_velocity_offset();
    assert_eq!(map.check(Mode::Csp, 8), Ok(()));
    assert_eq!((plain.frame_bytes().count(), map.frame_bytes().count()), (3, 4));
    let command = CommandRpdo1 { velocity_offset: -3, ..CommandRpdo1::default() };
    let mut payload = [0; 8];
    assert_eq!(map.offset.write(Mode::Csp, &command, &mut payload), 4);
    assert_eq!(payload[..4], (-3_i32).to_le_bytes());
    let own = PdoMap { command: map.offset, offset: PdoLayout::EMPTY, ..plain };
    assert!(own.with_velocity_offset().offset.is_empty());
}

#[test]
fn inputs_are_where_they_fit_or_in_the_place_of_the_velocity() {
    let carried = |map: PdoMap| {
        map.answers.map(|answer| {
            answer.objects().iter().map(|object| object.address.index).collect::<Vec<u16>>()
        })
    };
    assert_eq!(
        carried(PdoMap::full(Mode::Csp).with_inputs(8)),
        [vec![0x6041, 0x6064, 0x6077], vec![0x60F4, 0x60FD]]
    );
    assert_eq!(
        carried(PdoMap::small(Mode::Csv).with_inputs(8)),
        [vec![0x6041, 0x6064], vec![0x60FD]]
    );
    let wide = PdoMap::choose(Mode::Csp, OptionalObjects::ALL, OptionalObjects::ALL, 64);
    assert_eq!(
        carried(wide.with_inputs(64)),
        [vec![0x6041, 0x6064, 0x6077, 0x606C, 0x60F4, 0x60FD], vec![]]
    );
    let mapped = PdoMap::full(Mode::Csp).with_inputs(8);
    assert_eq!(mapped.with_inputs(8), mapped, "once");
    let reading = mapped.answers[1].read(&[1, 0, 0, 0, 0x02, 0, 0x01, 0x80]).unwrap();
    assert_eq!(reading.digital_inputs, Some(0x8001_0002));
}

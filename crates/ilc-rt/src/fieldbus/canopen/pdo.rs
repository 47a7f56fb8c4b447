//! Process data (PDO): objects of the dictionary, identifiers and mapping entries.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cob_id;
use super::node_id::NodeId;
use super::sdo::ObjectAddress;

/// In a COB-ID entry: the PDO is disabled (bit 31).
pub const COB_INVALID: u32 = 0x8000_0000;
/// In a COB-ID entry: no remote frames (bit 30); set by all devices that follow CiA 301 version 4.
pub const COB_NO_RTR: u32 = 0x4000_0000;
/// Transmission type 1: at every SYNC.
pub const TYPE_EVERY_SYNC: u8 = 1;

/// Direction of a PDO, as the drive sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// RPDO: from the controller to the drive.
    Receive,
    /// TPDO: from the drive to the controller.
    Transmit,
}

/// One of the four PDOs of a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoNumber {
    /// Direction.
    pub direction: Direction,
    /// 0 to 3: the first is RPDO1 or TPDO1.
    pub offset: u8,
}

impl PdoNumber {
    /// Returns RPDO1 … RPDO4 for `offset` 0 … 3.
    pub const fn receive(offset: u8) -> Self {
        Self { direction: Direction::Receive, offset: offset & 3 }
    }

    /// Returns TPDO1 … TPDO4 for `offset` 0 … 3.
    pub const fn transmit(offset: u8) -> Self {
        Self { direction: Direction::Transmit, offset: offset & 3 }
    }

    /// Returns the identifier of the predefined connection set.
    pub const fn default_cob_id(self, node: NodeId) -> u16 {
        let first = match self.direction {
            Direction::Receive => cob_id::RPDO1,
            Direction::Transmit => cob_id::TPDO1,
        };
        cob_id::of(first + 0x100 * self.offset as u16, node)
    }

    /// Returns the index of the communication parameters: from 0x1400 or 0x1800.
    pub const fn communication_index(self) -> u16 {
        let first = match self.direction {
            Direction::Receive => 0x1400,
            Direction::Transmit => 0x1800,
        };
        first + self.offset as u16
    }

    /// Returns the index of the mapping: from 0x1600 or 0x1A00.
    pub const fn mapping_index(self) -> u16 {
        self.communication_index() + 0x200
    }
}

impl std::fmt::Display for PdoNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let letter = match self.direction {
            Direction::Receive => 'R',
            Direction::Transmit => 'T',
        };
        write!(f, "{letter}PDO{}", self.offset + 1)
    }
}

/// One object in a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MappedObject {
    /// Object.
    pub address: ObjectAddress,
    /// Its length in bits; whole bytes here.
    pub bits: u8,
}

impl MappedObject {
    /// Returns the mapping entry: `index << 16 | sub << 8 | bits`.
    pub const fn entry(self) -> u32 {
        (self.address.index as u32) << 16 | (self.address.sub as u32) << 8 | self.bits as u32
    }

    /// Returns the object of a mapping entry.
    #[expect(clippy::cast_possible_truncation, reason = "the fields are cut out")]
    pub const fn from_entry(entry: u32) -> Self {
        let address = ObjectAddress::new((entry >> 16) as u16, (entry >> 8) as u8);
        Self { address, bits: entry as u8 }
    }
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    #[test]
    fn indices_and_identifiers_follow_the_predefined_set() {
        let node = NodeId::new(5).unwrap();
        let table = [
            (PdoNumber::receive(0), 0x205, 0x1400, 0x1600),
            (PdoNumber::receive(3), 0x505, 0x1403, 0x1603),
            (PdoNumber::transmit(0), 0x185, 0x1800, 0x1A00),
            (PdoNumber::transmit(3), 0x485, 0x1803, 0x1A03),
        ];
        for (number, cob, communication, mapping) in table {
            assert_eq!(number.default_cob_id(node), cob);
            assert_eq!(number.communication_index(), communication);
            assert_eq!(number.mapping_index(), mapping);
        }
    }

    #[test]
    fn mapping_entries_round_trip() {
        let object = MappedObject { address: ObjectAddress::new(0x607A, 0), bits: 32 };
        assert_eq!(object.entry(), 0x607A_0020);
        assert_eq!(MappedObject::from_entry(object.entry()), object);
    }
}

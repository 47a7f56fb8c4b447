//! A simulated encoder node: two positions of the tool centre point in one PDO.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::pdo::TYPE_EVERY_SYNC;
use ilc_rt::fieldbus::canopen::{AbortCode, NmtState, NodeId, ObjectAddress};
use ilc_rt::fieldbus::cia402::{objects, pdo_map};

use super::communication::{Communication, Incoming};
use super::dictionary::{Dictionary, Entry, Mappable, Slot};
use super::drive_objects::rounded;
use super::standard_objects::{self, PdoDefault};
use super::value::Value;

/// Device type: profile 406, multi-sensor encoder.
const DEVICE_TYPE: u32 = 0x000A_0196;

/// A simulated encoder node.
#[derive(Clone, Debug)]
pub struct EncoderNode {
    communication: Communication,
    positions: [Slot; 2],
    counts_per_m: f64,
    measured_m: [f64; 2],
}

impl EncoderNode {
    /// Creates an encoder that is powered but has not booted.
    ///
    /// # Errors
    /// The abort code of an object missing from the encoder's own table.
    pub fn new(node: NodeId, counts_per_m: f64) -> Result<Self, AbortCode> {
        let index = objects::ENCODER_POSITIONS;
        let mut entries =
            standard_objects::communication(node, DEVICE_TYPE, "ilc-sim encoder", 406);
        let pdo = PdoDefault {
            number: pdo_map::ENCODER_PDO,
            transmission: TYPE_EVERY_SYNC,
            event_ms: 0,
            map: &pdo_map::ENCODER_MAP,
        };
        entries.extend(standard_objects::process_data(node, &[pdo]));
        entries.push(Entry::constant(index, 0, "Highest sub-index", Value::U8(2)));
        for (sub, name) in [(1, "Position of the first axis"), (2, "Position of the second axis")] {
            entries.push(
                Entry::read_only(index, sub, name, Value::I32(0)).mappable(Mappable::Transmit),
            );
        }
        let communication = Communication::new(node, entries)?;
        let slot = |sub| communication.dictionary().find(ObjectAddress::new(index, sub));
        let positions = [slot(1)?, slot(2)?];
        Ok(Self { communication, positions, counts_per_m, measured_m: [0.0; 2] })
    }

    /// Returns the node number.
    pub fn node(&self) -> NodeId {
        self.communication.node()
    }

    /// Returns the NMT state.
    pub fn nmt(&self) -> NmtState {
        self.communication.nmt()
    }

    /// Returns the objects.
    pub fn dictionary(&self) -> &Dictionary {
        self.communication.dictionary()
    }

    /// Takes the last emergency sent since the last call.
    pub fn take_emergency(&mut self) -> Option<u16> {
        self.communication.take_emergency()
    }

    /// Sets the position of the tool from now on.
    pub fn measure(&mut self, measured_m: [f64; 2]) {
        self.measured_m = measured_m;
    }

    /// Sends the boot-up message and becomes pre-operational.
    pub fn boot(&mut self, out: &mut dyn FnMut(Frame)) {
        self.communication.boot(out);
    }

    /// Handles a frame from the bus.
    pub fn receive(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) {
        if self.communication.is_question(frame) {
            self.show();
        }
        if self.communication.receive(frame, out) == Incoming::Sync {
            self.show();
            self.communication.transmit_at_sync(out);
        }
    }

    /// Advances time.
    pub fn step(&mut self, step_us: u32, out: &mut dyn FnMut(Frame)) {
        if self.communication.pass(step_us.into()) {
            self.communication.attend(out);
        }
    }

    fn show(&mut self) {
        for (slot, position_m) in self.positions.into_iter().zip(self.measured_m) {
            let counts = rounded(position_m * self.counts_per_m);
            self.communication.dictionary_mut().set(slot, counts);
        }
    }
}

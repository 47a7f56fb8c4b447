//! PDO exchange: latches RPDOs until SYNC, sends TPDOs at SYNC or on change.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::ObjectAddress;
use ilc_rt::fieldbus::canopen::pdo::{COB_INVALID, MappedObject, PdoNumber};
use ilc_rt::fieldbus::frame::{FD_PAYLOAD_MAX, length_on_bus};

use super::dictionary::{Dictionary, Slot};
use super::pdo_rules;
use super::standard_objects::MAPPED_MAX;

/// Highest synchronous transmission type.
const SYNCHRONOUS_MAX: u8 = 240;

/// A PDO as defined by its parameters, resolved so that an exchange is a few copies.
#[derive(Clone, Copy, Debug)]
struct Pdo {
    /// `None`: disabled.
    cob_id: Option<u16>,
    transmission: u8,
    event_ms: u32,
    inhibit_us: u64,
    map: [(Slot, usize); MAPPED_MAX as usize],
    n_mapped: usize,
    n_bytes: usize,
    latched: Option<Frame>,
    last_sent: Option<Frame>,
    /// The last frame was longer than the map.
    is_long: bool,
    n_syncs: u8,
    /// Counter of the SYNC at which it begins; `None` once it has begun, or for any.
    begins_at: Option<u8>,
    /// Time since the last reception or transmission; `None` while the timer is not armed.
    since_us: Option<u64>,
}

impl Pdo {
    const EMPTY: Self = Self {
        cob_id: None,
        transmission: 1,
        event_ms: 0,
        inhibit_us: 0,
        map: [(Slot::FIRST, 0); MAPPED_MAX as usize],
        n_mapped: 0,
        n_bytes: 0,
        latched: None,
        last_sent: None,
        is_long: false,
        n_syncs: 0,
        begins_at: None,
        since_us: None,
    };

    fn load(dictionary: &Dictionary, number: PdoNumber) -> Self {
        let communication = |sub| {
            let address = ObjectAddress::new(number.communication_index(), sub);
            pdo_rules::parameter(dictionary, address)
        };
        let cob_id = communication(1);
        let mut pdo = Self {
            cob_id: (cob_id & COB_INVALID == 0)
                .then(|| u16::try_from(cob_id & 0x7FF).unwrap_or_default()),
            transmission: u8::try_from(communication(2)).unwrap_or(1),
            event_ms: communication(5),
            inhibit_us: u64::from(communication(3)) * 100,
            begins_at: u8::try_from(communication(6)).ok().filter(|counter| *counter > 0),
            ..Self::EMPTY
        };
        let mapping =
            |sub| pdo_rules::parameter(dictionary, ObjectAddress::new(number.mapping_index(), sub));
        let n_mapped = u8::try_from(mapping(0)).unwrap_or(0).min(MAPPED_MAX);
        for sub in 1..=n_mapped {
            let object = MappedObject::from_entry(mapping(sub));
            let Ok(slot) = dictionary.find(object.address) else { continue };
            pdo.map[pdo.n_mapped] = (slot, usize::from(object.bits / 8));
            pdo.n_mapped += 1;
            pdo.n_bytes += usize::from(object.bits / 8);
        }
        pdo
    }

    fn objects(&self) -> &[(Slot, usize)] {
        &self.map[..self.n_mapped]
    }

    fn unpack(&self, frame: &Frame, dictionary: &mut Dictionary) {
        let mut rest = frame.payload();
        for &(slot, n_bytes) in self.objects() {
            let Some((bytes, after)) = rest.split_at_checked(n_bytes) else { return };
            dictionary.store_from_pdo(slot, bytes);
            rest = after;
        }
    }

    fn pack(&self, cob_id: u16, dictionary: &Dictionary) -> Frame {
        let mut payload = [0; FD_PAYLOAD_MAX];
        let mut rest = &mut payload[..];
        for &(slot, n_bytes) in self.objects() {
            let encoded = dictionary.entry(slot).value().encode();
            let Some((place, after)) = rest.split_at_mut_checked(n_bytes) else { break };
            if let Some(bytes) = encoded.as_bytes().get(..n_bytes) {
                place.copy_from_slice(bytes);
            }
            rest = after;
        }
        Frame::fd(cob_id, &payload[..length_on_bus(self.n_bytes)]).unwrap_or_default()
    }

    fn is_synchronous(&self) -> bool {
        self.transmission <= SYNCHRONOUS_MAX
    }

    fn is_event_driven(&self) -> bool {
        self.cob_id.is_some() && !self.is_synchronous()
    }

    /// Returns the time after which its sender counts as silent, if it has promised to be cyclic.
    fn deadline_us(&self) -> Option<u64> {
        (self.event_ms > 0).then_some(u64::from(self.event_ms) * 1000)
    }
}

/// Meaning of a frame to the process data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Not a PDO of this node.
    Foreign,
    /// Kept until the next SYNC.
    Latched,
    /// Applied at once.
    Applied,
    /// Shorter than its mapping: discarded.
    TooShort,
}

/// The eight PDOs of a node.
#[derive(Clone, Copy, Debug)]
pub struct PdoEngine {
    /// Identifiers of the RPDOs, side by side: every frame on the bus is compared with them.
    received: [Option<u16>; 4],
    receive: [Pdo; 4],
    transmit: [Pdo; 4],
    has_excess: bool,
}

impl PdoEngine {
    /// Reads all parameters.
    pub fn new(dictionary: &Dictionary) -> Self {
        let mut engine = Self {
            received: [None; 4],
            receive: [Pdo::EMPTY; 4],
            transmit: [Pdo::EMPTY; 4],
            has_excess: false,
        };
        for offset in 0..4_u8 {
            let at = usize::from(offset);
            engine.receive[at] = Pdo::load(dictionary, PdoNumber::receive(offset));
            engine.transmit[at] = Pdo::load(dictionary, PdoNumber::transmit(offset));
        }
        engine.received = engine.receive.map(|pdo| pdo.cob_id);
        engine
    }

    /// Handles a frame that may be an RPDO.
    pub fn receive(&mut self, frame: &Frame, dictionary: &mut Dictionary) -> Received {
        let mut received = Received::Foreign;
        // More than one PDO may have the same identifier; each of them takes the frame.
        for pdo in self.receive.iter_mut().filter(|pdo| pdo.cob_id == Some(frame.id())) {
            received = if frame.payload().len() < pdo.n_bytes {
                Received::TooShort
            } else {
                let is_long = frame.payload().len() > pdo.n_bytes;
                self.has_excess |= is_long && !std::mem::replace(&mut pdo.is_long, is_long);
                pdo.since_us = Some(0);
                if pdo.is_synchronous() {
                    pdo.latched = Some(*frame);
                    Received::Latched
                } else {
                    pdo.unpack(frame, dictionary);
                    Received::Applied
                }
            };
        }
        received
    }

    /// Returns true if a frame since the last call was the first one that is longer than its map; its first bytes
    /// count.
    pub fn take_excess(&mut self) -> bool {
        std::mem::take(&mut self.has_excess)
    }

    /// Applies the RPDOs that arrived since the last SYNC.
    pub fn apply_latched(&mut self, dictionary: &mut Dictionary) {
        for pdo in &mut self.receive {
            if let Some(frame) = pdo.latched.take() {
                pdo.unpack(&frame, dictionary);
            }
        }
    }

    /// Sends the TPDOs due at this SYNC.
    pub fn transmit_at_sync(
        &mut self,
        counter: Option<u8>,
        dictionary: &Dictionary,
        out: &mut dyn FnMut(Frame),
    ) {
        for pdo in &mut self.transmit {
            let Some(cob_id) = pdo.cob_id else { continue };
            if !pdo.is_synchronous() {
                continue;
            }
            let mut begins = false;
            // A SYNC without counter cannot be waited for.
            if let (Some(first), Some(counter)) = (pdo.begins_at, counter) {
                begins = first == counter;
                if !begins {
                    continue;
                }
            }
            pdo.begins_at = None;
            pdo.n_syncs += 1;
            let frame = pdo.pack(cob_id, dictionary);
            let due = match pdo.transmission {
                0 => pdo.last_sent != Some(frame),
                every => begins || pdo.n_syncs >= every,
            };
            if due || pdo.transmission == 0 {
                pdo.n_syncs = 0;
            }
            if due {
                pdo.last_sent = Some(frame);
                out(frame);
            }
        }
    }

    /// Lets time pass.
    pub fn pass(&mut self, elapsed_us: u64) {
        let sent = self.transmit.iter_mut().filter(|pdo| pdo.is_event_driven());
        for pdo in sent.chain(self.receive.iter_mut().filter(|pdo| pdo.event_ms > 0)) {
            pdo.since_us = pdo.since_us.map(|since_us| since_us + elapsed_us);
        }
    }

    /// Returns the time after which a PDO is sent or overdue; none is before.
    pub fn rest_us(&self) -> u64 {
        // These may be sent whenever an object changes.
        if self.transmit.iter().any(Pdo::is_event_driven) {
            return 0;
        }
        let left_us = |pdo: &Pdo| Some((pdo.deadline_us()? + 1).saturating_sub(pdo.since_us?));
        self.receive.iter().filter_map(left_us).min().unwrap_or(u64::MAX)
    }

    /// Returns whether an RPDO has this identifier.
    pub fn has_receiver(&self, cob_id: u16) -> bool {
        self.received.contains(&Some(cob_id))
    }

    /// Sends the event-driven TPDOs that changed or whose timer expired.
    pub fn transmit_events(&mut self, dictionary: &Dictionary, out: &mut dyn FnMut(Frame)) {
        for pdo in &mut self.transmit {
            let Some(cob_id) = pdo.cob_id else { continue };
            if pdo.is_synchronous() {
                continue;
            }
            let since_us = pdo.since_us;
            if since_us.is_some_and(|since| since < pdo.inhibit_us) {
                continue;
            }
            let frame = pdo.pack(cob_id, dictionary);
            let timer_us = u64::from(pdo.event_ms) * 1000;
            let is_late = timer_us > 0 && since_us.is_none_or(|since| since >= timer_us);
            if is_late || pdo.last_sent != Some(frame) {
                pdo.last_sent = Some(frame);
                pdo.since_us = Some(0);
                out(frame);
            }
        }
    }

    /// Returns whether an RPDO with a deadline is overdue; each silence is reported once.
    pub fn deadline_passed(&mut self) -> bool {
        let mut passed = false;
        for pdo in &mut self.receive {
            let deadline_us = pdo.deadline_us().unwrap_or(u64::MAX);
            if pdo.since_us.is_some_and(|since_us| since_us > deadline_us) {
                pdo.since_us = None;
                passed = true;
            }
        }
        passed
    }

    /// Returns whether RPDO1 has a deadline: its sender has promised to be cyclic.
    pub fn has_deadline(&self) -> bool {
        self.receive[0].event_ms > 0
    }
}

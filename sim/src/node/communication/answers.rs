//! Answers to SDO requests, and what a written object changes in the communication itself.

use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{ObjectAddress, cob_id};
use ilc_rt::fieldbus::cia402::objects;

use super::{Communication, Incoming};
use crate::node::dictionary::Mappable;
use crate::node::object_access::ObjectAccess;
use crate::node::pdo_engine::PdoEngine;
use crate::node::pdo_rules;

impl Communication {
    pub(super) fn answer(&mut self, frame: &Frame, out: &mut dyn FnMut(Frame)) -> Incoming {
        let mut server = self.sdo;
        let keeps_mode_under_halt = self.habits.keeps_mode_under_halt;
        let mut access =
            ObjectAccess { dictionary: &mut self.dictionary, keeps_mode_under_halt, written: None };
        let answer = server.answer(frame.payload(), &mut access);
        let written = access.written;
        self.sdo = server;
        if let Some(answer) = answer {
            let id = cob_id::of(cob_id::SDO_RESPONSE, self.node);
            if let Some(frame) = Frame::new(id, &answer.encode()) {
                self.answer_in_time(frame, out);
            }
        }
        let Some(address) = written else { return Incoming::Nothing };
        self.forget_verification(address);
        if pdo_rules::pdo_at(address.index).is_some() {
            self.pdos = PdoEngine::new(&self.dictionary);
        }
        match address.index {
            objects::PRODUCER_HEARTBEAT => self.heartbeats.restart_own(),
            objects::CONSUMER_HEARTBEAT => self.heartbeats.disarm(),
            objects::ERROR_HISTORY => self.emergencies.clear(&mut self.dictionary),
            _ => {}
        }
        Incoming::Written
    }

    /// Sends an SDO answer, at once or after the time that this drive takes.
    fn answer_in_time(&mut self, answer: Frame, out: &mut dyn FnMut(Frame)) {
        if let Some((earlier, _)) = self.late_answer.take() {
            out(earlier);
        }
        if self.habits.answer_delay_us == 0 {
            out(answer);
        } else {
            self.late_answer = Some((answer, self.habits.answer_delay_us));
        }
    }

    pub(super) fn answer_late(&mut self, out: &mut dyn FnMut(Frame)) {
        if let Some((answer, _)) = self.late_answer.take_if(|(_, left_us)| *left_us == 0) {
            out(answer);
        }
    }

    /// Clears 0x1020 when the configuration that it stands for is changed.
    fn forget_verification(&mut self, written: ObjectAddress) {
        let is_configuration = !matches!(
            written.index,
            objects::VERIFY_CONFIGURATION | objects::STORE_PARAMETERS | objects::ERROR_HISTORY
        ) && self
            .dictionary
            .find(written)
            .is_ok_and(|slot| self.dictionary.entry(slot).mappable == Mappable::No);
        if is_configuration {
            for slot in self.slots.verified {
                self.dictionary.set(slot, 0);
            }
        }
    }
}

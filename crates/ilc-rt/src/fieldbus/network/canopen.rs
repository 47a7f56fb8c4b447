//! Axes on CANopen: commands are RPDOs, the exchange is SYNC, answers are TPDOs.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::time::Duration;

use super::{AnswerPart, Arrival, AxisNetwork, Reading, Stranger};
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::canopen::{Emergency, Heartbeat, NmtCommand, NodeId, cob_id, emcy, sync};
use crate::fieldbus::cia402::objects;
use crate::fieldbus::cia402::pdo_map::{DRIVE_MOTION_PDO, ENCODER_PDO, STATUS_PDO};
use crate::fieldbus::cia402::{CommandRpdo1, DriveMotionTpdo2, EncoderSample, StatusTpdo1};
use crate::fieldbus::{Bus, BusError, Frame};

/// Bases of the identifiers of the four receive PDOs.
const RPDOS: [u16; 4] = [0x200, 0x300, 0x400, 0x500];

/// Time for the answer of a drive in fault; the axes are at rest by then.
const ERROR_CODE_WAIT: Duration = Duration::from_millis(100);

/// Drives that were brought up on a bus, and a node that measures the tool.
pub struct CanopenAxes {
    bus: Box<dyn Bus>,
    nodes: Vec<NodeId>,
    tool: Option<NodeId>,
}

impl fmt::Debug for CanopenAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CanopenAxes").field("nodes", &self.nodes).finish_non_exhaustive()
    }
}

impl CanopenAxes {
    /// Creates the network of the drives in `nodes`, in the order of the axes. Cold.
    pub fn new(bus: Box<dyn Bus>, nodes: Vec<NodeId>, tool: Option<NodeId>) -> Self {
        Self { bus, nodes, tool }
    }

    /// Returns the message in a frame.
    fn read(&self, frame: &Frame) -> Arrival {
        if let Some(answer) = self.answer(frame) {
            return answer;
        }
        // No transport returns a sender's own frames, so each of these was sent by another master.
        if let Some(stranger) = self.stranger(frame) {
            return Arrival::Stranger(stranger);
        }
        if let Some(Emergency { node, code, .. }) = Emergency::decode(frame) {
            let sender = self.nodes.iter().position(|own| *own == node);
            return sender.map_or(Arrival::Other, |axis| Arrival::Emergency { axis, code });
        }
        match Heartbeat::decode(frame) {
            Some(Heartbeat { node, state }) if self.is_ours(node) => Arrival::Node { node, state },
            _ => Arrival::Other,
        }
    }

    /// Returns the answer to SYNC in a frame, if it is one.
    fn answer(&self, frame: &Frame) -> Option<Arrival> {
        let n_bytes = u8::try_from(frame.payload().len()).unwrap_or(u8::MAX);
        for (axis, &node) in self.nodes.iter().enumerate() {
            if let Some(status) = StatusTpdo1::decode(frame, node) {
                let reading = Reading {
                    statusword: Some(status.statusword),
                    position_counts: Some(status.position_counts),
                    torque: Some(status.torque),
                    ..Reading::default()
                };
                return Some(Arrival::Answer { axis, part: AnswerPart::Status, reading });
            }
            if let Some(motion) = DriveMotionTpdo2::decode(frame, node) {
                let reading = Reading {
                    velocity_counts_s: Some(motion.velocity_counts_s),
                    following_error_counts: Some(motion.following_error_counts),
                    ..Reading::default()
                };
                return Some(Arrival::Answer { axis, part: AnswerPart::Motion, reading });
            }
            for (part, pdo) in
                [(AnswerPart::Status, STATUS_PDO), (AnswerPart::Motion, DRIVE_MOTION_PDO)]
            {
                if frame.id() == pdo.default_cob_id(node) {
                    return Some(Arrival::Unreadable { axis, part, n_bytes });
                }
            }
        }
        let tool = self.tool?;
        if let Some(measured) = EncoderSample::decode(frame, tool) {
            return Some(Arrival::Tool([measured.x_counts, measured.y_counts]));
        }
        (frame.id() == ENCODER_PDO.default_cob_id(tool))
            .then_some(Arrival::UnreadableTool { n_bytes })
    }

    /// Returns the trace of another master in a frame, if any. Traffic with nodes outside this cell
    /// is ignored.
    fn stranger(&self, frame: &Frame) -> Option<Stranger> {
        if sync::is_sync(frame) {
            return Some(Stranger::Sync);
        }
        if let Some((command, node)) = NmtCommand::decode(frame) {
            return node
                .is_none_or(|node| self.is_ours(node))
                .then_some(Stranger::Nmt(command, node));
        }
        let to = |base| cob_id::node_of(base, frame.id()).filter(|node| self.is_ours(*node));
        if let Some(node) = to(cob_id::SDO_REQUEST).filter(|_| !only_reads(frame)) {
            return Some(Stranger::Request(node));
        }
        RPDOS.iter().find_map(|base| to(*base)).map(Stranger::Command)
    }

    /// Returns whether a node belongs to this cell.
    fn is_ours(&self, node: NodeId) -> bool {
        self.nodes.contains(&node) || self.tool == Some(node)
    }
}

impl AxisNetwork for CanopenAxes {
    fn write(&mut self, axis: usize, command: &CommandRpdo1) -> Result<(), BusError> {
        self.nodes.get(axis).map_or(Ok(()), |node| self.bus.send(&command.encode(*node)))
    }

    fn exchange(&mut self) -> Result<(), BusError> {
        self.bus.send(&sync::frame())
    }

    fn next(&mut self, timeout: Duration) -> Result<Option<Arrival>, BusError> {
        let frame = self.bus.recv(timeout)?;
        Ok(frame.map(|frame| self.read(&frame)))
    }

    fn release(&mut self) -> Result<(), BusError> {
        self.bus.send(&NmtCommand::PreOperational.frame(None))
    }

    fn error_code(&mut self, axis: usize) -> Option<u16> {
        let client = SdoClient::new(*self.nodes.get(axis)?, ERROR_CODE_WAIT);
        let code = client.upload_u32(self.bus.as_mut(), objects::ERROR_CODE, 0).ok()?;
        u16::try_from(code & 0xFFFF).ok().filter(|code| *code != emcy::CODE_RESET)
    }
}

/// Returns whether an SDO request changes nothing: an upload, its segment, or an abort. The loop itself
/// exchanges no objects, so that the answers confuse none of its own requests.
fn only_reads(frame: &Frame) -> bool {
    matches!(frame.payload().first().map(|command| command >> 5), Some(2..=5))
}

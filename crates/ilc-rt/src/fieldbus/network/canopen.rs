//! Axes on CANopen: commands are RPDOs, the exchange is SYNC, answers are TPDOs.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::fmt;
use std::time::Duration;

use super::{AnswerPart, Arrival, AxisNetwork, Stranger};
use crate::fieldbus::bring_up::SdoClient;
use crate::fieldbus::canopen::{
    Emergency, Heartbeat, NmtCommand, NmtState, NodeId, ObjectAddress, cob_id, emcy, sync,
};
use crate::fieldbus::cia402::pdo_map::{
    COMMAND_PDO, DRIVE_MOTION_PDO, ENCODER_PDO, OFFSET_PDO, STATUS_PDO,
};
use crate::fieldbus::cia402::{CommandRpdo1, EncoderSample, Mode, PdoMap, Supervision, objects};
use crate::fieldbus::frame::FD_PAYLOAD_MAX;
use crate::fieldbus::{Bus, BusError, Frame};

/// Bases of the identifiers of the four receive PDOs.
const RPDOS: [u16; 4] = [0x200, 0x300, 0x400, 0x500];

/// Object of a simulated drive with its digital inputs: who writes it presses a button, and commands no axis.
pub const SIMULATED_INPUTS: u16 = 0x2001;

/// Numbers of nodes: an identifier is that of a service, a multiple of it, plus the node's.
const N_NODES: usize = 128;

/// Time for the answer of a drive in fault; the axes are at rest by then.
const ERROR_CODE_WAIT: Duration = Duration::from_millis(100);

/// A drive that was brought up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Station {
    /// Its node.
    pub node: NodeId,
    /// Its mode of operation.
    pub mode: Mode,
    /// Its process data.
    pub map: PdoMap,
}

/// Drives that were brought up on a bus, and a node that measures the tool.
pub struct CanopenAxes {
    bus: Box<dyn Bus>,
    stations: Vec<Station>,
    /// Axis of each node's number.
    axes: [Option<u8>; N_NODES],
    tool: Option<NodeId>,
    /// True if the nodes are simulated.
    simulated: bool,
    beat: Option<Beat>,
}

/// The heartbeat of the controller, for the drives that watch it.
#[derive(Clone, Copy, Debug)]
struct Beat {
    frame: Frame,
    /// Exchanges from one to the next.
    every: u32,
    /// Exchanges until the next one.
    left: u32,
}

impl fmt::Debug for CanopenAxes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CanopenAxes").field("stations", &self.stations).finish_non_exhaustive()
    }
}

impl CanopenAxes {
    /// Creates the network of some drives, in the order of the axes. Cold.
    pub fn new(bus: Box<dyn Bus>, stations: Vec<Station>, tool: Option<NodeId>) -> Self {
        let mut axes = [None; N_NODES];
        for (axis, station) in (0..).zip(&stations) {
            axes[usize::from(station.node.get())] = Some(axis);
        }
        Self { bus, stations, axes, tool, simulated: false, beat: None }
    }

    /// Sets whether the nodes are simulated: their inputs may then be switched by other programs.
    #[must_use]
    pub fn simulated(self, simulated: bool) -> Self {
        Self { simulated, ..self }
    }

    /// Returns the network with a heartbeat of the controller, at every so many exchanges. Cold.
    #[must_use]
    pub fn with_heartbeat(self, controller: NodeId, every: u32) -> Self {
        let frame = Heartbeat { node: controller, state: NmtState::Operational }.encode();
        Self { beat: Some(Beat { frame, every, left: 0 }), ..self }
    }

    /// Sends the heartbeat if it is due.
    fn beat(&mut self) -> Result<(), BusError> {
        let Some(beat) = &mut self.beat else { return Ok(()) };
        if beat.left > 0 {
            beat.left -= 1;
            return Ok(());
        }
        beat.left = beat.every.saturating_sub(1);
        self.bus.send(&beat.frame)
    }

    /// Ends the watch of the drives over the heartbeat, which ends as well.
    fn release_watch(&mut self) {
        let ObjectAddress { index, sub } = ObjectAddress::new(objects::CONSUMER_HEARTBEAT, 1);
        let [low, high] = index.to_le_bytes();
        // An expedited download of four bytes; its answer is not waited for.
        let nothing = [0x23, low, high, sub, 0, 0, 0, 0];
        for station in &self.stations {
            let id = cob_id::of(cob_id::SDO_REQUEST, station.node);
            if station.map.supervision == Supervision::Heartbeat
                && let Some(request) = Frame::new(id, &nothing)
            {
                // One that is lost leaves a drive that is off, and reports the missing heartbeat.
                let _ = self.bus.send(&request);
            }
        }
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
            let sender = self.stations.iter().position(|own| own.node == node);
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
        let axis = self.axes[usize::from(frame.id()) % N_NODES].map(usize::from);
        if let Some((axis, station)) = axis.and_then(|axis| Some((axis, self.stations.get(axis)?)))
        {
            let parts = [(AnswerPart::Status, STATUS_PDO), (AnswerPart::Motion, DRIVE_MOTION_PDO)];
            for ((part, pdo), layout) in parts.into_iter().zip(&station.map.answers) {
                if layout.is_empty() || frame.id() != pdo.default_cob_id(station.node) {
                    continue;
                }
                let reading = layout.read(frame.payload());
                return Some(
                    reading.map_or(Arrival::Unreadable { axis, part, n_bytes }, |reading| {
                        Arrival::Answer { axis, part, reading }
                    }),
                );
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
        let changes = !(only_reads(frame) || self.simulated && presses(frame));
        if let Some(node) = to(cob_id::SDO_REQUEST).filter(|_| changes) {
            return Some(Stranger::Request(node));
        }
        RPDOS.iter().find_map(|base| to(*base)).map(Stranger::Command)
    }

    /// Returns whether a node belongs to this cell.
    fn is_ours(&self, node: NodeId) -> bool {
        self.stations.iter().any(|own| own.node == node) || self.tool == Some(node)
    }
}

impl AxisNetwork for CanopenAxes {
    fn write(&mut self, axis: usize, command: &CommandRpdo1) -> Result<(), BusError> {
        let Some(station) = self.stations.get(axis) else { return Ok(()) };
        // The offset first: the command makes the two complete.
        for (pdo, layout) in
            [(OFFSET_PDO, &station.map.offset), (COMMAND_PDO, &station.map.command)]
        {
            if layout.is_empty() {
                continue;
            }
            let mut payload = [0; FD_PAYLOAD_MAX];
            layout.write(station.mode, command, &mut payload);
            let payload = payload.get(..layout.frame_bytes()).unwrap_or(&[]);
            // Checked at set-up: a map fits a frame.
            if let Some(frame) = Frame::fd(pdo.default_cob_id(station.node), payload) {
                self.bus.send(&frame)?;
            }
        }
        Ok(())
    }

    fn exchange(&mut self) -> Result<(), BusError> {
        let beat = self.beat();
        beat.and(self.bus.send(&sync::frame()))
    }

    fn next(&mut self, timeout: Duration) -> Result<Option<Arrival>, BusError> {
        let frame = self.bus.recv(timeout)?;
        Ok(frame.map(|frame| self.read(&frame)))
    }

    fn arrival(&self) -> Option<Duration> {
        self.bus.arrival()
    }

    fn parts(&self, axis: usize) -> [bool; 2] {
        self.stations
            .get(axis)
            .map_or([false; 2], |own| own.map.answers.map(|part| !part.is_empty()))
    }

    fn part_bytes(&self, axis: usize, part: AnswerPart) -> u8 {
        let layout = self.stations.get(axis).and_then(|own| own.map.answers.get(part.index()));
        layout.map_or(0, |layout| u8::try_from(layout.frame_bytes()).unwrap_or(u8::MAX))
    }

    fn release(&mut self) -> Result<(), BusError> {
        self.release_watch();
        self.bus.send(&NmtCommand::PreOperational.frame(None))
    }

    fn error_code(&mut self, axis: usize) -> Option<u16> {
        let client = SdoClient::new(self.stations.get(axis)?.node, ERROR_CODE_WAIT);
        let code = client.upload_u32(self.bus.as_mut(), objects::ERROR_CODE, 0).ok()?;
        u16::try_from(code & 0xFFFF).ok().filter(|code| *code != emcy::CODE_RESET)
    }
}

/// Returns whether an SDO request changes nothing: an upload, its segment, or an abort. The loop itself
/// exchanges no objects, so that the answers confuse none of its own requests.
fn only_reads(frame: &Frame) -> bool {
    matches!(frame.payload().first().map(|command| command >> 5), Some(2..=5))
}

/// Returns whether an SDO request writes the inputs of a simulated drive.
fn presses(frame: &Frame) -> bool {
    let [low, high] = SIMULATED_INPUTS.to_le_bytes();
    matches!(frame.payload(), [command, a, b, ..] if command >> 5 == 1 && [*a, *b] == [low, high])
}

//! SDO client: reads and writes objects of a node. Cold: it waits for the node's answers.

use std::time::{Duration, Instant};

use crate::fieldbus::canopen::sdo::{
    Data, Expedited, ObjectAddress, SEGMENT_MAX, SdoRequest, SdoResponse, Segment, Turn,
};
use crate::fieldbus::canopen::{AbortCode, NodeId, cob_id};
use crate::fieldbus::{Bus, BusError};

/// Attempts at a transfer before the node counts as silent.
pub const TRIES: u32 = 2;

/// Longest object accepted from a node: a wrong size must not fill the memory.
const UPLOAD_MAX: usize = 65_536;

/// Reason that an object was not read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// The node aborted the transfer.
    #[error("node {node}: object {address}: refused with abort code {code}")]
    Aborted {
        /// The node.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// The abort code.
        code: AbortCode,
    },
    /// The node did not answer this request.
    #[error(
        "node {node}: object {address}: no answer within {timeout:?}, tried {TRIES} times{}",
        beside(*other)
    )]
    Timeout {
        /// The node.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// Time-out of each attempt.
        timeout: Duration,
        /// Last frame received from the node instead.
        other: Option<Stray>,
    },
    /// The node violated the protocol.
    #[error("node {node}: object {address}: expected {expected}, found {found}")]
    Protocol {
        /// The node.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// Expectation of the protocol.
        expected: &'static str,
        /// Frame or data found.
        found: String,
    },
    /// The bus failed.
    #[error("node {node}: object {address}: {source}")]
    Bus {
        /// The node.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// The bus error.
        source: BusError,
    },
}

/// A frame on the node's answer channel that answers no request of this client.
///
/// It may answer another master on the bus, come from a second node of the same number, or be the
/// late answer to a request that timed out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stray {
    /// About another object.
    Object(ObjectAddress),
    /// About this object, but for another request, e.g. a write instead of a read.
    Request,
    /// A segment of another transfer, or a duplicate.
    Segment,
    /// Not an SDO message.
    Garbage,
}

impl std::fmt::Display for Stray {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Object(address) => write!(f, "an answer for object {address}"),
            Self::Request => f.write_str("an answer to another request"),
            Self::Segment => f.write_str("a segment out of turn"),
            Self::Garbage => f.write_str("a frame that is no SDO answer"),
        }
    }
}

fn beside(other: Option<Stray>) -> String {
    other.map_or_else(String::new, |stray| format!("; what came instead: {stray}"))
}

/// Reads and writes objects of one node, one at a time.
///
/// Only matching answers count: the right kind, for the same object, or the next segment of the
/// transfer. All other messages on the node's channel are ignored until the timeout.
#[derive(Clone, Copy, Debug)]
pub struct SdoClient {
    node: NodeId,
    timeout: Duration,
}

impl SdoClient {
    /// Creates a client for `node` with a timeout for each answer.
    pub fn new(node: NodeId, timeout: Duration) -> Self {
        Self { node, timeout }
    }

    /// Returns the node.
    pub fn node(&self) -> NodeId {
        self.node
    }

    /// Reads an object, expedited or segmented as the node chooses; the bytes are little-endian.
    ///
    /// # Errors
    /// [`SdoError`] if the node aborts, does not answer or violates the protocol, or the bus fails.
    pub fn upload(&self, bus: &mut dyn Bus, index: u16, sub: u8) -> Result<Vec<u8>, SdoError> {
        self.with_retry(bus, ObjectAddress::new(index, sub), Self::upload_once)
    }

    /// Reads an object of at most four bytes as an unsigned number.
    ///
    /// # Errors
    /// As [`upload`](Self::upload), and [`SdoError::Protocol`] if it is longer or empty.
    pub fn upload_u32(&self, bus: &mut dyn Bus, index: u16, sub: u8) -> Result<u32, SdoError> {
        let bytes = self.upload(bus, index, sub)?;
        if bytes.is_empty() || bytes.len() > 4 {
            let found = format!("{} bytes", bytes.len());
            return Err(self.protocol(ObjectAddress::new(index, sub), "1 to 4 bytes", found));
        }
        Ok(bytes.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte)))
    }

    /// Reads sub-index 0 of an object once and counts the answers until `wait` after the first; 0
    /// after a timeout, or if the bus failed, which the next request reports.
    pub(crate) fn count_answers(
        &self,
        bus: &mut dyn Bus,
        index: u16,
        timeout: Duration,
        wait: Duration,
    ) -> usize {
        let address = ObjectAddress::new(index, 0);
        if self.drain(bus, address).is_err()
            || self.send(bus, address, SdoRequest::Upload(Turn::Initiate(address))).is_err()
        {
            return 0;
        }
        let mut deadline = Instant::now() + timeout;
        let mut n_answers = 0;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let Ok(Some(frame)) = bus.recv(left) else { return n_answers };
            let answer = (frame.id() == cob_id::of(cob_id::SDO_RESPONSE, self.node))
                .then(|| SdoResponse::decode(frame.payload()))
                .flatten();
            if answer.is_some_and(|answer| named(&answer) == Some(address)) {
                n_answers += 1;
                if n_answers == 1 {
                    deadline = Instant::now() + wait;
                }
            }
            if left.is_zero() {
                return n_answers;
            }
        }
    }

    /// Writes an object: expedited up to four bytes, else segmented; little-endian.
    ///
    /// # Errors
    /// [`SdoError`] if the node aborts, does not answer or violates the protocol, or the bus fails.
    pub fn download(
        &self,
        bus: &mut dyn Bus,
        index: u16,
        sub: u8,
        bytes: &[u8],
    ) -> Result<(), SdoError> {
        self.with_retry(bus, ObjectAddress::new(index, sub), |client, bus, address| {
            client.download_once(bus, address, bytes)
        })
    }

    /// Runs a transfer, and repeats it after a time-out, since one lost frame must not stop a
    /// machine.
    fn with_retry<T>(
        &self,
        bus: &mut dyn Bus,
        address: ObjectAddress,
        transfer: impl Fn(&Self, &mut dyn Bus, ObjectAddress) -> Result<T, SdoError>,
    ) -> Result<T, SdoError> {
        let mut tried = 1;
        loop {
            let outcome = transfer(self, bus, address);
            let Err(error) = &outcome else { return outcome };
            match error {
                SdoError::Aborted { .. } | SdoError::Bus { .. } => return outcome,
                // The server may be in the middle of the old transfer: abort it.
                SdoError::Timeout { .. } => {
                    self.send(bus, address, SdoRequest::Abort(address, AbortCode::Timeout))?;
                    if tried == TRIES {
                        return outcome;
                    }
                    tried += 1;
                }
                SdoError::Protocol { .. } => {
                    self.send(bus, address, SdoRequest::Abort(address, AbortCode::General))?;
                    return outcome;
                }
            }
        }
    }

    fn upload_once(&self, bus: &mut dyn Bus, address: ObjectAddress) -> Result<Vec<u8>, SdoError> {
        self.drain(bus, address)?;
        let first =
            self.ask(bus, address, SdoRequest::Upload(Turn::Initiate(address)), |answer| {
                matches!(answer, SdoResponse::Upload(Data::Expedited(..) | Data::Initiate(..)))
            })?;
        let size = match first {
            SdoResponse::Upload(Data::Expedited(_, data)) => return Ok(data.data().to_vec()),
            SdoResponse::Upload(Data::Initiate(_, size)) => size,
            _ => None,
        };
        let mut bytes = Vec::new();
        let mut toggle = false;
        loop {
            let next =
                self.ask(bus, address, SdoRequest::Upload(Turn::Segment(toggle)), |answer| {
                    matches!(
                        answer,
                        SdoResponse::Upload(Data::Segment(segment)) if segment.toggle == toggle
                    )
                })?;
            let SdoResponse::Upload(Data::Segment(segment)) = next else { continue };
            bytes.extend_from_slice(segment.data());
            if bytes.len() > UPLOAD_MAX {
                let found = format!("{} bytes and more", bytes.len());
                return Err(self.protocol(address, "at most 65536 bytes", found));
            }
            if segment.last {
                break;
            }
            toggle = !toggle;
        }
        match size {
            Some(size) if usize::try_from(size) != Ok(bytes.len()) => {
                let found = format!("{} bytes where {size} were announced", bytes.len());
                Err(self.protocol(address, "as many bytes as announced", found))
            }
            _ => Ok(bytes),
        }
    }

    fn download_once(
        &self,
        bus: &mut dyn Bus,
        address: ObjectAddress,
        bytes: &[u8],
    ) -> Result<(), SdoError> {
        self.drain(bus, address)?;
        let first = match Expedited::new(bytes) {
            Some(data) => Data::Expedited(address, data),
            None => Data::Initiate(address, u32::try_from(bytes.len()).ok()),
        };
        self.ask(bus, address, SdoRequest::Download(first), |answer| {
            matches!(answer, SdoResponse::Download(Turn::Initiate(_)))
        })?;
        if matches!(first, Data::Expedited(..)) {
            return Ok(());
        }
        let n_segments = bytes.len().div_ceil(SEGMENT_MAX).max(1);
        for number in 0..n_segments {
            let start = number * SEGMENT_MAX;
            let data = &bytes[start..bytes.len().min(start + SEGMENT_MAX)];
            let toggle = number % 2 == 1;
            let Some(segment) = Segment::new(toggle, number + 1 == n_segments, data) else {
                return Err(self.protocol(address, "segments of at most 7 bytes", String::new()));
            };
            self.ask(bus, address, SdoRequest::Download(Data::Segment(segment)), |answer| {
                *answer == SdoResponse::Download(Turn::Segment(toggle))
            })?;
        }
        Ok(())
    }

    /// Discards frames that arrived before the transfer, so that a late answer is not taken for a
    /// new one.
    fn drain(&self, bus: &mut dyn Bus, address: ObjectAddress) -> Result<(), SdoError> {
        while bus.recv(Duration::ZERO).map_err(|source| self.bus(address, source))?.is_some() {}
        Ok(())
    }

    fn send(
        &self,
        bus: &mut dyn Bus,
        address: ObjectAddress,
        request: SdoRequest,
    ) -> Result<(), SdoError> {
        bus.send(&cob_id::frame(cob_id::SDO_REQUEST, self.node, &request.encode()))
            .map_err(|source| self.bus(address, source))
    }

    /// Sends a request and waits for its answer, skipping all other traffic. An abort counts if it
    /// names the object, any other answer if `answers` accepts it and it does not name another
    /// object.
    fn ask(
        &self,
        bus: &mut dyn Bus,
        address: ObjectAddress,
        request: SdoRequest,
        answers: impl Fn(&SdoResponse) -> bool,
    ) -> Result<SdoResponse, SdoError> {
        self.send(bus, address, request)?;
        let deadline = Instant::now() + self.timeout;
        let answer_id = cob_id::of(cob_id::SDO_RESPONSE, self.node);
        let mut other = None;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let frame = bus.recv(left).map_err(|source| self.bus(address, source))?;
            if let Some(frame) = frame
                && frame.id() == answer_id
            {
                match SdoResponse::decode(frame.payload()) {
                    None => other = Some(Stray::Garbage),
                    Some(answer) => match named(&answer) {
                        Some(named) if named != address => other = Some(Stray::Object(named)),
                        _ => match answer {
                            SdoResponse::Abort(_, code) => {
                                return Err(SdoError::Aborted { node: self.node, address, code });
                            }
                            answer if answers(&answer) => return Ok(answer),
                            SdoResponse::Upload(Data::Segment(_))
                            | SdoResponse::Download(Turn::Segment(_)) => {
                                other = Some(Stray::Segment);
                            }
                            _ => other = Some(Stray::Request),
                        },
                    },
                }
            }
            // A babbling bus must not block the request indefinitely.
            if frame.is_none() || left.is_zero() {
                let (node, timeout) = (self.node, self.timeout);
                return Err(SdoError::Timeout { node, address, timeout, other });
            }
        }
    }

    fn protocol(&self, address: ObjectAddress, expected: &'static str, found: String) -> SdoError {
        SdoError::Protocol { node: self.node, address, expected, found }
    }

    fn bus(&self, address: ObjectAddress, source: BusError) -> SdoError {
        SdoError::Bus { node: self.node, address, source }
    }
}

/// Returns the object that an answer names, if its kind has one.
fn named(answer: &SdoResponse) -> Option<ObjectAddress> {
    match *answer {
        SdoResponse::Upload(Data::Expedited(address, _) | Data::Initiate(address, _))
        | SdoResponse::Download(Turn::Initiate(address))
        | SdoResponse::Abort(address, _) => Some(address),
        SdoResponse::Upload(Data::Segment(_)) | SdoResponse::Download(Turn::Segment(_)) => None,
    }
}

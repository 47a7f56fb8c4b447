//! SDO client: reads and writes objects of a node. Cold: it waits for the node's answers.

use std::time::{Duration, Instant};

use super::cob_id;
use super::node_id::NodeId;
use super::sdo::{Expedited, ObjectAddress, SEGMENT_MAX, SdoRequest, SdoResponse, Segment};
use super::sdo_abort::AbortCode;
use crate::fieldbus::{Bus, BusError};

/// How often a transfer is begun before the node counts as silent.
pub const TRIES: u32 = 2;

/// Longest object accepted from a node: a wrong size must not fill the memory.
const UPLOAD_MAX: usize = 65_536;

/// Why an object could not be read or written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// The node refused.
    #[error("node {node}: object {address}: refused with abort code {code}")]
    Aborted {
        /// The node that was asked.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// The node's reason.
        code: AbortCode,
    },
    /// The node did not answer.
    #[error("node {node}: object {address}: no answer within {timeout:?}, tried {TRIES} times")]
    Timeout {
        /// The node that was asked.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// How long each try waited.
        timeout: Duration,
    },
    /// The node answered against the protocol.
    #[error("node {node}: object {address}: expected {expected}, found {found}")]
    Protocol {
        /// The node that was asked.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// What the protocol asks for.
        expected: &'static str,
        /// What came.
        found: String,
    },
    /// The bus failed.
    #[error("node {node}: object {address}: {source}")]
    Bus {
        /// The node that was asked.
        node: NodeId,
        /// The object.
        address: ObjectAddress,
        /// The failure of the bus.
        source: BusError,
    },
}

/// Reads and writes objects of one node, one at a time.
#[derive(Clone, Copy, Debug)]
pub struct SdoClient {
    node: NodeId,
    timeout: Duration,
}

impl SdoClient {
    /// A client for `node` that waits `timeout` for each answer.
    pub fn new(node: NodeId, timeout: Duration) -> Self {
        Self { node, timeout }
    }

    /// Reads an object, expedited or segmented as the node likes; the bytes are little endian.
    ///
    /// # Errors
    /// [`SdoError`] if the node refuses, stays silent or breaks the protocol, or the bus fails.
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

    /// Writes an object: expedited up to four bytes, segmented beyond; little endian.
    ///
    /// # Errors
    /// [`SdoError`] if the node refuses, stays silent or breaks the protocol, or the bus fails.
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

    /// Runs a transfer; begins anew after a time-out, as one lost frame must not stop a machine.
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
                // The server may be in the middle of the old transfer: tell it that it is over.
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
        let size = match self.ask(bus, address, SdoRequest::UploadInitiate(address))? {
            SdoResponse::UploadExpedited(found, data) if found == address => {
                return Ok(data.data().to_vec());
            }
            SdoResponse::UploadInitiate(found, size) if found == address => size,
            other => return Err(self.unexpected(address, "an answer to a read", other)),
        };
        let mut bytes = Vec::new();
        let mut toggle = false;
        loop {
            let segment = match self.ask(bus, address, SdoRequest::UploadSegment(toggle))? {
                SdoResponse::UploadSegment(segment) if segment.toggle == toggle => segment,
                other => return Err(self.unexpected(address, "the next segment", other)),
            };
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
            Some(data) => SdoRequest::DownloadExpedited(address, data),
            None => SdoRequest::DownloadInitiate(address, u32::try_from(bytes.len()).ok()),
        };
        match self.ask(bus, address, first)? {
            SdoResponse::DownloadInitiate(found) if found == address => {}
            other => return Err(self.unexpected(address, "an answer to a write", other)),
        }
        if matches!(first, SdoRequest::DownloadExpedited(..)) {
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
            match self.ask(bus, address, SdoRequest::DownloadSegment(segment))? {
                SdoResponse::DownloadSegment(found) if found == toggle => {}
                other => return Err(self.unexpected(address, "a taken segment", other)),
            }
        }
        Ok(())
    }

    /// Discards what arrived before the transfer, so that a late answer is not taken for a new one.
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

    /// Sends a request and waits for the node's answer, past all other traffic.
    fn ask(
        &self,
        bus: &mut dyn Bus,
        address: ObjectAddress,
        request: SdoRequest,
    ) -> Result<SdoResponse, SdoError> {
        self.send(bus, address, request)?;
        let deadline = Instant::now() + self.timeout;
        let answer_id = cob_id::of(cob_id::SDO_RESPONSE, self.node);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            let frame = bus.recv(left).map_err(|source| self.bus(address, source))?;
            let Some(frame) = frame else {
                return Err(SdoError::Timeout { node: self.node, address, timeout: self.timeout });
            };
            if frame.id() != answer_id {
                if left.is_zero() {
                    let timeout = self.timeout;
                    return Err(SdoError::Timeout { node: self.node, address, timeout });
                }
                continue;
            }
            return match SdoResponse::decode(frame.payload()) {
                Some(SdoResponse::Abort(_, code)) => {
                    Err(SdoError::Aborted { node: self.node, address, code })
                }
                Some(response) => Ok(response),
                None => {
                    let found = format!("{:02X?}", frame.payload());
                    Err(self.protocol(address, "an SDO answer of 8 bytes", found))
                }
            };
        }
    }

    fn unexpected(
        &self,
        address: ObjectAddress,
        expected: &'static str,
        found: SdoResponse,
    ) -> SdoError {
        self.protocol(address, expected, format!("{found:?}"))
    }

    fn protocol(&self, address: ObjectAddress, expected: &'static str, found: String) -> SdoError {
        SdoError::Protocol { node: self.node, address, expected, found }
    }

    fn bus(&self, address: ObjectAddress, source: BusError) -> SdoError {
        SdoError::Bus { node: self.node, address, source }
    }
}

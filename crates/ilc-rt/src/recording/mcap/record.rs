//! The records of a file that a reader acts on, and the fields that they are made of.

use std::collections::BTreeMap;

use super::op;

/// A record; what a reader of recordings skips is `Other`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::recording) enum Record {
    Channel { id: u16, topic: String },
    Message { channel: u16, log_time: u64, data: Vec<u8> },
    Attachment { name: String, data: Vec<u8> },
    Metadata { name: String, fields: BTreeMap<String, String> },
    Other,
}

/// Appends fields to bytes.
pub(super) trait Put {
    fn u8(&mut self, value: u8);
    fn u16(&mut self, value: u16);
    fn u32(&mut self, value: u32);
    fn u64(&mut self, value: u64);
    /// Appends text with its length.
    fn text(&mut self, text: &str);
    /// Appends bytes with their length in 32 bits.
    fn block(&mut self, bytes: &[u8]);
}

impl Put for Vec<u8> {
    fn u8(&mut self, value: u8) {
        self.push(value);
    }

    fn u16(&mut self, value: u16) {
        self.extend_from_slice(&value.to_le_bytes());
    }

    fn u32(&mut self, value: u32) {
        self.extend_from_slice(&value.to_le_bytes());
    }

    fn u64(&mut self, value: u64) {
        self.extend_from_slice(&value.to_le_bytes());
    }

    fn text(&mut self, text: &str) {
        self.block(text.as_bytes());
    }

    fn block(&mut self, bytes: &[u8]) {
        self.u32(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        self.extend_from_slice(bytes);
    }
}

/// Takes fields from the front of bytes.
pub(super) struct Take<'a>(pub(super) &'a [u8]);

impl<'a> Take<'a> {
    pub(super) fn bytes(&mut self, n_bytes: usize) -> Result<&'a [u8], String> {
        let (taken, rest) = self.0.split_at_checked(n_bytes).ok_or("a record ends too early")?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let bytes = self.bytes(N)?;
        bytes.try_into().map_err(|_| "a record ends too early".to_owned())
    }

    pub(super) fn u16(&mut self) -> Result<u16, String> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, String> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, String> {
        self.array().map(u64::from_le_bytes)
    }

    pub(super) fn text(&mut self) -> Result<String, String> {
        let n_bytes = self.u32()? as usize;
        let bytes = self.bytes(n_bytes)?.to_vec();
        String::from_utf8(bytes).map_err(|_| "a text is not UTF-8".to_owned())
    }
}

impl Record {
    /// Reads a record of a kind.
    pub(super) fn parse(kind: u8, content: &[u8]) -> Result<Self, String> {
        let mut rest = Take(content);
        Ok(match kind {
            op::CHANNEL => {
                let id = rest.u16()?;
                rest.u16()?;
                Self::Channel { id, topic: rest.text()? }
            }
            op::MESSAGE => {
                let channel = rest.u16()?;
                rest.u32()?;
                let log_time = rest.u64()?;
                rest.u64()?;
                Self::Message { channel, log_time, data: rest.0.to_vec() }
            }
            op::ATTACHMENT => {
                rest.bytes(16)?;
                let name = rest.text()?;
                rest.text()?;
                let n_bytes = usize::try_from(rest.u64()?).map_err(|error| error.to_string())?;
                let data = rest.bytes(n_bytes)?.to_vec();
                let checked = content.len() - rest.0.len();
                let crc = rest.u32()?;
                if crc != 0 && crc != super::crc::crc32(&content[..checked]) {
                    return Err(format!("the attachment {name} is damaged: its checksum differs"));
                }
                Self::Attachment { name, data }
            }
            op::METADATA => {
                let name = rest.text()?;
                let n_bytes = rest.u32()? as usize;
                let mut inner = Take(rest.bytes(n_bytes)?);
                let mut fields = BTreeMap::new();
                while !inner.0.is_empty() {
                    let key = inner.text()?;
                    fields.insert(key, inner.text()?);
                }
                Self::Metadata { name, fields }
            }
            _ => Self::Other,
        })
    }
}

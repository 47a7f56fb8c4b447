//! The MCAP file format, as far as recordings use it: uncompressed chunks, with all indexes.
//!
//! [`Writer`] and [`Records`] know bytes, not messages. Written here, in a few hundred lines, as the format is small and
//! fixed: a library for it brings macros along that every build of the project would compile.
//!
//! Source: <https://mcap.dev/spec>, version 0.

mod crc;
mod read;
mod record;
mod write;

pub(super) use read::Records;
pub(super) use record::Record;
pub(super) use write::Writer;

/// First and last bytes of a file.
const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n'];

/// Kinds of records.
mod op {
    pub(super) const HEADER: u8 = 0x01;
    pub(super) const FOOTER: u8 = 0x02;
    pub(super) const SCHEMA: u8 = 0x03;
    pub(super) const CHANNEL: u8 = 0x04;
    pub(super) const MESSAGE: u8 = 0x05;
    pub(super) const CHUNK: u8 = 0x06;
    pub(super) const MESSAGE_INDEX: u8 = 0x07;
    pub(super) const CHUNK_INDEX: u8 = 0x08;
    pub(super) const ATTACHMENT: u8 = 0x09;
    pub(super) const ATTACHMENT_INDEX: u8 = 0x0A;
    pub(super) const STATISTICS: u8 = 0x0B;
    pub(super) const METADATA: u8 = 0x0C;
    pub(super) const METADATA_INDEX: u8 = 0x0D;
    pub(super) const SUMMARY_OFFSET: u8 = 0x0E;
    pub(super) const DATA_END: u8 = 0x0F;
}

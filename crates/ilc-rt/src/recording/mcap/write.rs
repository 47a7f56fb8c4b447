//! Writing of a file, chunk by chunk: only whole chunks reach it, so that one that is cut off ends between two.

use std::collections::BTreeMap;
use std::io::{self, Write};

use super::crc::crc32;
use super::record::Put;
use super::{MAGIC, op};

/// Size at which a chunk is written, if it is not flushed before.
const CHUNK_BYTES: usize = 1 << 20;

/// A file that is written.
pub(in crate::recording) struct Writer<W> {
    out: W,
    /// Bytes passed on.
    at: u64,
    chunk: Chunk,
    /// Records that the summary repeats: schemas, then channels.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    n_schemas: u16,
    n_channels: u16,
    chunks: Vec<u8>,
    n_chunks: u32,
    attachments: Vec<u8>,
    n_attachments: u32,
    metadata: Vec<u8>,
    n_metadata: u32,
    counts: BTreeMap<u16, u64>,
    span: Option<(u64, u64)>,
}

#[derive(Default)]
struct Chunk {
    records: Vec<u8>,
    span: Option<(u64, u64)>,
    /// Time and place of the messages of each channel.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
}

/// Returns the span with a time.
fn with(span: Option<(u64, u64)>, time: u64) -> (u64, u64) {
    span.map_or((time, time), |(first, last)| (first.min(time), last.max(time)))
}

/// Appends a record.
fn record(out: &mut Vec<u8>, kind: u8, content: &[u8]) {
    out.u8(kind);
    out.u64(content.len() as u64);
    out.extend_from_slice(content);
}

impl<W: Write> Writer<W> {
    /// Begins a file.
    pub(in crate::recording) fn new(out: W, profile: &str, library: &str) -> io::Result<Self> {
        let mut writer = Self {
            out,
            at: 0,
            chunk: Chunk::default(),
            schemas: Vec::new(),
            channels: Vec::new(),
            n_schemas: 0,
            n_channels: 0,
            chunks: Vec::new(),
            n_chunks: 0,
            attachments: Vec::new(),
            n_attachments: 0,
            metadata: Vec::new(),
            n_metadata: 0,
            counts: BTreeMap::new(),
            span: None,
        };
        writer.pass(&MAGIC)?;
        let mut header = Vec::new();
        header.text(profile);
        header.text(library);
        writer.write_record(op::HEADER, &header)?;
        Ok(writer)
    }

    /// Returns the bytes of the file so far, with those that wait.
    pub(in crate::recording) fn n_bytes(&self) -> u64 {
        self.at + self.chunk.records.len() as u64
    }

    fn pass(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    fn write_record(&mut self, kind: u8, content: &[u8]) -> io::Result<()> {
        let mut bytes = Vec::with_capacity(content.len() + 9);
        record(&mut bytes, kind, content);
        self.pass(&bytes)
    }

    /// Adds a channel of JSON messages with a schema; returns its number.
    pub(in crate::recording) fn add_channel(
        &mut self,
        topic: &str,
        (name, schema): (&str, &str),
    ) -> io::Result<u16> {
        self.n_schemas += 1;
        let mut content = Vec::new();
        content.u16(self.n_schemas);
        content.text(name);
        content.text("jsonschema");
        content.block(schema.as_bytes());
        record(&mut self.schemas, op::SCHEMA, &content);
        self.write_record(op::SCHEMA, &content)?;
        let id = self.n_channels;
        self.n_channels += 1;
        let mut content = Vec::new();
        content.u16(id);
        content.u16(self.n_schemas);
        content.text(topic);
        content.text("json");
        // No metadata.
        content.u32(0);
        record(&mut self.channels, op::CHANNEL, &content);
        self.write_record(op::CHANNEL, &content)?;
        Ok(id)
    }

    /// Writes a message.
    pub(in crate::recording) fn message(
        &mut self,
        channel: u16,
        sequence: u32,
        log_time: u64,
        data: &[u8],
    ) -> io::Result<()> {
        let chunk = &mut self.chunk;
        let place = chunk.records.len() as u64;
        chunk.records.u8(op::MESSAGE);
        chunk.records.u64(data.len() as u64 + 22);
        chunk.records.u16(channel);
        chunk.records.u32(sequence);
        chunk.records.u64(log_time);
        chunk.records.u64(log_time);
        chunk.records.extend_from_slice(data);
        chunk.span = Some(with(chunk.span, log_time));
        chunk.index.entry(channel).or_default().push((log_time, place));
        self.span = Some(with(self.span, log_time));
        *self.counts.entry(channel).or_default() += 1;
        if self.chunk.records.len() >= CHUNK_BYTES { self.end_chunk() } else { Ok(()) }
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        let Chunk { records, span, index } = std::mem::take(&mut self.chunk);
        let Some((first, last)) = span else { return Ok(()) };
        let began = self.at;
        let n_bytes = records.len() as u64;
        let mut content = Vec::with_capacity(records.len() + 40);
        for value in [first, last, n_bytes] {
            content.u64(value);
        }
        content.u32(crc32(&records));
        content.text("");
        content.u64(n_bytes);
        content.extend_from_slice(&records);
        self.write_record(op::CHUNK, &content)?;
        let ended = self.at;
        let mut places = Vec::new();
        for (channel, messages) in &index {
            places.u16(*channel);
            places.u64(self.at);
            let mut content = Vec::with_capacity(16 * messages.len() + 6);
            content.u16(*channel);
            content.u32(u32::try_from(16 * messages.len()).unwrap_or(u32::MAX));
            for (time, place) in messages {
                content.u64(*time);
                content.u64(*place);
            }
            self.write_record(op::MESSAGE_INDEX, &content)?;
        }
        let mut content = Vec::new();
        for value in [first, last, began, ended - began] {
            content.u64(value);
        }
        content.block(&places);
        content.u64(self.at - ended);
        content.text("");
        content.u64(n_bytes);
        content.u64(n_bytes);
        record(&mut self.chunks, op::CHUNK_INDEX, &content);
        self.n_chunks += 1;
        Ok(())
    }

    /// Writes an attachment.
    pub(in crate::recording) fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        data: &[u8],
    ) -> io::Result<()> {
        self.end_chunk()?;
        let began = self.at;
        let mut content = Vec::with_capacity(data.len() + 64);
        // Without times.
        content.u64(0);
        content.u64(0);
        content.text(name);
        content.text(media_type);
        content.u64(data.len() as u64);
        content.extend_from_slice(data);
        content.u32(crc32(&content));
        self.write_record(op::ATTACHMENT, &content)?;
        let mut content = Vec::new();
        for value in [began, self.at - began, 0, 0, data.len() as u64] {
            content.u64(value);
        }
        content.text(name);
        content.text(media_type);
        record(&mut self.attachments, op::ATTACHMENT_INDEX, &content);
        self.n_attachments += 1;
        Ok(())
    }

    /// Writes named texts.
    pub(in crate::recording) fn metadata(
        &mut self,
        name: &str,
        fields: &[(&str, String)],
    ) -> io::Result<()> {
        self.end_chunk()?;
        let began = self.at;
        let mut inner = Vec::new();
        for (key, value) in fields {
            inner.text(key);
            inner.text(value);
        }
        let mut content = Vec::new();
        content.text(name);
        content.block(&inner);
        self.write_record(op::METADATA, &content)?;
        let mut content = Vec::new();
        content.u64(began);
        content.u64(self.at - began);
        content.text(name);
        record(&mut self.metadata, op::METADATA_INDEX, &content);
        self.n_metadata += 1;
        Ok(())
    }

    /// Passes everything to the system.
    pub(in crate::recording) fn flush(&mut self) -> io::Result<()> {
        self.end_chunk()?;
        self.out.flush()
    }

    /// Ends the file, with its summary.
    pub(in crate::recording) fn finish(mut self) -> io::Result<()> {
        self.end_chunk()?;
        let mut end = Vec::new();
        end.u32(0);
        self.write_record(op::DATA_END, &end)?;
        let began = self.at;
        let mut summary = Vec::new();
        let mut offsets = Vec::new();
        let groups = [
            (op::SCHEMA, std::mem::take(&mut self.schemas)),
            (op::CHANNEL, std::mem::take(&mut self.channels)),
            (op::STATISTICS, self.statistics()),
            (op::CHUNK_INDEX, std::mem::take(&mut self.chunks)),
            (op::ATTACHMENT_INDEX, std::mem::take(&mut self.attachments)),
            (op::METADATA_INDEX, std::mem::take(&mut self.metadata)),
        ];
        for (kind, bytes) in groups {
            if bytes.is_empty() {
                continue;
            }
            let mut content = Vec::new();
            content.u8(kind);
            content.u64(began + summary.len() as u64);
            content.u64(bytes.len() as u64);
            record(&mut offsets, op::SUMMARY_OFFSET, &content);
            summary.extend_from_slice(&bytes);
        }
        let offsets_at = began + summary.len() as u64;
        summary.extend_from_slice(&offsets);
        // The checksum covers the footer up to itself.
        summary.u8(op::FOOTER);
        summary.u64(20);
        summary.u64(began);
        summary.u64(offsets_at);
        summary.u32(crc32(&summary));
        self.pass(&summary)?;
        self.pass(&MAGIC)?;
        self.out.flush()
    }

    fn statistics(&self) -> Vec<u8> {
        let (first, last) = self.span.unwrap_or_default();
        let mut content = Vec::new();
        content.u64(self.counts.values().sum());
        content.u16(self.n_schemas);
        content.u32(u32::from(self.n_channels));
        for value in [self.n_attachments, self.n_metadata, self.n_chunks] {
            content.u32(value);
        }
        content.u64(first);
        content.u64(last);
        let mut counts = Vec::new();
        for (channel, count) in &self.counts {
            counts.u16(*channel);
            counts.u64(*count);
        }
        content.block(&counts);
        let mut bytes = Vec::new();
        record(&mut bytes, op::STATISTICS, &content);
        bytes
    }
}

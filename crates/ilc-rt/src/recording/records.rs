//! Reading of an MCAP file record by record, into its chunks; one that is cut off is read as far as it is whole.
//!
//! The library reads the format; two checks are ours, as a damaged file must be refused and never end the program. A
//! chunk is compared with its checksum as a whole and then read on its own, since the library counts on no record
//! being longer than its chunk; and the length of an attachment is checked before the library takes it apart.

use std::borrow::Cow;
use std::io::{ErrorKind, Read};

use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError, parse_record};

/// Longest record, or chunk, that is read.
const RECORD_BYTES_MAX: usize = 1 << 28;
/// Bytes that are read at a time: memory follows what a file has, not what it claims.
const READ_BYTES: usize = 1 << 16;

/// The records of a file.
pub(super) struct Records<R> {
    source: R,
    file: LinearReader,
    /// Rest of the chunk that is read.
    chunk: Option<LinearReader>,
    /// Bytes of the file read so far.
    n_bytes: usize,
    is_over: bool,
    was_cut: bool,
}

/// Result of a step of a reader.
enum Step {
    /// It needs more bytes.
    Needs,
    Record(Record<'static>),
    End,
    /// The bytes end within a record.
    Cut,
}

impl<R: Read> Records<R> {
    pub(super) fn new(source: R) -> Self {
        Self {
            source,
            file: LinearReader::new_with_options(options()),
            chunk: None,
            n_bytes: 0,
            is_over: false,
            was_cut: false,
        }
    }

    /// Returns whether the file ended in the middle.
    pub(super) fn was_cut(&self) -> bool {
        self.was_cut
    }

    /// Returns the next record; `None` at the end, which may be a cut.
    ///
    /// # Errors
    /// A few words on what is damaged.
    pub(super) fn next_record(&mut self) -> Result<Option<Record<'static>>, String> {
        while !self.is_over {
            if let Some(chunk) = &mut self.chunk {
                match step(chunk)? {
                    // All of its bytes are there already.
                    Step::Needs => chunk.notify_read(0),
                    Step::Record(record) => return Ok(Some(record)),
                    Step::End => self.chunk = None,
                    Step::Cut => return Err("a chunk ends within a record".to_owned()),
                }
                continue;
            }
            match step(&mut self.file)? {
                Step::Needs => self.fill()?,
                Step::Record(Record::Chunk { header, data }) => {
                    self.chunk = Some(opened(&header, &data)?);
                }
                Step::Record(record) if record.opcode() == op::FOOTER => self.is_over = true,
                Step::Record(record) => return Ok(Some(record)),
                Step::Cut if self.n_bytes < MAGIC.len() => return Err(said(&McapError::BadMagic)),
                Step::Cut => (self.is_over, self.was_cut) = (true, true),
                Step::End => self.is_over = true,
            }
        }
        Ok(None)
    }

    /// Reads more of the file.
    fn fill(&mut self) -> Result<(), String> {
        let n_bytes = loop {
            match self.source.read(self.file.insert(READ_BYTES)) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                read => break read.map_err(|error| error.to_string())?,
            }
        };
        self.n_bytes = self.n_bytes.saturating_add(n_bytes);
        self.file.notify_read(n_bytes);
        Ok(())
    }
}

fn options() -> LinearReaderOptions {
    LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(RECORD_BYTES_MAX)
}

/// Returns the reader of the records of a chunk.
fn opened(header: &ChunkHeader, records: &[u8]) -> Result<LinearReader, String> {
    if !header.compression.is_empty() {
        let by = header.compression.escape_default();
        return Err(format!("a chunk compressed by {by}, which ilc-rt does not write"));
    }
    if header.uncompressed_size != records.len() as u64 {
        return Err("a chunk has another length than it tells".to_owned());
    }
    if header.uncompressed_crc != 0 && header.uncompressed_crc != crc32fast::hash(records) {
        return Err("a chunk is damaged: its checksum differs".to_owned());
    }
    let within = options().with_skip_start_magic(true).with_skip_end_magic(true);
    let mut reader = LinearReader::new_with_options(within);
    reader.insert(records.len()).copy_from_slice(records);
    reader.notify_read(records.len());
    Ok(reader)
}

fn step(reader: &mut LinearReader) -> Result<Step, String> {
    match reader.next_event() {
        None => Ok(Step::End),
        Some(Ok(LinearReadEvent::ReadRequest(_))) => Ok(Step::Needs),
        Some(Ok(LinearReadEvent::Record { opcode, data })) => {
            parsed(opcode, data).map(Step::Record)
        }
        Some(Err(McapError::UnexpectedEof)) => Ok(Step::Cut),
        Some(Err(error)) => Err(said(&error)),
    }
}

/// Returns a record; what a reader of recordings skips is not taken apart.
fn parsed(opcode: u8, content: &[u8]) -> Result<Record<'static>, String> {
    match opcode {
        op::ATTACHMENT if attachment_bytes_min(content) > Some(content.len()) => {
            Err("an attachment ends too early".to_owned())
        }
        op::CHANNEL | op::MESSAGE | op::CHUNK | op::ATTACHMENT | op::METADATA => {
            let record = parse_record(opcode, content).map_err(|error| said(&error))?;
            Ok(record.into_owned())
        }
        _ => Ok(Record::Unknown { opcode, data: Cow::Borrowed(&[]) }),
    }
}

/// Returns the length of an attachment without its data: two times, two texts, a length, a checksum; `None` if its texts
/// are cut off, which the library notices.
fn attachment_bytes_min(content: &[u8]) -> Option<usize> {
    let after_text = |at: usize| {
        let text = at.checked_add(4)?;
        let n_bytes = u32::from_le_bytes(content.get(at..text)?.try_into().ok()?);
        text.checked_add(n_bytes as usize)
    };
    after_text(after_text(16)?)?.checked_add(8 + 4)
}

/// Returns a few words on what is damaged.
fn said(error: &McapError) -> String {
    match error {
        McapError::BadMagic => "it does not begin as an MCAP file does".to_owned(),
        McapError::BadAttachmentCrc { .. } => {
            "an attachment is damaged: its checksum differs".to_owned()
        }
        McapError::RecordTooLarge { len, .. } => {
            format!("a record of {len} bytes; at most {RECORD_BYTES_MAX} are read")
        }
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests;

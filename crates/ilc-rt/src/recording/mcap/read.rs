//! Reading of a file record by record, into its chunks; one that is cut off is read as far as it is whole.

use std::io::{self, Read};

use super::crc::crc32;
use super::record::{Record, Take};
use super::{MAGIC, op};

/// Longest record, or chunk, that is read.
const RECORD_BYTES_MAX: u64 = 1 << 28;

/// The records of a file.
pub(in crate::recording) struct Records<R> {
    source: R,
    /// Rest of the chunk that is read, and the place in it.
    chunk: Vec<u8>,
    at: usize,
    has_begun: bool,
    is_over: bool,
    was_cut: bool,
}

impl<R: Read> Records<R> {
    pub(in crate::recording) fn new(source: R) -> Self {
        Self { source, chunk: Vec::new(), at: 0, has_begun: false, is_over: false, was_cut: false }
    }

    /// Returns whether the file ended in the middle.
    pub(in crate::recording) fn was_cut(&self) -> bool {
        self.was_cut
    }

    /// Returns the next record; `None` at the end, which may be a cut.
    ///
    /// # Errors
    /// A few words on what is damaged.
    pub(in crate::recording) fn next_record(&mut self) -> Result<Option<Record>, String> {
        loop {
            if self.at < self.chunk.len() {
                return self.in_chunk().map(Some);
            }
            if self.is_over {
                return Ok(None);
            }
            let Some((kind, content)) = self.on_top()? else {
                self.is_over = true;
                return Ok(None);
            };
            match kind {
                op::FOOTER => self.is_over = true,
                op::CHUNK => self.open(&content)?,
                kind => return Record::parse(kind, &content).map(Some),
            }
        }
    }

    /// Returns the next record of the chunk.
    fn in_chunk(&mut self) -> Result<Record, String> {
        let mut rest = Take(&self.chunk[self.at..]);
        let kind = rest.bytes(1)?[0];
        let n_bytes = usize::try_from(rest.u64()?).map_err(|error| error.to_string())?;
        let content = rest.bytes(n_bytes)?;
        let record = Record::parse(kind, content)?;
        self.at = self.chunk.len() - rest.0.len();
        Ok(record)
    }

    /// Opens a chunk.
    fn open(&mut self, content: &[u8]) -> Result<(), String> {
        let mut rest = Take(content);
        rest.bytes(16)?;
        let n_bytes = rest.u64()?;
        let crc = rest.u32()?;
        let compression = rest.text()?;
        if !compression.is_empty() {
            return Err(format!(
                "a chunk compressed by {compression}, which ilc-rt does not write"
            ));
        }
        let records = rest.bytes(8).map(|_| rest.0)?;
        if records.len() as u64 != n_bytes {
            return Err("a chunk has another length than it tells".to_owned());
        }
        if crc != 0 && crc != crc32(records) {
            return Err("a chunk is damaged: its checksum differs".to_owned());
        }
        (self.chunk, self.at) = (records.to_vec(), 0);
        Ok(())
    }

    /// Returns the next record outside of chunks; `None` at a cut.
    fn on_top(&mut self) -> Result<Option<(u8, Vec<u8>)>, String> {
        if !self.has_begun {
            let magic = self.fill(MAGIC.len() as u64)?;
            if magic.as_deref() != Some(&MAGIC[..]) {
                return Err("it does not begin as an MCAP file does".to_owned());
            }
            self.has_begun = true;
        }
        let Some(head) = self.fill(9)? else { return Ok(None) };
        let mut rest = Take(&head);
        let kind = rest.bytes(1)?[0];
        let n_bytes = rest.u64()?;
        if n_bytes > RECORD_BYTES_MAX {
            return Err(format!(
                "a record of {n_bytes} bytes; at most {RECORD_BYTES_MAX} are read"
            ));
        }
        Ok(self.fill(n_bytes)?.map(|content| (kind, content)))
    }

    /// Returns so many bytes; `None` if the file ends before.
    fn fill(&mut self, n_bytes: u64) -> Result<Option<Vec<u8>>, String> {
        let mut bytes = Vec::new();
        let read = self.source.by_ref().take(n_bytes).read_to_end(&mut bytes);
        read.map_err(|error: io::Error| error.to_string())?;
        if (bytes.len() as u64) < n_bytes {
            self.was_cut = true;
            return Ok(None);
        }
        Ok(Some(bytes))
    }
}

//! Reading of recordings, item by item; what was written before a program was killed is read as well.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::records::Record;
use serde::Deserialize;
use serde_json::Value;

use super::error::RecordingError;
use super::file::{CELL, PROGRAM, SETUP};
use super::message::{AxisMessage, CycleMessage, FramesMessage, TableMessage, TimingMessage};
use super::records::Records;
use super::setup::{LoopSetup, VERSION};
use crate::config::Cell;
use crate::record::{TEXT_MAX, fingerprint, printable};

/// An item of a recording, with its time since the epoch in ns where it has one.
#[derive(Clone, Debug)]
pub enum Item {
    /// A loop begins.
    Loop(Box<(LoopSetup, Cell)>),
    /// An input table.
    Table(TableMessage),
    /// The traffic of a tick, before its cycle.
    Frames(u64, FramesMessage),
    /// The loop in a tick, before its axes.
    Cycle(u64, CycleMessage),
    /// The axis of this name in a tick.
    Axis(String, AxisMessage),
    /// Stages of a tick.
    Timing(TimingMessage),
    /// An event.
    Event(Value),
}

/// A recording that is read.
pub struct Reader<R> {
    path: PathBuf,
    stream: Records<R>,
    channels: BTreeMap<u16, String>,
    cell: Option<String>,
    program: Vec<u8>,
    n_lost: Option<u64>,
}

impl<R> std::fmt::Debug for Reader<R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reader").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Reader<BufReader<File>> {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`RecordingError::Read`].
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let refused = |reason: String| RecordingError::Read { path: path.to_owned(), reason };
        let file = File::open(path).map_err(|error| refused(error.to_string()))?;
        if !file.metadata().is_ok_and(|known| known.is_file()) {
            return Err(refused("not a regular file".to_owned()));
        }
        Ok(Self::new(BufReader::with_capacity(1 << 16, file), path))
    }
}

impl<R: Read> Reader<R> {
    /// Reads a recording from its bytes; `path` names it in errors.
    pub fn new(source: R, path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            stream: Records::new(source),
            channels: BTreeMap::new(),
            cell: None,
            program: Vec::new(),
            n_lost: None,
        }
    }

    /// Returns whether the file ended in the middle, after the last item.
    pub fn was_cut(&self) -> bool {
        self.stream.was_cut()
    }

    /// Returns the number of records that were lost, which the end of a recording tells.
    pub fn n_lost(&self) -> Option<u64> {
        self.n_lost
    }

    fn damaged(&self, what: impl AsRef<str>) -> RecordingError {
        let what = printable(what.as_ref(), TEXT_MAX);
        RecordingError::NotARecording { path: self.path.clone(), what }
    }

    /// Returns the next item; `None` at the end.
    ///
    /// # Errors
    /// [`RecordingError::NotARecording`] for what no recording has, and for a cell description that was changed.
    pub fn next_item(&mut self) -> Result<Option<Item>, RecordingError> {
        loop {
            let Some(record) = self.stream.next_record().map_err(|what| self.damaged(what))? else {
                return Ok(None);
            };
            match record {
                Record::Channel(channel) => {
                    self.channels.insert(channel.id, channel.topic);
                }
                Record::Attachment { header, data, .. } => {
                    if let Some(item) = self.attachment(&header.name, &data)? {
                        return Ok(Some(item));
                    }
                }
                Record::Metadata(end) if end.name == "end" => {
                    self.n_lost = end.metadata.get("lost").and_then(|text| text.parse().ok());
                }
                Record::Message { header, data } => {
                    if let Some(item) = self.message(header.channel_id, header.log_time, &data)? {
                        return Ok(Some(item));
                    }
                }
                _ => {}
            }
        }
    }

    fn attachment(&mut self, name: &str, data: &[u8]) -> Result<Option<Item>, RecordingError> {
        match name {
            CELL => {
                let text = String::from_utf8(data.to_vec());
                self.cell = Some(text.map_err(|_| self.damaged(format!("{CELL} is not UTF-8")))?);
            }
            PROGRAM => self.program = data.to_vec(),
            SETUP => {
                let setup = self.read::<LoopSetup>(SETUP, data)?;
                return self.begin(setup).map(Some);
            }
            _ => {}
        }
        Ok(None)
    }

    fn begin(&mut self, setup: LoopSetup) -> Result<Item, RecordingError> {
        if setup.version > VERSION {
            return Err(self.damaged(format!(
                "version {} is newer than {VERSION}, which this program reads",
                setup.version
            )));
        }
        let text = self.cell.take().ok_or_else(|| self.damaged(format!("{CELL} is missing")))?;
        let program = std::mem::take(&mut self.program);
        if cell_digest(&text, &program) != setup.cell_digest {
            return Err(self.damaged("its cell description was changed after it was recorded"));
        }
        let place = format!("{}:{CELL}", self.path.display());
        let mut cell =
            Cell::parse(&text, &place).map_err(|error| self.damaged(error.to_string()))?;
        cell.program_text = Some(program);
        Ok(Item::Loop(Box::new((setup, cell))))
    }

    fn message(&self, channel: u16, at: u64, data: &[u8]) -> Result<Option<Item>, RecordingError> {
        let Some(topic) = self.channels.get(&channel) else {
            return Err(self.damaged(format!("a message of channel {channel}, which is unknown")));
        };
        Ok(Some(match topic.as_str() {
            "/cycle" => Item::Cycle(at, self.read(topic, data)?),
            "/frames" => Item::Frames(at, self.read(topic, data)?),
            "/tables" => Item::Table(self.read(topic, data)?),
            "/timing" => Item::Timing(self.read(topic, data)?),
            "/events" | "/iterations" => Item::Event(self.read(topic, data)?),
            _ => match topic.strip_prefix("/axes/") {
                Some(name) => Item::Axis(name.to_owned(), self.read(topic, data)?),
                None => return Ok(None),
            },
        }))
    }

    fn read<'a, T: Deserialize<'a>>(
        &self,
        what: &str,
        data: &'a [u8],
    ) -> Result<T, RecordingError> {
        serde_json::from_slice(data).map_err(|error| self.damaged(format!("{what}: {error}")))
    }
}

/// Returns the digest of a cell description and of the file of its program.
pub(crate) fn cell_digest(cell: &str, program: &[u8]) -> String {
    let program = program.iter().fold(String::with_capacity(2 * program.len()), |text, byte| {
        use std::fmt::Write as _;
        let mut text = text;
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    });
    fingerprint(&format!("{cell}\0{program}"))
}

//! The file of a recording, while it is written: its channels, and messages as JSON.
//!
//! Only whole chunks reach it, each with at least one message: a file that is cut off ends between two, and no chunk
//! without a time makes viewers begin in 1970.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions, Writer};
use serde::Serialize;

use super::message::axis_topic;
use super::schema::{self, AXIS, CYCLE, EVENT, FRAMES, TABLE, TIMING};
use crate::rt::Nanos;

/// Name of the attachment with the description of the loop.
pub(super) const SETUP: &str = "loop.json";
/// Name of the attachment with the cell description as it was applied.
pub(super) const CELL: &str = "cell.toml";
/// Name of the attachment with the file of its program.
pub(super) const PROGRAM: &str = "program";

/// A channel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Topic {
    Cycle,
    Frames,
    Tables,
    Timing,
    Events,
    Iterations,
    /// The axis of this place.
    Axis(usize),
}

/// Number of channels that every recording has.
const N_SHARED: usize = 6;
/// Size at which a chunk is written, if it is not flushed before.
const CHUNK_BYTES: u64 = 1 << 20;
/// Bytes of a message beside its text: kind, length and header, and its place in the index of its chunk.
const MESSAGE_BYTES: u64 = 9 + 22 + 16;

/// The file.
pub(super) struct RecordFile {
    writer: Writer<NoSeek<BufWriter<File>>>,
    axes: Vec<String>,
    /// Numbers of the channels, and of their messages so far; those of the axes come last. Empty before the first
    /// message.
    channels: Vec<(u16, u32)>,
    n_bytes: u64,
    text: Vec<u8>,
}

/// Returns the error of the system, without what the library says around it.
fn of_system(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl RecordFile {
    /// Begins a file with channels for these axes.
    pub(super) fn begin(file: File, axes: &[String]) -> io::Result<Self> {
        let library = concat!("ilc-rt ", env!("CARGO_PKG_VERSION"));
        // A chunk waits in memory until it is whole, as without seeking its head cannot be written later.
        let options = WriteOptions::new()
            .profile("ilc-rt")
            .library(library)
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true);
        let writer = options.create(NoSeek::new(BufWriter::new(file))).map_err(of_system)?;
        Ok(Self { writer, axes: axes.to_vec(), channels: Vec::new(), n_bytes: 0, text: Vec::new() })
    }

    /// Adds the channels, to the chunk of the first message.
    fn add_channels(&mut self) -> Result<(), McapError> {
        let shared = [
            ("/cycle", CYCLE),
            ("/frames", FRAMES),
            ("/tables", TABLE),
            ("/timing", TIMING),
            ("/events", EVENT),
            ("/iterations", EVENT),
        ];
        let shared = shared.map(|(topic, of)| (topic.to_owned(), of));
        let axes = self.axes.iter().map(|name| (axis_topic(name), AXIS));
        for (topic, (name, fields)) in shared.into_iter().chain(axes) {
            let text = schema::text(fields);
            let schema = self.writer.add_schema(name, "jsonschema", text.as_bytes())?;
            let id = self.writer.add_channel(schema, &topic, "json", &BTreeMap::new())?;
            self.channels.push((id, 0));
        }
        Ok(())
    }

    /// Writes a message of a time.
    pub(super) fn write(
        &mut self,
        topic: Topic,
        at: Nanos,
        message: &impl Serialize,
    ) -> io::Result<()> {
        let place = match topic {
            Topic::Cycle => 0,
            Topic::Frames => 1,
            Topic::Tables => 2,
            Topic::Timing => 3,
            Topic::Events => 4,
            Topic::Iterations => 5,
            Topic::Axis(axis) => N_SHARED + axis,
        };
        if self.channels.is_empty() {
            self.add_channels().map_err(of_system)?;
        }
        let Some((channel, count)) = self.channels.get_mut(place) else { return Ok(()) };
        self.text.clear();
        serde_json::to_writer(&mut self.text, message)?;
        let header = MessageHeader {
            channel_id: *channel,
            sequence: *count,
            log_time: at.0,
            publish_time: at.0,
        };
        *count = count.wrapping_add(1);
        self.n_bytes += self.text.len() as u64 + MESSAGE_BYTES;
        self.writer.write_to_known_channel(&header, &self.text).map_err(of_system)
    }

    /// Writes an attachment.
    pub(super) fn attach(&mut self, name: &str, kind: &str, data: &[u8]) -> io::Result<()> {
        self.n_bytes += data.len() as u64;
        let attachment = Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: kind.to_owned(),
            data: Cow::Borrowed(data),
        };
        self.writer.attach(&attachment).map_err(of_system)
    }

    /// Returns the bytes of messages and attachments so far, with those that wait.
    pub(super) fn n_bytes(&self) -> u64 {
        self.n_bytes
    }

    /// Passes everything to the system: it is kept even if this program is killed.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(of_system)
    }

    /// Ends the file, with its index and the number of records that were lost.
    pub(super) fn end(mut self, lost: u64) -> io::Result<()> {
        let fields = BTreeMap::from([("lost".to_owned(), lost.to_string())]);
        let end = Metadata { name: "end".to_owned(), metadata: fields };
        match self.writer.write_metadata(&end) {
            Ok(()) => self.writer.finish().map(drop).map_err(of_system),
            Err(error) => {
                self.abandon();
                Err(of_system(error))
            }
        }
    }

    /// Leaves the file as it is, cut off: a writer that is dropped would try to end it as if it were whole.
    pub(super) fn abandon(self) {
        drop(self.writer.into_inner());
    }
}

#[cfg(test)]
mod tests;

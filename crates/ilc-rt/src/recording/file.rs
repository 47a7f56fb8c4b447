//! The file of a recording, while it is written: its channels, and messages as JSON.

use std::fs::File;
use std::io::{self, BufWriter};

use serde::Serialize;

use super::mcap::Writer;
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

/// The file.
pub(super) struct RecordFile {
    writer: Writer<BufWriter<File>>,
    /// Numbers of the channels, and of their messages so far; those of the axes come last.
    channels: Vec<(u16, u32)>,
    text: Vec<u8>,
}

impl RecordFile {
    /// Begins a file with its channels.
    pub(super) fn begin(file: File, axes: &[String]) -> io::Result<Self> {
        let library = concat!("ilc-rt ", env!("CARGO_PKG_VERSION"));
        let mut writer = Writer::new(BufWriter::new(file), "ilc-rt", library)?;
        let shared = [
            ("/cycle", CYCLE),
            ("/frames", FRAMES),
            ("/tables", TABLE),
            ("/timing", TIMING),
            ("/events", EVENT),
            ("/iterations", EVENT),
        ];
        let axes = axes.iter().map(|name| (axis_topic(name), AXIS));
        let mut channels = Vec::new();
        for (topic, (name, fields)) in
            shared.map(|(topic, of)| (topic.to_owned(), of)).into_iter().chain(axes)
        {
            channels.push((writer.add_channel(&topic, (name, &schema::text(fields)))?, 0));
        }
        Ok(Self { writer, channels, text: Vec::new() })
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
        let Some((channel, count)) = self.channels.get_mut(place) else { return Ok(()) };
        self.text.clear();
        serde_json::to_writer(&mut self.text, message)?;
        let sequence = *count;
        *count = count.wrapping_add(1);
        self.writer.message(*channel, sequence, at.0, &self.text)
    }

    /// Writes an attachment.
    pub(super) fn attach(&mut self, name: &str, kind: &str, data: &[u8]) -> io::Result<()> {
        self.writer.attach(name, kind, data)
    }

    /// Returns the bytes of the file so far.
    pub(super) fn n_bytes(&self) -> u64 {
        self.writer.n_bytes()
    }

    /// Passes everything to the system: it is kept even if this program is killed.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }

    /// Ends the file, with its index and the number of records that were lost.
    pub(super) fn end(mut self, lost: u64) -> io::Result<()> {
        self.writer.metadata("end", &[("lost", lost.to_string())])?;
        self.writer.finish()
    }
}

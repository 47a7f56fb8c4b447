//! Recordings: every tick of a session at full rate in one MCAP file, and back.
//!
//! **Every message is JSON** with a schema, so that Foxglove and `PlotJuggler` read a recording as it is, and a person
//! does. It is exact nevertheless: frames are hexadecimal, and a float in its shortest decimal form reads back bit for
//! bit; what JSON has no number for is a word (`"NaN"`). So the messages that are plotted are those that a replay
//! compares with, and there is no second, binary truth. The price is size, about 1 kB per tick of two axes.
//!
//! The loop hands over records of a fixed size ([`crate::servo::Tap`], [`crate::fieldbus::transport::TappedBus`]);
//! [`Recorder`] turns them into messages, on its own thread in real time. Imported by `campaign`, which records and
//! replays, and by `cli`.

mod convert;
mod error;
mod exact;
mod file;
mod folder;
mod message;
mod notation;
mod reader;
mod recorder;
mod records;
mod schema;
mod setup;

pub use convert::stamps_of;
pub use error::RecordingError;
pub use folder::{SUFFIX, is_folder};
pub(crate) use message::column_digest;
pub use message::{
    AxisMessage, CycleMessage, FramesMessage, TableMessage, TimingMessage, axis_topic,
};
pub use notation::{Traffic, frame_text, read_event};
pub(crate) use reader::cell_digest;
pub use reader::{Item, Reader};
pub use recorder::{Notes, Place, Recorder, Taps};
pub use setup::{LoopSetup, MapText, VERSION};

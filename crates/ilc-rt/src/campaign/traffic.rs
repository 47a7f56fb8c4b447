//! The frames of a recording in the formats of CAN tools.
//!
//! Sources: `candump -L` of can-utils, with the direction of `-x`; the ASC format as python-can reads and writes it.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::config::Cell;
use crate::fieldbus::Frame;
use crate::fieldbus::frame::PAYLOAD_MAX;
use crate::fieldbus::transport::BusEvent;
use crate::record::{TEXT_MAX, printable};
use crate::recording::{Item, Reader, RecordingError, Traffic, read_event};

/// Name of the interface of a cell that is not on a CAN interface.
const SOME_INTERFACE: &str = "vcan0";
/// Lengths of CAN FD frames above 8 bytes, by their code from 9.
const FD_LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];

/// A format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrafficFormat {
    /// A table: time, cycle, direction, interface, identifier, data.
    Csv,
    /// The log of `candump -L`.
    Candump,
    /// The log of Vector tools.
    Asc,
}

/// A frame with its place and time.
struct Seen<'a> {
    at_ns: u64,
    cycle: u64,
    traffic: Traffic,
    frame: Frame,
    interface: &'a str,
    bus: usize,
}

/// Writes the frames of a recording into a file; returns their number.
///
/// # Errors
/// [`RecordingError`] if one cannot be read or the other not written.
pub fn export(path: &Path, format: TrafficFormat, to: &Path) -> Result<u64, RecordingError> {
    let failed = |error: std::io::Error| RecordingError::Create {
        path: to.to_owned(),
        reason: error.to_string(),
    };
    let mut reader = Reader::open(path)?;
    let mut out = BufWriter::new(File::create(to).map_err(failed)?);
    head(format, &mut out).map_err(failed)?;
    let mut cell: Option<Cell> = None;
    let mut began = None;
    let mut n_frames = 0;
    while let Some(item) = reader.next_item()? {
        let (at_ns, frames) = match item {
            Item::Loop(parts) => {
                cell = Some(parts.1);
                continue;
            }
            Item::Frames(at_ns, frames) => (at_ns, frames),
            _ => continue,
        };
        let began_ns = *began.get_or_insert(at_ns);
        let received = frames.received.iter().zip(times(&frames.received_ns));
        let sent = frames.sent.iter().zip(times(&frames.sent_ns));
        let of = |traffic| move |(text, ns)| (traffic, text, ns);
        let all = received.map(of(Traffic::Received)).chain(sent.map(of(Traffic::Sent)));
        for (traffic, text, after_ns) in all {
            let frame = match read_event(traffic, text) {
                Some(BusEvent::Received(frame) | BusEvent::Sent(frame)) => frame,
                // What was refused was not on the bus.
                Some(BusEvent::Refused(..) | BusEvent::Failed(_)) => continue,
                None => {
                    let text = printable(text, TEXT_MAX);
                    let what = format!("cycle {}: `{text}` is no frame", frames.cycle);
                    return Err(RecordingError::NotARecording { path: path.to_owned(), what });
                }
            };
            let (interface, bus) = place(cell.as_ref(), frame.id());
            let at_ns = at_ns.saturating_add_signed(after_ns);
            let cycle = frames.cycle;
            let seen = Seen { at_ns, cycle, traffic, frame, interface, bus };
            line(format, &seen, began_ns, &mut out).map_err(failed)?;
            n_frames += 1;
        }
    }
    if format == TrafficFormat::Asc {
        writeln!(out, "End TriggerBlock").map_err(failed)?;
    }
    out.flush().map_err(failed)?;
    Ok(n_frames)
}

/// Returns the times, followed by zeros without end, as a recording in lock-step has no times.
fn times(times: &[i64]) -> impl Iterator<Item = i64> {
    times.iter().copied().chain(std::iter::repeat(0))
}

/// Returns the interface and the number of the bus on which a frame is.
fn place(cell: Option<&Cell>, id: u16) -> (&str, usize) {
    let Some(cell) = cell else { return (SOME_INTERFACE, 0) };
    let node = u8::try_from(id & 0x7F).unwrap_or_default();
    let bus = cell.axes.iter().find(|axis| axis.node == node).map_or(0, |axis| axis.bus);
    let address = &cell.bus(bus).address;
    let name = address.strip_prefix("can:").map(|rest| rest.split('?').next().unwrap_or(rest));
    (name.unwrap_or(SOME_INTERFACE), usize::from(bus))
}

fn head(format: TrafficFormat, out: &mut impl Write) -> std::io::Result<()> {
    match format {
        TrafficFormat::Csv => writeln!(out, "time_s,cycle,direction,interface,id,data"),
        TrafficFormat::Candump => Ok(()),
        TrafficFormat::Asc => {
            let date = "Thu Jan  1 12:00:00.000 am 1970";
            writeln!(out, "date {date}\nbase hex  timestamps absolute\ninternal events logged")?;
            writeln!(out, "Begin Triggerblock {date}\n   0.000000 Start of measurement")
        }
    }
}

fn line(
    format: TrafficFormat,
    seen: &Seen<'_>,
    began_ns: u64,
    out: &mut impl Write,
) -> std::io::Result<()> {
    let Seen { at_ns, cycle, frame, interface, .. } = seen;
    let (id, payload) = (frame.id(), frame.payload());
    let is_sent = seen.traffic == Traffic::Sent;
    let (seconds, micros) = (at_ns / 1_000_000_000, at_ns % 1_000_000_000 / 1000);
    let hex: Vec<String> = payload.iter().map(|byte| format!("{byte:02X}")).collect();
    let is_fd = payload.len() > PAYLOAD_MAX;
    match format {
        TrafficFormat::Csv => {
            let direction = if is_sent { "sent" } else { "received" };
            let data = hex.concat();
            writeln!(out, "{seconds}.{micros:06},{cycle},{direction},{interface},{id:03X},{data}")
        }
        TrafficFormat::Candump => {
            // The digit after ## holds the flags of the frame: bit rate switch.
            let (mark, direction) =
                (if is_fd { "##1" } else { "#" }, if is_sent { "T" } else { "R" });
            let data = hex.concat();
            writeln!(out, "({seconds}.{micros:06}) {interface} {id:03X}{mark}{data} {direction}")
        }
        TrafficFormat::Asc => {
            let after_s = at_ns.saturating_sub(began_ns) as f64 * 1e-9;
            let (channel, direction) = (seen.bus + 1, if is_sent { "Tx" } else { "Rx" });
            let data = hex.join(" ");
            let n_bytes = payload.len();
            if is_fd {
                let code = FD_LENGTHS.iter().position(|n| *n == n_bytes).map_or(8, |at| at + 9);
                return writeln!(
                    out,
                    "{after_s:11.6} CANFD {channel:>3} {direction}   {id:X} 1 0 {code:x} {n_bytes:>2} {data}"
                );
            }
            writeln!(out, "{after_s:11.6} {channel}  {id:<15X} {direction}   d {n_bytes:x} {data}")
        }
    }
}

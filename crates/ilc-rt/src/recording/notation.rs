//! Notation of frames: `181#37020A00`, as candump writes them; a failure is its name in JSON after `!`.

use std::fmt::Write as _;

use crate::fieldbus::transport::BusEvent;
use crate::fieldbus::{BusError, Frame};

/// Direction of an event on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traffic {
    /// To the loop.
    Received,
    /// From the loop.
    Sent,
}

/// Returns a frame as text.
pub fn frame_text(frame: &Frame) -> String {
    let mut text = String::with_capacity(4 + 2 * frame.payload().len());
    // Writing to a string cannot fail.
    let _ = write!(text, "{:03X}#", frame.id());
    for byte in frame.payload() {
        let _ = write!(text, "{byte:02X}");
    }
    text
}

/// Returns an event as text.
pub(super) fn event_text(event: &BusEvent) -> (Traffic, String) {
    let failure =
        |error: &BusError| format!("!{}", serde_json::to_string(error).unwrap_or_default());
    match event {
        BusEvent::Received(frame) => (Traffic::Received, frame_text(frame)),
        BusEvent::Failed(error) => (Traffic::Received, failure(error)),
        BusEvent::Sent(frame) => (Traffic::Sent, frame_text(frame)),
        BusEvent::Refused(frame, error) => {
            (Traffic::Sent, format!("{}{}", frame_text(frame), failure(error)))
        }
    }
}

/// Returns the event of a text, or `None` for any other text.
pub fn read_event(traffic: Traffic, text: &str) -> Option<BusEvent> {
    let (frame, failure) = match text.split_once('!') {
        Some((frame, error)) => (frame, Some(serde_json::from_str(error).ok()?)),
        None => (text, None),
    };
    Some(match (traffic, failure) {
        (Traffic::Received, Some(error)) if frame.is_empty() => BusEvent::Failed(error),
        (Traffic::Received, None) => BusEvent::Received(read_frame(frame)?),
        (Traffic::Sent, None) => BusEvent::Sent(read_frame(frame)?),
        (Traffic::Sent, Some(error)) => BusEvent::Refused(read_frame(frame)?, error),
        (Traffic::Received, Some(_)) => return None,
    })
}

fn read_frame(text: &str) -> Option<Frame> {
    let (id, data) = text.split_once('#')?;
    if !data.is_ascii() || !data.len().is_multiple_of(2) {
        return None;
    }
    let byte = |at: usize| u8::from_str_radix(data.get(at..at + 2)?, 16).ok();
    let payload: Vec<u8> = (0..data.len()).step_by(2).map(byte).collect::<Option<_>>()?;
    Frame::fd(u16::from_str_radix(id, 16).ok()?, &payload)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fieldbus::can_fact::CanFact;

    #[test]
    fn every_event_comes_back() {
        let frame = Frame::new(0x181, &[0x37, 0x02, 0x0A, 0xFF]).unwrap();
        let long = Frame::fd(0x7FF, &[7; 64]).unwrap();
        assert_eq!(frame_text(&frame), "181#37020AFF");
        let errors = [
            BusError::Full,
            BusError::Os(105),
            BusError::Controller(CanFact::ErrorPassive { transmit: 128, receive: 3 }),
        ];
        let mut events =
            vec![BusEvent::Received(frame), BusEvent::Sent(long), BusEvent::Sent(Frame::default())];
        for error in errors {
            events.extend([BusEvent::Failed(error), BusEvent::Refused(frame, error)]);
        }
        for event in events {
            let (traffic, text) = event_text(&event);
            assert_eq!(read_event(traffic, &text), Some(event), "{text}");
        }
    }

    #[test]
    fn what_is_no_frame_is_refused() {
        for text in ["", "181", "181#3", "181#0G", "800#", "181#é0", "181#!\"full\"", "!\"odd\""] {
            assert_eq!(read_event(Traffic::Received, text), None, "{text}");
        }
        assert_eq!(read_event(Traffic::Sent, "!\"full\""), None);
    }
}

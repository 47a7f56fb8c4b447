//! SYNC: the message at which drives sample, take over targets and answer.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cob_id;
use crate::fieldbus::Frame;

/// Returns the SYNC frame, without counter.
pub fn frame() -> Frame {
    Frame::new(cob_id::SYNC, &[]).unwrap_or_default()
}

/// Returns true if `frame` is a SYNC, with or without counter.
pub fn is_sync(frame: &Frame) -> bool {
    frame.id() == cob_id::SYNC && frame.payload().len() <= 1
}

#[cfg(test)]
#[allow(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    clippy::disallowed_types,
    reason = "tests are cold"
)]
mod tests {
    use super::*;

    #[test]
    fn is_the_shortest_frame_of_0x80() {
        assert_eq!((frame().id(), frame().payload()), (0x80, &[][..]));
        assert!(is_sync(&frame()));
        assert!(is_sync(&Frame::new(0x80, &[7]).unwrap()));
        assert!(!is_sync(&Frame::new(0x80, &[7, 8]).unwrap()));
        assert!(!is_sync(&Frame::new(0x81, &[]).unwrap()));
    }
}

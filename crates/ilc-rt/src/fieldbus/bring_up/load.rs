//! Bus load of the frames of one cycle on classical CAN.
//!
//! Checked when a cell is loaded: an overloaded bus shows on the machine as late set points and
//! lost drives, long after the mistake. The counts are worst-case bit stuffing, so that a cell that
//! passes fits with any payload.

use crate::fieldbus::frame::PAYLOAD_MAX;

/// Bits of a frame without payload: 34 stuffable bits of header and CRC, at most 8 stuff bits, 13
/// bits of tail and interframe space.
const EMPTY_FRAME_BITS: u64 = 55;

/// Bits per byte of payload: 8 and at most 2 stuff bits.
const BITS_PER_BYTE: u64 = 10;

/// Bus load of the frames of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Worst-case bits on the bus in one cycle.
    pub bits_per_cycle: u64,
    /// Bits that the bus carries in one cycle at its bit rate.
    pub bits_available: f64,
}

impl Load {
    /// Returns the used share of the bus, 0 to 1.
    pub fn ratio(&self) -> f64 {
        self.bits_per_cycle as f64 / self.bits_available
    }
}

/// Reason that the frames of a cycle do not fit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// More bits than the limit allows.
    #[error(
        "the frames of one cycle need {bits_per_cycle} bits at worst, {allowed:.0} are allowed \
         ({:.0} % of {available:.0}): raise [cell] cycle_us, or bitrate_bit_s or load_max where the \
         bus allows it",
        load_max * 100.0
    )]
    TooMuch {
        /// Worst-case bits of one cycle.
        bits_per_cycle: u64,
        /// Bits allowed in one cycle: `load_max` of those available.
        allowed: f64,
        /// Bits available in one cycle.
        available: f64,
        /// Largest allowed share of the bus, 0 to 1.
        load_max: f64,
    },
    /// A payload beyond a classical frame.
    #[error("a payload of {len} bytes does not fit a classical CAN frame: 0 to 8 are allowed")]
    Payload {
        /// Requested length, in bytes.
        len: usize,
    },
    /// A cycle time that is not a positive number.
    #[error("a cycle of {cycle_s} s is not possible: it must be a positive number of seconds")]
    Cycle {
        /// Requested cycle time, in seconds.
        cycle_s: f64,
    },
    /// A bit rate outside classical CAN.
    #[error("{bitrate_bit_s} bit/s is not a bit rate of classical CAN: 1 to 1000000 are allowed")]
    BitRate {
        /// Requested bit rate, in bit/s.
        bitrate_bit_s: u32,
    },
    /// A limit outside (0, 1].
    #[error("a load limit of {load_max} is not possible: above 0 and up to 1 are allowed")]
    Limit {
        /// Requested limit.
        load_max: f64,
    },
}

/// Returns the worst-case bits of a classical 11-bit frame, including interframe space.
///
/// `bits = 55 + 10 n` for `n` bytes of payload.
pub const fn frame_bits(payload_bytes: usize) -> u64 {
    EMPTY_FRAME_BITS + BITS_PER_BYTE * payload_bytes as u64
}

/// Checks that one cycle's frames fit the bus.
///
/// `sum(55 + 10 n_i) <= load_max · bitrate · cycle`
///
/// # Shapes
/// - `payloads`: one entry per frame of the cycle, SYNC and a reserve for SDO, heartbeat and EMCY
///   included.
/// # Units
/// - `payloads` in bytes, `cycle_s` in seconds, `bitrate_bit_s` in bit/s, `load_max` from 0 to 1.
/// # Errors
/// - [`LoadError::TooMuch`] with the bits per cycle and the limit; the others name the invalid
///   argument.
pub fn check(
    payloads: &[usize],
    cycle_s: f64,
    bitrate_bit_s: u32,
    load_max: f64,
) -> Result<Load, LoadError> {
    if !(cycle_s.is_finite() && cycle_s > 0.0) {
        return Err(LoadError::Cycle { cycle_s });
    }
    if !(1..=1_000_000).contains(&bitrate_bit_s) {
        return Err(LoadError::BitRate { bitrate_bit_s });
    }
    if !(load_max > 0.0 && load_max <= 1.0) {
        return Err(LoadError::Limit { load_max });
    }
    if let Some(&len) = payloads.iter().find(|&&len| len > PAYLOAD_MAX) {
        return Err(LoadError::Payload { len });
    }
    let bits_per_cycle = payloads.iter().map(|&len| frame_bits(len)).sum();
    let available = f64::from(bitrate_bit_s) * cycle_s;
    let allowed = load_max * available;
    // Half a bit of tolerance: a cycle of 1 ms is not a binary fraction, and a full bus is a whole
    // number.
    if bits_per_cycle as f64 > allowed + 0.5 {
        return Err(LoadError::TooMuch { bits_per_cycle, allowed, available, load_max });
    }
    Ok(Load { bits_per_cycle, bits_available: available })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SYNC, a reserve frame, and the given frames per axis.
    fn cycle(n_axes: usize, axis: &[usize]) -> Vec<usize> {
        let mut payloads = vec![0, 8];
        for _ in 0..n_axes {
            payloads.extend_from_slice(axis);
        }
        payloads
    }

    fn axes_that_fit(axis: &[usize], cycle_s: f64, load_max: f64) -> usize {
        (1..100)
            .take_while(|&n| check(&cycle(n, axis), cycle_s, 1_000_000, load_max).is_ok())
            .count()
    }

    #[test]
    fn counts_worst_case_bits() {
        assert_eq!([0, 6, 8].map(frame_bits), [55, 115, 135]);
    }

    #[test]
    fn finds_how_many_axes_fit() {
        let fit =
            |axis: &[usize], cycle_s| [1.0, 0.8, 0.6].map(|m| axes_that_fit(axis, cycle_s, m));
        assert_eq!(fit(&[8, 8], 0.001), [3, 2, 1]);
        assert_eq!(fit(&[8, 8], 0.002), [6, 5, 3]);
        assert_eq!(fit(&[8, 8], 0.004), [14, 11, 8]);
        assert_eq!(fit(&[6, 6], 0.002), [7, 6, 4]);
        assert_eq!(fit(&[8, 8, 8], 0.001), [2, 1, 1]);
    }

    #[test]
    fn names_the_bits_and_the_limit() {
        let error = check(&cycle(6, &[8, 8]), 0.001, 1_000_000, 0.8).unwrap_err();
        let line = error.to_string();
        assert!(line.contains("1810 bits"), "{line}");
        assert!(line.contains("800 are allowed (80 % of 1000)"), "{line}");
    }

    #[test]
    fn refuses_arguments_that_cannot_be() {
        assert!(matches!(check(&[9], 0.001, 500_000, 0.8), Err(LoadError::Payload { len: 9 })));
        assert!(matches!(check(&[8], f64::NAN, 500_000, 0.8), Err(LoadError::Cycle { .. })));
        assert!(matches!(check(&[8], 0.001, 0, 0.8), Err(LoadError::BitRate { .. })));
        assert!(matches!(check(&[8], 0.001, 500_000, 1.2), Err(LoadError::Limit { .. })));
    }

    #[test]
    fn gives_the_share_of_the_bus() {
        let load = check(&cycle(3, &[8, 8]), 0.001, 1_000_000, 1.0).unwrap();
        assert!((load.ratio() - 1.0).abs() < 1e-9, "{}", load.ratio());
    }
}

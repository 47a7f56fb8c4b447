//! Time of a frame on the bus, with worst-case bit stuffing, for classical CAN and CAN FD.
//!
//! Source: ISO 11898-1, frame formats with 11-bit identifiers; the FD figure is an upper bound.

use crate::fieldbus::frame::{FD_PAYLOAD_MAX, PAYLOAD_MAX, length_on_bus};

/// Bits of a classical frame without payload: 34 stuffable bits of header and CRC, at most 8 stuff
/// bits, 13 bits of tail and interframe space.
const EMPTY_FRAME_BITS: usize = 55;
/// Bits per byte of a classical payload: 8 and at most 2 stuff bits.
const BITS_PER_BYTE: usize = 10;
/// Bits of an FD frame at the nominal rate: 17 of header, 4 stuff bits, 13 of tail and interframe space.
const FD_NOMINAL_BITS: usize = 34;
/// Bits of an FD frame at the data rate before the payload.
const FD_DATA_BITS: usize = 5;
/// Bits of the CRC field of an FD frame of up to 16 bytes, and of a longer one: CRC, stuff count and their
/// fixed stuff bits.
const FD_CRC_BITS: [usize; 2] = [27, 32];
/// Longest payload with the shorter CRC.
const FD_SHORT_CRC_BYTES: usize = 16;

/// The bit rates of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRates {
    /// Nominal bit rate, in bit/s.
    pub nominal_bit_s: u32,
    /// Bit rate of the data phase of CAN FD, in bit/s; `None` for classical CAN.
    pub data_bit_s: Option<u32>,
}

impl BitRates {
    /// Returns the rates of a classical bus.
    pub const fn classical(nominal_bit_s: u32) -> Self {
        Self { nominal_bit_s, data_bit_s: None }
    }

    /// Returns the longest payload of a frame.
    pub const fn payload_max(self) -> usize {
        if self.data_bit_s.is_some() { FD_PAYLOAD_MAX } else { PAYLOAD_MAX }
    }

    /// Returns the worst-case time of a frame with an 11-bit identifier, including interframe space, in
    /// microseconds.
    ///
    /// Classical: `(55 + 10 n) / f`. FD with bit rate switch:
    /// `34 / f + (5 + 8 n + floor((21 + 8 n) / 4) - 4 + C) / f_data`, `C = 27` up to 16 bytes, else 32.
    pub fn frame_us(self, payload_bytes: usize) -> f64 {
        let nominal_bit_us = 1e6 / f64::from(self.nominal_bit_s);
        let Some(data_bit_s) = self.data_bit_s else {
            return (EMPTY_FRAME_BITS + BITS_PER_BYTE * payload_bytes) as f64 * nominal_bit_us;
        };
        let n = length_on_bus(payload_bytes);
        let crc = FD_CRC_BITS[usize::from(n > FD_SHORT_CRC_BYTES)];
        let data = FD_DATA_BITS + 8 * n + ((21 + 8 * n) / 4 - 4) + crc;
        FD_NOMINAL_BITS as f64 * nominal_bit_us + data as f64 * 1e6 / f64::from(data_bit_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FD: BitRates = BitRates { nominal_bit_s: 1_000_000, data_bit_s: Some(5_000_000) };

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 0.06, "{found} us, expected {expected}");
    }

    #[test]
    fn classical_frames_take_their_worst_case() {
        let classical = BitRates::classical(1_000_000);
        for (n, us) in [(0, 55.0), (6, 115.0), (8, 135.0)] {
            near(classical.frame_us(n), us);
            near(BitRates::classical(500_000).frame_us(n), 2.0 * us);
        }
    }

    #[test]
    fn fd_frames_are_faster_in_their_data_phase_only() {
        for (n, us) in [
            (0, 40.6),
            (6, 52.6),
            (8, 56.6),
            (12, 64.6),
            (16, 72.6),
            (32, 105.6),
            (64, 169.6),
            // Padded to the next length.
            (9, 64.6),
            (33, 137.6),
        ] {
            near(FD.frame_us(n), us);
        }
        let faster = BitRates { data_bit_s: Some(8_000_000), ..FD };
        near(faster.frame_us(64), 118.8);
        assert_eq!((FD.payload_max(), BitRates::classical(1).payload_max()), (64, 8));
    }
}

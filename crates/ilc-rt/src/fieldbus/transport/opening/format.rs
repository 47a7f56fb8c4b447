//! Format of the frames of a bus, as its address states it: `fd=1`, `data_bitrate=N`. Cold.

use super::error::OpenError;
use super::scheme::Parts;
use crate::fieldbus::frame::{FD_PAYLOAD_MAX, PAYLOAD_MAX};
use crate::fieldbus::load::BitRates;

/// Highest bit rate of the data phase, in bit/s.
const DATA_BIT_S_MAX: u32 = 8_000_000;
/// Lowest bit rate of the data phase, in bit/s.
const DATA_BIT_S_MIN: u32 = 10_000;

/// Format of the frames of a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Format {
    /// True for CAN FD with bit rate switch, which every node of the bus must take.
    pub is_fd: bool,
    /// Bit rate of the data phase, in bit/s, if it is stated: that of the rest by default.
    pub data_bit_s: Option<u32>,
    /// Bit rate that a bus in memory keeps to, in bit/s.
    pub kept_bit_s: Option<u32>,
}

impl Format {
    /// Returns the longest payload of a frame, in bytes.
    pub const fn payload_max(self) -> usize {
        if self.is_fd { FD_PAYLOAD_MAX } else { PAYLOAD_MAX }
    }

    /// Returns the bit rates that a bus in memory keeps to, if it keeps to any.
    pub fn bit_rates(self) -> Option<BitRates> {
        Some(self.rates_at(self.kept_bit_s?))
    }

    /// Returns the bit rates of a bus with this format, at a nominal one in bit/s.
    pub fn rates_at(self, nominal_bit_s: u32) -> BitRates {
        let data_bit_s = self.is_fd.then(|| self.data_bit_s.unwrap_or(nominal_bit_s));
        BitRates { nominal_bit_s, data_bit_s }
    }

    /// Takes an option of an address; returns false for one that says nothing about the format.
    pub(super) fn take(
        &mut self,
        parts: &Parts<'_>,
        (name, value): (&str, &str),
    ) -> Result<bool, OpenError> {
        match name {
            "fd" => {
                self.is_fd = match value {
                    "0" => false,
                    "1" => true,
                    _ => {
                        return Err(parts.refuse(
                            "fd",
                            value,
                            "`1` for CAN FD, `0` for classical CAN",
                        ));
                    }
                }
            }
            "data_bitrate" => {
                let rate = value.parse().ok();
                let rate = rate.filter(|rate| (DATA_BIT_S_MIN..=DATA_BIT_S_MAX).contains(rate));
                let allowed = "10000 to 8000000 bit/s";
                self.data_bit_s =
                    Some(rate.ok_or_else(|| parts.refuse("data_bitrate", value, allowed))?);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Checks that what was taken goes together.
    pub(super) fn checked(self, parts: &Parts<'_>) -> Result<Self, OpenError> {
        match self.data_bit_s {
            Some(rate) if !self.is_fd => {
                Err(parts.refuse("data_bitrate", &rate.to_string(), "with `fd=1` only"))
            }
            _ => Ok(self),
        }
    }
}

//! Budget of a cycle: the frames of a bus against its period.

use super::frame_time::BitRates;

/// Bus time of the frames of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Worst-case bus time of one cycle, in microseconds.
    pub us_per_cycle: f64,
    /// Cycle, in microseconds.
    pub cycle_us: f64,
}

impl Load {
    /// Returns the bus time of some frames.
    ///
    /// # Shapes
    /// - `payloads`: one entry per frame of the cycle, in bytes, SYNC and a reserve for SDO, heartbeat and
    ///   EMCY included.
    pub fn of(payloads: &[usize], cycle_s: f64, rates: BitRates) -> Self {
        let us_per_cycle = payloads.iter().map(|&n_bytes| rates.frame_us(n_bytes)).sum();
        Self { us_per_cycle, cycle_us: cycle_s * 1e6 }
    }

    /// Returns the used share of the bus, 0 to 1.
    pub fn ratio(&self) -> f64 {
        self.us_per_cycle / self.cycle_us
    }

    /// Returns whether at most a share of the period is used.
    pub fn fits(&self, load_max: f64) -> bool {
        // Half a microsecond of tolerance: a cycle of 1 ms is not a binary fraction, and a full bus is a
        // whole number.
        self.us_per_cycle <= load_max * self.cycle_us + 0.5
    }

    /// Returns the shortest cycle in which the frames fit, in multiples of 100 us.
    pub fn cycle_needed_us(&self, load_max: f64) -> f64 {
        ((self.us_per_cycle - 0.5) / load_max / 100.0).ceil() * 100.0
    }
}

/// Reason that the frames of a cycle do not fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// More time than the limit allows.
    #[error(
        "the frames of one cycle need {:.0} us at worst, {:.0} us are allowed ({:.0} % of {:.0} us); {remedies}",
        load.us_per_cycle,
        load_max * load.cycle_us,
        load_max * 100.0,
        load.cycle_us
    )]
    TooMuch {
        /// Bus time.
        load: Load,
        /// Largest allowed share of the bus, 0 to 1.
        load_max: f64,
        /// Changes that would make the cycle fit.
        remedies: String,
    },
    /// A payload beyond a frame.
    #[error("a payload of {len} bytes does not fit a frame of this bus: 0 to {max} are allowed")]
    Payload {
        /// Requested length, in bytes.
        len: usize,
        /// Longest payload.
        max: usize,
    },
    /// A cycle time that is not a positive number.
    #[error("a cycle of {cycle_s} s is not possible: it must be a positive number of seconds")]
    Cycle {
        /// Requested cycle time, in seconds.
        cycle_s: f64,
    },
    /// A bit rate outside classical CAN.
    #[error("{bitrate_bit_s} bit/s is not a nominal bit rate of CAN: 1 to 1000000 are allowed")]
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

/// Checks that one cycle's frames fit the bus.
///
/// `sum(t(n_i)) <= load_max · cycle`
///
/// # Shapes
/// - `payloads`: one entry per frame of the cycle, SYNC and a reserve for SDO, heartbeat and EMCY
///   included.
/// # Units
/// - `payloads` in bytes, `cycle_s` in seconds, `load_max` from 0 to 1.
/// # Errors
/// - [`LoadError::TooMuch`] with bus time, limit and the cycle that would do; the others name the invalid
///   argument.
pub fn check(
    payloads: &[usize],
    cycle_s: f64,
    rates: BitRates,
    load_max: f64,
) -> Result<Load, LoadError> {
    if !(cycle_s.is_finite() && cycle_s > 0.0) {
        return Err(LoadError::Cycle { cycle_s });
    }
    let bitrate_bit_s = rates.nominal_bit_s;
    if !(1..=1_000_000).contains(&bitrate_bit_s) {
        return Err(LoadError::BitRate { bitrate_bit_s });
    }
    if !(load_max > 0.0 && load_max <= 1.0) {
        return Err(LoadError::Limit { load_max });
    }
    let max = rates.payload_max();
    if let Some(&len) = payloads.iter().find(|&&len| len > max) {
        return Err(LoadError::Payload { len, max });
    }
    let load = Load::of(payloads, cycle_s, rates);
    if load.fits(load_max) {
        return Ok(load);
    }
    let remedies = format!("a cycle of {:.0} us would do", load.cycle_needed_us(load_max));
    Err(LoadError::TooMuch { load, load_max, remedies })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLASSICAL: BitRates = BitRates::classical(1_000_000);

    /// SYNC, a reserve frame, and the given frames per axis.
    fn cycle(n_axes: usize, axis: &[usize]) -> Vec<usize> {
        let mut payloads = vec![0, 8];
        for _ in 0..n_axes {
            payloads.extend_from_slice(axis);
        }
        payloads
    }

    fn axes_that_fit(axis: &[usize], cycle_s: f64, rates: BitRates, load_max: f64) -> usize {
        (1..100).take_while(|&n| check(&cycle(n, axis), cycle_s, rates, load_max).is_ok()).count()
    }

    #[test]
    fn finds_how_many_axes_fit() {
        let on = |rates| {
            move |axis: &[usize], cycle_s| {
                [1.0, 0.8, 0.6].map(|load_max| axes_that_fit(axis, cycle_s, rates, load_max))
            }
        };
        let fit = on(CLASSICAL);
        assert_eq!(fit(&[8, 8], 0.001), [3, 2, 1]);
        assert_eq!(fit(&[8, 8], 0.002), [6, 5, 3]);
        assert_eq!(fit(&[8, 8], 0.004), [14, 11, 8]);
        assert_eq!(fit(&[6, 6], 0.001), [3, 2, 1]);
        assert_eq!(fit(&[6, 6], 0.002), [7, 6, 4]);
        assert_eq!(fit(&[8, 8, 8], 0.001), [2, 1, 1]);
        let fit = on(BitRates { data_bit_s: Some(5_000_000), ..CLASSICAL });
        assert_eq!(fit(&[8, 8], 0.001), [7, 6, 4]);
        assert_eq!(fit(&[12, 16], 0.001), [6, 5, 3]);
        let fit = on(BitRates { data_bit_s: Some(8_000_000), ..CLASSICAL });
        assert_eq!(fit(&[12, 16], 0.002), [17, 13, 10]);
    }

    #[test]
    fn names_the_time_the_limit_and_the_cycle_that_would_do() {
        let error = check(&cycle(6, &[8, 8]), 0.001, CLASSICAL, 0.8).unwrap_err();
        let line = error.to_string();
        assert!(line.contains("1810 us at worst"), "{line}");
        assert!(line.contains("800 us are allowed (80 % of 1000 us)"), "{line}");
        assert!(line.contains("a cycle of 2300 us would do"), "{line}");
        assert!(check(&cycle(6, &[8, 8]), 0.0023, CLASSICAL, 0.8).is_ok());
        assert!(check(&cycle(6, &[8, 8]), 0.0022, CLASSICAL, 0.8).is_err());
    }

    #[test]
    fn refuses_arguments_that_cannot_be() {
        let slow = BitRates::classical(500_000);
        assert!(matches!(
            check(&[9], 0.001, slow, 0.8),
            Err(LoadError::Payload { len: 9, max: 8 })
        ));
        assert!(matches!(check(&[8], f64::NAN, slow, 0.8), Err(LoadError::Cycle { .. })));
        let none = BitRates::classical(0);
        assert!(matches!(check(&[8], 0.001, none, 0.8), Err(LoadError::BitRate { .. })));
        assert!(matches!(check(&[8], 0.001, slow, 1.2), Err(LoadError::Limit { .. })));
    }

    #[test]
    fn gives_the_share_of_the_bus() {
        let load = check(&cycle(3, &[8, 8]), 0.001, CLASSICAL, 1.0).unwrap();
        assert!((load.ratio() - 1.0).abs() < 1e-9, "{}", load.ratio());
    }
}

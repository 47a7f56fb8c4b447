//! Search for the frequency band in which a model fits.
//!
//! Friction and unmodelled modes spoil the fit of a wide band: acceleration grows with the square
//! of the frequency, so a narrower band permits a larger amplitude.

use super::identified::{Described, Identified};
use crate::config::{Axis, Cell, InputKind, mode};

/// Upper ends of the bands, relative to the natural frequency in the cell.
const SHARES: [f64; 4] = [1.5, 1.0, 0.75, 0.5];
/// Ends of the band of a torque behind loops of the drive, relative to the natural frequency: below it they cancel what is
/// slow, and above it the mass alone answers.
const TORQUE_SHARES: (f64, [f64; 3]) = (0.25, [2.0, 1.5, 1.25]);
/// Relative residual of a model up to which its band is accepted.
const GOOD_RESIDUAL: f64 = 0.12;
/// Lowest frequency, unless the axis is slow.
const FROM_HZ: f64 = 1.0;
/// Shortest period.
const PERIOD_S: f64 = 8.0;
/// Cycles of the lowest frequency per period.
const CYCLES: f64 = 5.0;
/// Upper end of the widest band, in cycles per sample.
const HIGHEST: f64 = 0.4;

/// Frequency band of an excitation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Lowest frequency.
    pub from_hz: f64,
    /// Highest frequency.
    pub to_hz: f64,
    /// Length of a period.
    pub period_s: f64,
}

/// The search for the band in which a model fits.
#[derive(Debug, Clone)]
pub struct BandSearch {
    from_hz: f64,
    period_s: f64,
    highest_hz: f64,
    /// Upper ends still to be tried, the next one last.
    to_try_hz: Vec<f64>,
    /// Upper end of the narrowest band without a good model.
    spoilt_hz: f64,
    widened: bool,
}

impl BandSearch {
    /// Starts with a band up to 1.5 times the natural frequency in the cell; without a model, up to
    /// 1.5 times the lowest one with which the axis keeps its allowed following error.
    pub fn new(cell: &Cell, axis: &Axis) -> Self {
        let model = axis.model.as_ref();
        let expected_hz = mode::of(axis.interface).natural_frequency_hz(axis);
        let highest_hz = HIGHEST / cell.cycle_s();
        let expected_hz =
            if model.is_some() { expected_hz } else { expected_hz.clamp(FROM_HZ, highest_hz) };
        let period_s = PERIOD_S.max(5.0 * CYCLES / expected_hz);
        let slowest_hz = FROM_HZ.min(0.1 * expected_hz).max(CYCLES / period_s);
        let (from_hz, shares) = match axis.input_kind() {
            InputKind::Torque if !axis.interface.targets_torque() => {
                (TORQUE_SHARES.0 * expected_hz, &TORQUE_SHARES.1[..])
            }
            _ => (slowest_hz, &SHARES[..]),
        };
        let mut to_try_hz: Vec<f64> = shares
            .iter()
            .map(|share| (share * expected_hz).min(highest_hz))
            .filter(|to_hz| *to_hz >= 2.0 * from_hz)
            .rev()
            .collect();
        if to_try_hz.is_empty() {
            to_try_hz.push((2.5 * from_hz).min(highest_hz));
        }
        Self { from_hz, period_s, highest_hz, to_try_hz, spoilt_hz: highest_hz, widened: false }
    }

    /// Returns the next band to excite the axis in; `None` if no better one is expected.
    pub fn next_band(&mut self) -> Option<Band> {
        let to_hz = self.to_try_hz.pop()?;
        Some(Band { from_hz: self.from_hz, to_hz, period_s: self.period_s })
    }

    /// Returns true if there is another band to try.
    pub fn is_open(&self) -> bool {
        !self.to_try_hz.is_empty()
    }

    /// Records the model found in a band; returns true if it is better than the best one so far,
    /// `before`.
    pub fn judge(&mut self, band: Band, found: &Identified, before: Option<&Identified>) -> bool {
        let good = found.doubt.is_none() && found.residual_rms() <= GOOD_RESIDUAL;
        if self.widened {
            return good;
        }
        if good {
            self.to_try_hz.clear();
        } else {
            self.spoilt_hz = band.to_hz;
        }
        if self.to_try_hz.is_empty()
            && found.doubt.is_none()
            && let Described::Position(fit) = found.described
        {
            // A band that ends below the natural frequency determines it badly.
            let wider_hz = (1.5 * fit.model.natural_frequency_hz).min(self.highest_hz);
            if band.to_hz < fit.model.natural_frequency_hz && wider_hz < 0.99 * self.spoilt_hz {
                self.to_try_hz.push(wider_hz);
                self.widened = true;
            }
        }
        let least = before.filter(|before| before.doubt.is_none());
        match (found.doubt, least) {
            (None, Some(before)) => found.residual_rms() < before.residual_rms(),
            (None, None) => true,
            (Some(_), least) => least.is_none(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    fn search(change: (&str, &str)) -> BandSearch {
        let text =
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_gantry.toml"));
        assert!(text.contains(change.0));
        let cell = Cell::parse(&text.replace(change.0, change.1), "cell.toml").unwrap();
        BandSearch::new(&cell, &cell.axes[1])
    }

    #[test]
    fn bands_get_narrower() {
        let mut search = search(("15.0", "15.0"));
        let bands: Vec<Band> = std::iter::from_fn(|| search.next_band()).collect();
        let ends: Vec<f64> = bands.iter().map(|band| band.to_hz).collect();
        assert_eq!(ends, [22.5, 15.0, 11.25, 7.5]);
        assert!(bands.iter().all(|band| (band.from_hz, band.period_s) == (1.0, 8.0)));
    }

    #[test]
    fn without_a_model_the_limits_say_where_to_begin() {
        let text =
            include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/01_gantry.toml"));
        let mut cell = Cell::parse(text, "cell.toml").unwrap();
        let axis = &mut cell.axes[1];
        axis.model = None;
        axis.limits.velocity_max_m_s = 0.5;
        axis.limits.following_error_max_m = 0.02;
        let band = BandSearch::new(&cell, &cell.axes[1]).next_band().unwrap();
        // 2 v / (2 pi e) = 7.958 Hz, and half as much more.
        assert!((band.to_hz - 1.5 * 50.0 / TAU).abs() < 1e-9, "{band:?}");
        cell.axes[1].limits.following_error_max_m = 1e-7;
        let band = BandSearch::new(&cell, &cell.axes[1]).next_band().unwrap();
        assert!((band.to_hz - 200.0).abs() < 1e-9, "not beyond what the cycle allows: {band:?}");
    }

    #[test]
    fn a_slow_axis_gets_a_longer_period_and_a_fast_one_what_the_cycle_allows() {
        let slow = search(("natural_frequency_hz = 15.0", "natural_frequency_hz = 1.0"))
            .next_band()
            .unwrap();
        assert!((slow.period_s - 25.0).abs() < 1e-9 && (slow.from_hz - 0.2).abs() < 1e-9);
        assert!((slow.to_hz - 1.5).abs() < 1e-9);
        let fast = search(("natural_frequency_hz = 15.0", "natural_frequency_hz = 900.0"))
            .next_band()
            .unwrap();
        assert!((fast.to_hz - 200.0).abs() < 1e-9, "0.4 of 500 Hz");
    }
}

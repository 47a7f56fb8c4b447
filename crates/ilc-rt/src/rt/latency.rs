//! Histograms of the loop's timing (latency, jitter), filled without allocation.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use hdrhistogram::Histogram;
use serde::{Deserialize, Serialize};

use super::clock::Nanos;

/// Longest span that is resolved; longer ones are counted as this.
const LONGEST_NS: u64 = 10_000_000_000;

/// A histogram of spans from 1 ns to 10 s, to two significant digits.
#[derive(Clone, Debug)]
pub struct Latency {
    histogram: Histogram<u64>,
}

impl Default for Latency {
    fn default() -> Self {
        #[expect(clippy::disallowed_methods, reason = "cold: set-up, with constant bounds")]
        #[expect(clippy::expect_used, reason = "the bounds are constants and valid")]
        let histogram = Histogram::new_with_bounds(1, LONGEST_NS, 2).expect("constant bounds");
        Self { histogram }
    }
}

impl Latency {
    /// Counts one span.
    ///
    /// # Real Time
    /// Does not allocate: the bounds are fixed and longer spans saturate.
    pub fn record(&mut self, span: Nanos) {
        self.histogram.saturating_record(span.0);
    }

    /// Returns the quantiles in microseconds. Cold.
    pub fn figures(&self) -> LatencyFigures {
        let micros = |nanos: u64| nanos as f64 * 1e-3;
        let quantile = |q: f64| micros(self.histogram.value_at_quantile(q));
        LatencyFigures {
            count: self.histogram.len(),
            p50: quantile(0.5),
            p99: quantile(0.99),
            p999: quantile(0.999),
            max: micros(self.histogram.max()),
            bins: self
                .histogram
                .iter_log(1000, 1.5)
                .map(|step| (micros(step.value_iterated_to()), step.count_since_last_iteration()))
                .collect(),
        }
    }
}

/// Quantiles and logarithmic bins of a [`Latency`], in microseconds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LatencyFigures {
    /// Number of spans.
    pub count: u64,
    /// Median (50th percentile).
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Maximum.
    pub max: f64,
    /// Histogram bins: upper edge in microseconds, and count.
    pub bins: Vec<(f64, u64)>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_hold_the_longest_span() {
        let mut latency = Latency::default();
        for micros in 1..=1000 {
            latency.record(Nanos::from_micros(micros));
        }
        let figures = latency.figures();
        assert_eq!(figures.count, 1000);
        assert!((figures.max - 1000.0).abs() < 10.0, "{}", figures.max);
        assert!((figures.p50 - 500.0).abs() < 5.0, "{}", figures.p50);
        assert_eq!(figures.bins.iter().map(|bin| bin.1).sum::<u64>(), 1000);
    }

    #[test]
    fn a_span_beyond_the_bounds_is_counted() {
        let mut latency = Latency::default();
        latency.record(Nanos(u64::MAX));
        assert_eq!(latency.figures().count, 1);
    }
}

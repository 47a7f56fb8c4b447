//! `cyclictest` of Debian's rt-tests, the usual measure, in the same minutes as the loop.

use std::io::ErrorKind;
use std::process::{Command, Stdio};

use serde::Serialize;

use crate::rt::RtRequest;

/// Buckets of its histogram, of 1 us.
const BUCKETS: usize = 20_000;

/// Wake-ups that `cyclictest` counted, by their lateness in whole microseconds.
#[derive(Clone, Debug, Default)]
pub(super) struct Peer {
    counts: Vec<u64>,
    max_us: u64,
}

/// Quantiles of the lateness of wake-ups, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct PeerFigures {
    pub(super) count: u64,
    pub(super) p50: f64,
    pub(super) p99: f64,
    pub(super) p999: f64,
    pub(super) max: f64,
}

impl Peer {
    /// Measures for some seconds with priority and processor of the loop; false if `cyclictest` is not installed or fails,
    /// as it does without the right to a real-time priority.
    pub(super) fn measure(&mut self, cycle_us: u32, seconds: u32, request: RtRequest) -> bool {
        let mut command = Command::new("cyclictest");
        command.args(["--quiet", "--mlockall", "--threads=1", "--policy=fifo"]);
        command.arg(format!("--priority={}", request.priority));
        if let Some(cpu) = request.cpu {
            command.arg(format!("--affinity={cpu}"));
        }
        command.arg(format!("--interval={cycle_us}"));
        command.arg(format!("--duration={seconds}s"));
        command.arg(format!("--histogram={BUCKETS}"));
        match command.stdin(Stdio::null()).stderr(Stdio::null()).output() {
            Ok(done) if done.status.success() => self.add(&String::from_utf8_lossy(&done.stdout)),
            Err(error) if error.kind() == ErrorKind::NotFound => false,
            _ => false,
        }
    }

    /// Adds the histogram of one measurement; returns false if the output has no counts.
    fn add(&mut self, printed: &str) -> bool {
        self.counts.resize(BUCKETS, 0);
        let before: u64 = self.counts.iter().sum();
        for line in printed.lines() {
            if let Some(max) = line.strip_prefix("# Max Latencies:") {
                self.max_us = self.max_us.max(max.trim().parse().unwrap_or(0));
            }
            let mut words = line.split_whitespace();
            if let (Some(Ok(us)), Some(Ok(count))) =
                (words.next().map(str::parse::<usize>), words.next().map(str::parse::<u64>))
                && us < BUCKETS
            {
                self.counts[us] += count;
            }
        }
        self.counts.iter().sum::<u64>() > before
    }

    pub(super) fn figures(&self) -> PeerFigures {
        let count: u64 = self.counts.iter().sum();
        let quantile = |share: f64| -> f64 {
            let mut seen = 0;
            let at = self.counts.iter().position(|n| {
                seen += n;
                seen as f64 >= share * count as f64
            });
            at.map_or(0.0, |us| us as f64)
        };
        let max = self.max_us as f64;
        PeerFigures { count, p50: quantile(0.5), p99: quantile(0.99), p999: quantile(0.999), max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn histograms_of_slices_add_up() {
        let mut peer = Peer::default();
        assert!(peer.add("# /dev/cpu_dma_latency set to 0us\n# Histogram\n000000 000000\n000003 000098\n000040 000001\n# Max Latencies: 00900\n"));
        assert!(peer.add("000003 000900\n000005 000001\n# Max Latencies: 00005\n"));
        let figures = peer.figures();
        assert_eq!((figures.count, figures.p50, figures.p99), (1000, 3.0, 3.0));
        assert_eq!((figures.p999, figures.max), (5.0, 900.0));
        assert!(!peer.add("no right\n"));
    }
}

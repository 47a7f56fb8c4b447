//! Real-time ground: clocks, thread set-up and the latency histogram.

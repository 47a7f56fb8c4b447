//! Filters: Butterworth as second-order sections and zero-phase filtering.

//! Learning laws: from one run's error to the next run's input.

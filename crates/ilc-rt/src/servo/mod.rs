//! The servo cycle: receive, measure, control, add the learned input, limit, send.

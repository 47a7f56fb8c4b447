//! Simulated drives in a process of their own.

fn main() {}

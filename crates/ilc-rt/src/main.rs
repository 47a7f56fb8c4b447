//! The standalone real-time controller.

fn main() {}

//! Simulated CiA 402 drives and plants that speak the real protocol.

pub mod plant;

//! Tests of the guarantees of every kind of trajectory.

mod promises;

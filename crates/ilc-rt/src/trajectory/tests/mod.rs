//! Promises that every kind of trajectory keeps.

mod promises;

//! The record of one iteration and its figures.

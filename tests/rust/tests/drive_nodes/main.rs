//! Controller against simulated drives, over a bus in memory and in lock-step unless said otherwise.

mod bench;
mod bring_up;
mod determinism;
mod faults;
mod garbage;
mod motion;
mod objects;

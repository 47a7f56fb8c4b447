//! What the caller of a campaign chooses, and what it is told at the end; the binary and the Python
//! bindings fill the one and read the other.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicI32;

use super::disturbance::Disturbance;
use crate::config::Measure;
use crate::record::{EndStatus, Figures};

/// How long a stall of controller or simulated drives is forgiven, as it stalls them alike.
pub(super) const SIMULATED_PATIENCE_S: f64 = 1.0;

/// What the caller chooses beyond the cell description.
#[derive(Clone, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line, each independent")]
pub struct Options {
    /// Runs in the whole campaign; the first one is without learning.
    pub iterations: u32,
    /// Measurement to learn from, if not the cell's.
    pub measure: Option<Measure>,
    /// Paced by the nodes' answers instead of the clock.
    pub lockstep: bool,
    /// Whether the drives are simulated on this computer: a stall of it stalls them as well, and is
    /// forgiven for longer than real drives, which move on by themselves, could allow.
    pub simulated: bool,
    /// Go on with the newest campaign of the same cell, program and law.
    pub resume: bool,
    /// Where every run is kept.
    pub library: PathBuf,
    /// What is measured of each run's surroundings: kept with the run, and told to the law.
    pub disturbance: Disturbance,
    /// Whether to publish on Zenoh.
    pub telemetry: bool,
    /// Set to a signal's number to bring the axes to rest.
    pub stop: Arc<AtomicI32>,
}

impl Options {
    /// Whether stalls are forgiven: in lock-step there is no clock that could tell of one.
    pub(super) fn forgives_stalls(&self) -> bool {
        self.simulated && !self.lockstep
    }
}

/// How a campaign ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How.
    pub status: EndStatus,
    /// One sentence.
    pub reason: String,
    /// Signal that asked to stop, or 0.
    pub signal: i32,
    /// Name of the campaign in the library.
    pub campaign: String,
    /// Number and figures of every run of the campaign, resumed ones included.
    pub runs: Vec<(u32, Figures)>,
}

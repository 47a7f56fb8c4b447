//! `[realtime]`: punctuality of the loop.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::schema::field_order;

/// `[realtime]`: punctuality of the loop, and what happens without it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(extend("x-order" = field_order::<Self>()))]
pub struct Realtime {
    /// Share of its period after which a cycle is late: the flight recorder keeps it, and tells who was late.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub late_share: f64,
    /// Processor for the loop's thread, from 0; the other threads of the program keep off it. Best one that the kernel
    /// keeps free (isolcpus).
    #[schemars(range(min = 0, max = 1023))]
    pub cpu: Option<usize>,
    /// Time before a tick at which the loop stops sleeping and busy-waits; 0 never does. If not given, it is as long as
    /// wake-ups are late at the start, 20 to 100 us and at most 60 % of the cycle; with a processor of its own up to a
    /// third of the cycle, at most 300 us.
    #[schemars(range(min = 0, max = 1000))]
    pub spin_us: Option<u32>,
    /// Reaction to a cycle that began at least a whole cycle late.
    pub overrun: Overrun,
}

/// Reaction to missed cycles. More of them than `[safety] overrun_cycles_max` in a row stop the axes in any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Overrun {
    /// The loop keeps its phase: missed cycles are skipped, and the motion pauses for as long.
    #[default]
    KeepPhase,
    /// Up to 10 missed cycles are made up for, one after the other: the motion keeps to the clock.
    CatchUp,
    /// A controlled stop at the first missed cycle.
    Stop,
}

impl Default for Realtime {
    fn default() -> Self {
        Self { late_share: 0.9, cpu: None, spin_us: None, overrun: Overrun::KeepPhase }
    }
}

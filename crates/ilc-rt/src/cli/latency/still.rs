//! The loop that is measured: axes in memory that stand still and answer at once.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicI32;

use crate::config::{Cell, ConfigError};
use crate::design::{DesignError, Plan};
use crate::fieldbus::network::StillAxes;
use crate::rt::{Clock, MonotonicClock, Nanos};
use crate::servo::{Cycle, Orders, mailbox};

/// The loop of no cell in particular: one axis.
const ONE_AXIS: &str = r#"
[cell]
name = "latency"
cycle_us = 1000
[bus]
address = "loopback:"
[[axis]]
name = "x"
node = 1
interface = "csp"
counts_per_m = 1e6
[axis.limits]
position_min_m = -1.0
position_max_m = 1.0
velocity_max_m_s = 1.0
acceleration_max_m_s2 = 10.0
jerk_max_m_s3 = 1000.0
following_error_max_m = 0.1
[program]
start_m = [0.0]
feed_m_s = 0.1
[[program.segment]]
to_m = [0.01]
[learning]
law = "none"
"#;

/// Messages of the loop that may wait; it goes on without a reader.
const MAILBOX: usize = 64;

/// Returns a cell, or that of no file: one axis.
pub(super) fn cell(file: Option<&Path>) -> Result<Cell, ConfigError> {
    file.map_or_else(|| Cell::parse(ONE_AXIS, "latency"), Cell::load)
}

/// Returns the loop of a cell, at rest at the start of its program, with a cycle of its own.
pub(super) fn still_loop(
    cell: &Cell,
    cycle_us: u32,
    clock: &Arc<MonotonicClock>,
) -> Result<Cycle, DesignError> {
    let mut cell = cell.clone();
    // Guards that no drive reports would never close.
    cell.inputs.clear();
    let mut plan = Plan::new(&cell, None, false)?;
    plan.servo.cycle = Nanos::from_micros(cycle_us);
    plan.servo.runs = 0..1;
    // A computer that stalls is measured to the end: nothing moves that would have to stop.
    plan.servo.overrun_cycles_max = u32::MAX;
    let counts: Vec<i32> = plan
        .servo
        .axes
        .iter()
        .zip(&plan.servo.start_m)
        .map(|(axis, at_m)| axis.scale.position_to_counts(*at_m).unwrap_or(0))
        .collect();
    let network = StillAxes::new(&counts, plan.servo.tool.is_some());
    let (_, loop_side) = mailbox(MAILBOX, Arc::new(AtomicI32::new(0)));
    // No run is ever released.
    let loop_side = loop_side.following(Arc::new(Orders::new(false)));
    let cycle = Cycle::new(Box::new(network), plan.servo, plan.interpolator, loop_side);
    let clock = Arc::clone(clock) as Arc<dyn Clock>;
    Ok(cycle.recorded(clock, cell.realtime.late_share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::servo::TickStatus;

    #[test]
    fn a_computer_that_stalls_is_measured_to_the_end() {
        let clock = Arc::new(MonotonicClock::new(Nanos(0)));
        let mut cycle = still_loop(&cell(None).unwrap(), 50, &clock).unwrap();
        cycle.start();
        for skipped in [0, 1_000_000, 0, 1_000_000, 1_000_000, 0] {
            assert_eq!(cycle.tick(skipped), TickStatus::Running);
        }
    }
}

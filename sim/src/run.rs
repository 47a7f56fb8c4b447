//! The machine on a bus: its clock, its log, its end.

use std::io::Write;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ilc_rt::cli::when_parent_ends;
use ilc_rt::config::Cell;
use ilc_rt::fieldbus::canopen::{NodeId, sync};
use ilc_rt::fieldbus::transport::Responder;
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_rt::rt::{RtRequest, thread};
use ilc_sim::{ClockMode, Machine};

use crate::drive_clock::DriveClock;
use crate::presence;

/// Longest wait for a frame before the plant is advanced.
const BATCH: Duration = Duration::from_millis(1);
/// Real-time priority of the drives, below the controller's: they stand in for hardware.
const PRIORITY: i32 = 70;

/// A node that will lose its power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Mute {
    /// Node.
    pub(crate) node: NodeId,
    /// Time of the plant since the first SYNC: a controller that starts late is not early to notice.
    pub(crate) after: Duration,
}

impl FromStr for Mute {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('@').and_then(|(node, seconds)| {
            let node = node.parse().ok().and_then(NodeId::new)?;
            let after = Duration::try_from_secs_f64(seconds.parse().ok()?).ok()?;
            Some(Self { node, after })
        });
        parts.ok_or_else(|| "write NODE@SECONDS, as 1@5, with a node of 1 to 127".to_owned())
    }
}

/// Rest of axes that lost their controller before the drives end.
const REST: Duration = Duration::from_millis(300);
/// Latest end of the drives after their parent program is gone.
const ORPHAN_MAX: Duration = Duration::from_secs(10);

/// Drives without their parent, and the times at which they may end.
#[derive(Debug, Default)]
struct Orphan {
    since: Option<Duration>,
    moved: Option<Duration>,
}

impl Orphan {
    /// Returns true to end now: the axes have been at rest for a while, stopped by the controller
    /// or by the drives on missing commands.
    fn is_over(&mut self, now: Duration, is_energised: bool) -> bool {
        let since = *self.since.get_or_insert(now);
        let moved = self.moved.get_or_insert(now);
        if is_energised {
            *moved = now;
        }
        now.saturating_sub(*moved) >= REST || now.saturating_sub(since) >= ORPHAN_MAX
    }
}

/// Behaviour of the machine beyond its cell description.
#[derive(Clone, Debug)]
pub(crate) struct Habits {
    /// Silence after which SYNC counts as lost and time runs freely.
    pub(crate) sync_lost_after: Duration,
    /// Nodes that will lose their power.
    pub(crate) mutes: Vec<Mute>,
    /// True to end, when the axes are at rest, once standard input closes.
    pub(crate) with_parent: bool,
}

/// Reason that the machine stops.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    /// The bus failed.
    #[error("{address}: {source}")]
    Bus { address: String, source: BusError },
    /// The thread that watches standard input cannot be started.
    #[error("no thread to watch standard input: {0}")]
    Thread(std::io::Error),
    /// The nodes exist already.
    #[error(
        "{address}: node {node} is on this bus already; another ilc-sim, or a real drive, has this \
         number: stop it, or give --bus another address"
    )]
    Taken { address: String, node: NodeId },
    /// Signals cannot be caught.
    #[error("signals cannot be caught: {0}")]
    Signal(std::io::Error),
}

/// The sending side, with a counter.
struct Outlet {
    bus: Box<dyn Bus>,
    n_sent: u64,
    n_dropped: u64,
    broken: Option<BusError>,
}

impl Outlet {
    fn send(&mut self, frame: Frame) {
        match self.bus.send(&frame) {
            Ok(()) => self.n_sent += 1,
            Err(BusError::Full | BusError::Down) => self.n_dropped += 1,
            Err(error) => self.broken = Some(error),
        }
    }
}

/// Runs the machine until SIGINT or SIGTERM.
pub(crate) fn run(
    cell: &Cell,
    mut machine: Machine,
    bus: Box<dyn Bus>,
    address: &str,
    clock: ClockMode,
    habits: &Habits,
) -> Result<(), RunError> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(RunError::Signal)?;
    }
    let failed = |source| RunError::Bus { address: address.to_owned(), source };
    let mut bus = bus;
    let nodes: Vec<NodeId> = machine.nodes().collect();
    if let Some(node) = presence::find(bus.as_mut(), &nodes).map_err(failed)? {
        return Err(RunError::Taken { address: address.to_owned(), node });
    }
    let mut outlet = Outlet { bus, n_sent: 0, n_dropped: 0, broken: None };
    let mut mutes = habits.mutes.clone();
    let start = Instant::now();
    let mut drive_clock = DriveClock::new(
        Duration::from_micros(cell.cell.cycle_us.into()),
        Duration::from_micros(machine.step_us().into()),
        habits.sync_lost_after,
    );
    if clock == ClockMode::RealTime {
        // A refusal only makes the drives less punctual; the controller reports its own rights.
        let _ = thread::enter(RtRequest { priority: PRIORITY, ..RtRequest::default() });
    }
    let is_orphan = Arc::new(AtomicBool::new(false));
    if habits.with_parent {
        let is_orphan = Arc::clone(&is_orphan);
        when_parent_ends(move || is_orphan.store(true, Ordering::Relaxed))
            .map_err(RunError::Thread)?;
    }
    let mut orphan = Orphan::default();
    let (mut n_syncs, mut first_sync_us) = (0_u64, None);
    print(&ready(cell, address, clock));
    machine.boot(&mut |frame| outlet.send(frame));
    while !stop.load(Ordering::Relaxed) {
        let received = match outlet.bus.recv(BATCH) {
            Ok(received) => received,
            // As drives do: they stay, and carry on once the bus does.
            Err(error) if error.may_pass() => {
                print(&format!("{address}: {error}"));
                None
            }
            Err(error) => return Err(failed(error)),
        };
        if clock == ClockMode::RealTime {
            let n_steps = match &received {
                Some(frame) if sync::is_sync(frame) => drive_clock.at_sync(start.elapsed()),
                _ => drive_clock.idle(start.elapsed()),
            };
            machine.advance(n_steps, &mut |frame| outlet.send(frame));
        }
        if let Some(frame) = received {
            if sync::is_sync(&frame) {
                n_syncs += 1;
                first_sync_us.get_or_insert(machine.time_us());
            }
            machine.receive(&frame, &mut |frame| outlet.send(frame));
        }
        let since_us = first_sync_us.map_or(0, |first_us| machine.time_us() - first_us);
        mutes.retain(|mute| {
            let is_due = first_sync_us.is_some() && Duration::from_micros(since_us) >= mute.after;
            if is_due {
                machine.mute(mute.node);
            }
            !is_due
        });
        while let Some(event) = machine.take_event() {
            print(&event.to_string());
        }
        let elapsed = start.elapsed();
        if is_orphan.load(Ordering::Relaxed) && orphan.is_over(elapsed, machine.is_energised()) {
            break;
        }
        if let Some(error) = outlet.broken {
            return Err(failed(error));
        }
    }
    print(&summary(cell, &machine, start.elapsed(), n_syncs, &outlet));
    Ok(())
}

fn ready(cell: &Cell, address: &str, clock: ClockMode) -> String {
    let axes = cell.axes.iter().map(|axis| format!("{} ({})", axis.node, axis.name));
    let tool = cell.tcp_encoder.iter().map(|tool| format!("{} (tool)", tool.node));
    let nodes: Vec<String> = axes.chain(tool).collect();
    let clock = match clock {
        ClockMode::RealTime => "real time",
        ClockMode::LockStep => "lock-step",
    };
    format!("ready: nodes {} on {address}; {clock}", nodes.join(", "))
}

fn summary(
    cell: &Cell,
    machine: &Machine,
    elapsed: Duration,
    n_syncs: u64,
    outlet: &Outlet,
) -> String {
    let states: Vec<String> = cell
        .axes
        .iter()
        .filter_map(|axis| {
            let state = machine.drive_state(NodeId::new(axis.node)?)?;
            Some(format!("{} ({}) {state}", axis.node, axis.name))
        })
        .collect();
    format!(
        "stopped after {:.1} s: {n_syncs} SYNC received, {} frames sent, {} not sent; nodes {}",
        elapsed.as_secs_f64(),
        outlet.n_sent,
        outlet.n_dropped,
        states.join(", ")
    )
}

/// Prints a line. A closed output must not stop the drives.
fn print(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orphans_end_when_their_axes_have_been_at_rest_and_in_any_case() {
        let ms = Duration::from_millis;
        let mut orphan = Orphan::default();
        assert!(!orphan.is_over(ms(1000), true));
        assert!(!orphan.is_over(ms(2000), true));
        assert!(!orphan.is_over(ms(2299), false));
        assert!(orphan.is_over(ms(2300), false));
        let mut stuck = Orphan::default();
        assert!(!stuck.is_over(ms(0), true) && !stuck.is_over(ms(9999), true));
        assert!(stuck.is_over(ms(10_000), true));
    }
}

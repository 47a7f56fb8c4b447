//! Runs the loop: on a real-time thread, or in line in lock-step.

use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use super::error::CampaignError;
use super::late::Recorded;
use super::options::Session;
use crate::config::{Cell, Realtime};
use crate::fieldbus::BusError;
use crate::fieldbus::canopen::emcy;
use crate::interpolate::MAX_AXES;
use crate::rt::{Clock, MonotonicClock, Nanos, Readiness, RtReport, RtRequest, thread};
use crate::servo::{Cycle, TickStatus, Timing, run_on_clock};

/// Messages that may wait in the loop's mailbox: two seconds at 4 kHz.
pub(super) const MAILBOX: usize = 8192;
/// The same in lock-step, where it is read after every tick: a large one would not stay in the cache.
pub(super) const MAILBOX_IN_LOCKSTEP: usize = 128;
/// Period at which the mailbox of a loop on its own thread is read.
const READ_EVERY: Duration = Duration::from_millis(2);

/// Real-time settings of a loop: as its cell asks for, and as this machine grants.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    request: RtRequest,
    spin: Nanos,
    late_share: f64,
    /// Refuse to run without every requested setting.
    is_required: bool,
}

impl Settings {
    /// Tries the settings of a cell on this machine, before anything moves.
    ///
    /// # Errors
    /// [`CampaignError::NotRealtime`] if they are required and not granted.
    pub(super) fn of(cell: &Cell, session: &Session) -> Result<Self, CampaignError> {
        let Realtime { late_share, cpu, spin_us, .. } = cell.realtime;
        let request = RtRequest { cpu, ..RtRequest::default() };
        let is_required = session.require_rt;
        let cycle = Nanos::from_micros(cell.cell.cycle_us);
        let Readiness { report, spin } = Readiness::probe(request, cycle, spin_us);
        let settings = Self { request, spin, late_share, is_required };
        settings.accept(report)?;
        Ok(settings)
    }

    /// Refuses a machine without the settings that are required, before anything moves.
    ///
    /// # Errors
    /// As [`Self::of`].
    pub(super) fn require(cell: &Cell, session: &Session) -> Result<(), CampaignError> {
        if session.require_rt { Self::of(cell, session).map(drop) } else { Ok(()) }
    }

    fn accept(&self, report: RtReport) -> Result<RtReport, CampaignError> {
        if self.is_required && !report.refused.is_empty() {
            return Err(CampaignError::NotRealtime { refused: report.refused });
        }
        Ok(report)
    }
}

/// The loop, on its own thread or in line.
pub(super) enum Pacer {
    /// On its own thread.
    Clock { thread: Option<JoinHandle<LoopResult>> },
    /// In line, one tick at a time (lock-step).
    Answers { cycle: Option<Box<Cycle>> },
}

/// Result of the loop.
pub(super) struct LoopResult {
    /// Outcome of taking the nodes out of operation.
    pub(super) released: Result<(), BusError>,
    /// Error code of each axis whose drive is in fault, by its emergency message or asked for; 0 for none.
    pub(super) error_codes: [u16; MAX_AXES],
    /// The flight recorder; in real time only.
    pub(super) recorded: Option<Recorded>,
}

impl Pacer {
    pub(super) fn in_line(cycle: Cycle) -> Self {
        Self::Answers { cycle: Some(Box::new(cycle)) }
    }

    /// Starts the loop's thread, with a flight recorder; returns the scheduling that the system granted it.
    ///
    /// # Errors
    /// [`CampaignError::NotRealtime`] if a required setting was refused, [`CampaignError::Thread`] if there is no
    /// thread; the nodes are out of operation then.
    pub(super) fn on_clock(
        cycle: Cycle,
        settings: Settings,
    ) -> Result<(Self, RtReport), CampaignError> {
        let (report, granted) = std::sync::mpsc::sync_channel(1);
        let Settings { request, spin, late_share, is_required } = settings;
        let clock = Arc::new(MonotonicClock::new(spin));
        let mut cycle = cycle.recorded(Arc::clone(&clock) as Arc<dyn Clock>, late_share);
        let thread = std::thread::Builder::new()
            .name("ilc-servo".to_owned())
            .spawn(move || {
                let mut timing = Timing::default();
                let mut granted = thread::enter(request);
                granted.spin_us = spin.0 as f64 * 1e-3;
                let _awake = thread::keep_awake(&mut granted);
                let may_run = !is_required || granted.refused.is_empty();
                // Set-up of the thread is over before the first tick; no tick waits for the report.
                let _ = report.send(granted);
                if may_run {
                    run_on_clock(&mut cycle, clock.as_ref(), &mut timing);
                }
                // At once, not when the campaign has finished its clean-up: by then the nodes may
                // have missed their commands, or be in another campaign.
                release(cycle, Some(timing))
            })
            .map_err(|source| CampaignError::Thread { what: "servo", source })?;
        let dead = || RtReport::refusing(request, "the loop's thread has died");
        match settings.accept(granted.recv().unwrap_or_else(|_| dead())) {
            Ok(report) => Ok((Self::Clock { thread: Some(thread) }, report)),
            Err(refused) => {
                let _ = thread.join();
                Err(refused)
            }
        }
    }

    /// Runs one tick in lock-step, or waits a while for the loop's thread; returns whether the loop has ended.
    pub(super) fn poll(&mut self) -> bool {
        match self {
            Self::Clock { thread } => {
                if thread.as_ref().is_none_or(JoinHandle::is_finished) {
                    return true;
                }
                std::thread::sleep(READ_EVERY);
                false
            }
            Self::Answers { cycle } => {
                cycle.as_mut().is_none_or(|cycle| cycle.tick(0) == TickStatus::Stopped)
            }
        }
    }

    /// Ends the loop; `None` if its thread has died.
    pub(super) fn end(self) -> Option<LoopResult> {
        match self {
            Self::Clock { thread } => thread?.join().ok(),
            Self::Answers { cycle } => Some(release(*cycle?, None)),
        }
    }
}

/// Takes the nodes out of operation, once those in fault have said why.
fn release(cycle: Cycle, timing: Option<Timing>) -> LoopResult {
    let recorded = timing.map(|timing| Recorded { cycles: cycle.flight().cycles(), timing });
    let faults: [Option<u16>; MAX_AXES] = std::array::from_fn(|axis| cycle.fault(axis));
    let mut network = cycle.into_network();
    let error_codes = std::array::from_fn(|axis| match faults[axis] {
        Some(emcy::CODE_RESET) => network.error_code(axis).unwrap_or(emcy::CODE_RESET),
        Some(code) => code,
        None => emcy::CODE_RESET,
    });
    LoopResult { released: network.release(), error_codes, recorded }
}

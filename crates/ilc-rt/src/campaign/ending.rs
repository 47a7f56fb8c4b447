//! Storing the runs of a campaign, and its end.

use std::fmt::Write as _;

use super::control::STOPPED_BY_COMMAND;
use super::fault::{fault, last_cycles};
use super::keeper::{StoreEvent, Stored};
use super::late::{self, Recorded};
use super::learner::Learner;
use super::options::{Options, Outcome};
use super::pace::Pacer;
use super::reason::sentence;
use super::running::Running;
use crate::config::Cell;
use crate::fieldbus::canopen::emcy;
use crate::interpolate::MAX_AXES;
use crate::record::{EndStatus, Event, Fault, FaultKind, FlightRecord, IterationRecord, StateName};
use crate::servo::StopReason;

impl Running<'_> {
    pub(super) fn keep(&mut self, record: IterationRecord, asked: bool) {
        self.keeper.append(record, asked);
        self.poll_keeper();
    }

    /// Handles the outcomes of storing.
    pub(super) fn poll_keeper(&mut self) {
        while let Some(event) = self.keeper.poll() {
            self.on_stored(event);
        }
    }

    /// Publishes a stored run; the first one that cannot be stored stops the axes.
    pub(super) fn on_stored(&mut self, event: StoreEvent) {
        let Stored { record, asked, digest, result } = match event {
            StoreEvent::Stored(stored) => *stored,
            StoreEvent::NotAmended(error) => {
                return self.fail(FaultKind::Library, error.to_string());
            }
        };
        match result {
            Some(Ok(id)) => {
                let place = self.publish_stored(id, &record, digest);
                if asked {
                    self.unjudged.push_back((id, place));
                    self.amend_stored();
                }
            }
            Some(Err(error)) => {
                self.fail(FaultKind::Library, error.to_string());
                self.unkept.push(record);
            }
            None => self.unkept.push(record),
        }
    }

    /// Publishes a stored run; returns its place.
    fn publish_stored(&mut self, id: i64, record: &IterationRecord, digest: String) -> usize {
        self.announcer.publish(&Event::Iteration {
            campaign: self.campaign.clone(),
            id,
            index: record.index,
            digest,
            figures: record.figures.clone(),
        });
        self.runs.add(record.index, record.figures.clone())
    }

    /// Waits until all runs are stored, and retries those that could not be.
    pub(super) fn flush(&mut self) {
        for event in self.keeper.flush() {
            self.on_stored(event);
        }
        self.poll_keeper();
        if self.unkept.is_empty() {
            return;
        }
        let first = self.unkept[0].index;
        let mut is_saved = true;
        for record in std::mem::take(&mut self.unkept) {
            let Some(id) = self.keeper.retry(&record) else {
                is_saved = false;
                break;
            };
            self.publish_stored(id, &record, record.digest());
        }
        let lost = if is_saved { "could not be kept at once" } else { "could not be kept" };
        let kept = match self.runs.len() {
            1 => "1 run is kept".to_owned(),
            n => format!("{n} runs are kept"),
        };
        if let Some((_, why)) = &mut self.failure {
            let _ = write!(why, "; run {first} {lost}, {kept}");
        }
    }

    pub(super) fn fail(&mut self, kind: FaultKind, why: String) {
        if self.failure.is_none() {
            self.failure = Some((kind, why));
            self.mail.stop(libc::SIGABRT);
        }
    }

    pub(super) fn end(mut self, pacer: Pacer, cell: &Cell, options: &Options) -> Outcome {
        let result = pacer.end();
        self.read_mail();
        if let Some(result) = &result {
            self.stopping = self.stopping.map(|reason| explained(reason, &result.error_codes));
        }
        while self.awaited > 0
            && let Some(update) = self.learner.as_mut().and_then(Learner::take_last)
        {
            self.awaited -= 1;
            self.updates.push_back(update);
        }
        self.flush();
        let stopped = self
            .stopping
            .map(|reason| (fault(reason, cell), sentence(reason, cell, &options.session)));
        let (fault, reason) = match (&self.failure, stopped, &result) {
            (Some((kind, why)), _, _) => (Some(Fault::new(*kind)), why.clone()),
            (None, Some(stopped), _) => stopped,
            (None, None, None) => (
                Some(Fault::new(FaultKind::LoopDied)),
                "the loop's thread died; the drives stop by themselves".to_owned(),
            ),
            (None, None, Some(_)) => (None, format!("{} runs made and kept", options.iterations)),
        };
        let status = match (&fault, self.stopping) {
            (Some(_), _) => EndStatus::Fault,
            (None, Some(_)) => EndStatus::Interrupted,
            (None, None) => EndStatus::Completed,
        };
        let is_fault = fault.is_some();
        if let Some(fault) = fault {
            let cycles = last_cycles(&self.before, cell.n_axes());
            let recorded = result.as_ref().and_then(|result| result.recorded.as_ref());
            let late = recorded.and_then(|recorded| self.late.before_stop(recorded));
            let fault = Fault { late, cycles, ..fault };
            self.announcer.publish(&Event::Fault { reason: reason.clone(), fault });
        }
        if let Some(result) = result {
            if let Err(error) = result.released {
                tracing::warn!("nodes could not be taken out of operation: {error}");
            }
            if let Some(recorded) = result.recorded {
                let why = is_fault.then(|| reason.clone());
                let event = self.timing(cell, options, &recorded, why);
                self.announcer.publish(&event);
            }
        }
        let iterations = u32::try_from(self.runs.len()).unwrap_or(u32::MAX);
        self.announcer
            .publish(&Event::State { state: StateName::Stopped, iteration: self.phase_iteration });
        self.announcer.publish(&Event::End { status, reason: reason.clone(), iterations });
        let signal = match self.stopping {
            Some(StopReason::Asked(signal)) if self.failure.is_none() => signal,
            // A person ended it on the machine, as by a command.
            Some(StopReason::StopButton { .. }) if self.failure.is_none() => STOPPED_BY_COMMAND,
            _ => 0,
        };
        let axis_units = cell.axes.iter().map(|axis| axis.unit.symbol()).collect();
        Outcome {
            status,
            reason,
            signal,
            campaign: self.campaign,
            axis_units,
            runs: self.runs.into_newest(),
        }
    }
}

impl Running<'_> {
    /// Writes the record of the loop, and returns the event that tells it.
    fn timing(
        &self,
        cell: &Cell,
        options: &Options,
        recorded: &Recorded,
        reason: Option<String>,
    ) -> Event {
        let record = self.late.record(cell, &self.campaign, recorded, reason);
        let file = late::write(&record, &options.session.library);
        let FlightRecord { stages_us, answers, late, worst, good, .. } = record;
        let interruptions = recorded.timing.stages.interruptions;
        Event::Latency {
            wake_late_us: stages_us.wake,
            execution_us: recorded.timing.execution.figures(),
            receive_us: stages_us.receive,
            control_us: stages_us.control,
            send_us: stages_us.send,
            answers,
            preemptions: interruptions.preemptions,
            minor_faults: interruptions.minor_faults,
            major_faults: interruptions.major_faults,
            late,
            worst: worst.into_iter().next().map(|case| case.cycle),
            good,
            file,
        }
    }
}

/// Returns the reason with the error code that the drive gave when asked, if it is the fault of a drive
/// without an emergency message.
fn explained(reason: StopReason, error_codes: &[u16; MAX_AXES]) -> StopReason {
    let (axis, following_error_m) = match reason {
        StopReason::DriveFault { axis, code: emcy::CODE_RESET, following_error_m } => {
            (axis, following_error_m)
        }
        StopReason::NotEnabled { axis, .. } => (axis, 0.0),
        other => return other,
    };
    match error_codes.get(axis) {
        Some(&code) if code != emcy::CODE_RESET => {
            StopReason::DriveFault { axis, code, following_error_m }
        }
        _ => reason,
    }
}

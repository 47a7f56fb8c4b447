//! The last part of a tick: from set point and learned input to bounded commands on the bus.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use super::cycle::Cycle;
use super::gate::Bounds;
use super::mailbox::StopReason;
use super::mode::{self, Moment};
use super::pending::Part;
use super::phase::Phase;
use super::spec::Pace;
use crate::fieldbus::BusError;
use crate::fieldbus::cia402::{Controlword, State, next_command};

impl Cycle {
    /// Sends every drive its command, then exchanges. A command that the bus cannot take is missed by
    /// the drive: it extrapolates for a cycle; too many such cycles in a row stop the axes.
    pub(super) fn command(&mut self) {
        let mut newest = self.commanded[0];
        let mut fault = None;
        let mut is_full = false;
        for axis in 0..self.n_axes() {
            let mode = mode::of(self.spec.axes[axis].mode);
            let now = self.moment(axis);
            let mut loops = self.loops[axis];
            let mut target = mode.target(&now, &mut loops);
            if !target.is_finite() {
                fault = fault.or(Some(StopReason::NotFinite { axis }));
                // The stop begins from there.
                let last = self.commanded.map(|command| command[axis]);
                target = mode.extrapolate(last);
            }
            newest[axis] = target;
            let mut sent = self.drives[axis].sent;
            sent.controlword = self.controlword(axis);
            mode.write(target, &now, &mut sent);
            let spec = &self.spec.axes[axis];
            if self.has_offset[axis] {
                loops.offset(mode, &now);
                sent.torque_offset = spec.per_mille(loops.force_offset_n);
                if let Some(counts_s) = spec.scale.to_counts(loops.velocity_offset) {
                    sent.velocity_offset = counts_s;
                }
            }
            self.drives[axis].sent = sent;
            self.loops[axis] = loops;
        }
        self.commanded = [newest, self.commanded[0], self.commanded[1]];
        self.flight.controlled();
        for axis in 0..self.n_axes() {
            is_full |= self.network.write(axis, &self.drives[axis].sent) == Err(BusError::Full);
        }
        match self.network.exchange() {
            Ok(()) => {}
            Err(BusError::Full) => is_full = true,
            Err(error) => fault = fault.or(Some(StopReason::Bus(error))),
        }
        self.flight.sent(is_full);
        fault = fault.or(self.congestion(is_full));
        if let Some(reason) = fault {
            self.begin_stop(reason);
        }
    }

    /// Counts the cycles in a row in which the bus did not take every frame.
    fn congestion(&mut self, is_full: bool) -> Option<StopReason> {
        self.congested = if is_full { self.congested.saturating_add(1) } else { 0 };
        // Paced by answers there is none to wait for.
        let max = match self.spec.pace {
            Pace::Answers(_) => 0,
            Pace::Clock => self.spec.silent_cycles_max,
        };
        (self.congested > max).then_some(StopReason::Congested { cycles: self.congested })
    }

    /// Returns an axis as its mode sees it.
    fn moment(&self, axis: usize) -> Moment<'_> {
        let spec = &self.spec.axes[axis];
        let drive = &self.drives[axis];
        #[expect(clippy::cast_precision_loss, reason = "a count of cycles")]
        let unanswered = self.pending.silence(Part::Status(axis)) as f64;
        Moment {
            spec,
            phase: &self.phase,
            enabled: drive.enabled(),
            encoder_m: drive.encoder_m,
            encoder_m_s: drive.encoder_m_s,
            unanswered,
            reference_m: self.reference.position_m[axis],
            reference_m_s: self.reference.velocity_m_s[axis],
            reference_m_s2: self.reference_m_s2[axis],
            input: self.input.value()[axis],
            last: self.commanded.map(|command| command[axis]),
            bounds: Bounds {
                limits: spec.limits,
                position_min_m: spec.position_min_m,
                position_max_m: spec.position_max_m,
                dt_s: self.spec.cycle.as_secs_f64(),
            },
        }
    }

    fn controlword(&self, axis: usize) -> Controlword {
        let drive = &self.drives[axis];
        if drive.lost {
            return Controlword::QUICK_STOP;
        }
        let Some(state) = drive.state().filter(|_| drive.heard) else {
            return Controlword::DISABLE_VOLTAGE;
        };
        match self.phase {
            // No drive is enabled before all are known to be within their limits, and all guards closed.
            Phase::Enabling { .. } if !self.all_heard() || !self.inputs_permit() => {
                Controlword::DISABLE_VOLTAGE
            }
            Phase::Enabling { .. } if state == State::Fault && self.spec.resets_faults => {
                Controlword::fault_reset_after(drive.sent.controlword)
            }
            Phase::Enabling { .. }
            | Phase::Returning(_)
            | Phase::Settling { .. }
            | Phase::Running { .. } => next_command(state),
            // A drive that has disabled itself in a stop stays off.
            Phase::Stopping { .. } => match state {
                State::OperationEnabled if self.brakes_itself(axis) => Controlword::QUICK_STOP,
                State::OperationEnabled => Controlword::ENABLE_OPERATION,
                State::QuickStopActive => Controlword::QUICK_STOP,
                _ => Controlword::DISABLE_VOLTAGE,
            },
            Phase::Disabling { .. } | Phase::Stopped => match state {
                State::OperationEnabled | State::QuickStopActive
                    if drive.distrusted && !self.brakes_itself(axis) =>
                {
                    Controlword::QUICK_STOP
                }
                State::OperationEnabled | State::SwitchedOn => Controlword::SHUTDOWN,
                _ => Controlword::DISABLE_VOLTAGE,
            },
        }
    }

    /// Returns true if a stop of this axis is the quick stop of its drive.
    fn brakes_itself(&self, axis: usize) -> bool {
        mode::of(self.spec.axes[axis].mode).closes_velocity_loop()
    }

    /// Returns true if every drive has reported its state and position.
    fn all_heard(&self) -> bool {
        self.drives[..self.n_axes()].iter().all(|drive| drive.heard)
    }
}

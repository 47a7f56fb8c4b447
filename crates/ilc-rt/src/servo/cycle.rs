//! One tick: receive, measure, control, add the learned input, limit, send.

#![deny(clippy::disallowed_methods, clippy::disallowed_types, clippy::disallowed_macros)]

use std::sync::Arc;

use super::feed::Feed;
use super::input::LearnedInput;
use super::inputs::{self, INPUTS_MAX, InputBits};
use super::mailbox::{DriveStates, LoopSide, Message, Sample, StopReason, Table};
use super::mode::{self, AxisLoops};
use super::node::Drive;
use super::pending::PendingCycles;
use super::phase::{Phase, PhaseName};
use super::spec::{AxisSpec, ServoSpec};
use super::stall::{HOLD_AFTER, Stall};
use super::tap::Tap;
use crate::fieldbus::AxisNetwork;
use crate::fieldbus::canopen::emcy;
use crate::interpolate::{AxisLimits, Interpolator, MAX_AXES, Playback, Setpoint};
use crate::rt::{Clock, Flight, Nanos, Stamps};

/// Longest fade-out of the learned input after a run.
const FADE_MAX_S: f64 = 0.2;

/// Multiple of the acceleration limit up to which a change of the reference velocity is an
/// acceleration.
const REFERENCE_SHARE: f64 = 1.1;
/// Time at rest after a stop before the drives are switched off.
const REST_S: f64 = 0.1;

/// Integral times of a drive that its velocity needs to decay once an offset has faded out.
const INTEGRAL_TIMES: f64 = 5.0;
/// Integral time of a drive that the cell does not describe.
const USUAL_S: f64 = 0.1;
/// Longest time for that.
const DECAY_MAX_S: f64 = 5.0;

/// Returns the time at rest after a stop, which does not rely on the measurement. A drive that brakes by itself
/// may need all the time from its highest velocity. One whose torque offset is withdrawn creeps until its
/// integral has taken the force over.
fn rest_s(spec: &ServoSpec) -> f64 {
    let braking_s = |axis: &AxisSpec| {
        if mode::of(axis.mode).closes_velocity_loop() {
            axis.limits.velocity_max_m_s / axis.limits.acceleration_max_m_s2
                + INTEGRAL_TIMES * USUAL_S
        } else if axis.has_offset() {
            let integral_time_s = axis.force.map_or(USUAL_S, |force| force.integral_time_s);
            (INTEGRAL_TIMES * integral_time_s).min(DECAY_MAX_S)
        } else {
            0.0
        }
    };
    REST_S + spec.axes.iter().map(braking_s).fold(0.0, f64::max)
}

/// True if the loop has more to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TickStatus {
    /// Continue with the next tick.
    Running,
    /// Drives are disabled, or lost; there is nothing more to do.
    Stopped,
}

/// The servo cycle with its state, sized at creation.
///
/// # Real Time
/// [`Cycle::tick`] does not allocate, take locks or panic. It reads a clock for its flight recorder alone: no value
/// depends on it.
pub struct Cycle {
    pub(super) network: Box<dyn AxisNetwork>,
    pub(super) spec: ServoSpec,
    pub(super) mail: LoopSide,
    pub(super) drives: [Drive; MAX_AXES],
    pub(super) tool_m: [f64; MAX_AXES],
    /// Length of the tool's last unreadable PDO, if there was one.
    pub(super) tool_unreadable: Option<u8>,
    pub(super) pending: PendingCycles,
    pub(super) path: Playback,
    pub(super) feed: Feed,
    /// Cycles of the run at another feed than 100 %.
    pub(super) run_scaled: u32,
    /// True if the axes rest at the start because the run is not released.
    pub(super) waits: bool,
    pub(super) input: LearnedInput,
    /// Digital inputs, in the order of their specifications.
    pub(super) inputs: [inputs::Input; INPUTS_MAX],
    /// As told last.
    pub(super) input_bits: InputBits,
    /// States of the drives as told.
    pub(super) drive_states: DriveStates,
    /// Nodes, by their numbers, that have told that they are operational.
    pub(super) operational: u128,
    /// True in the tick of a press of a start button.
    pub(super) is_pressed: bool,
    pub(super) phase: Phase,
    pub(super) reference: Setpoint,
    /// The last three commands of each axis, newest first, in m or m/s by its mode: the initial
    /// state of a stop.
    pub(super) commanded: [[f64; MAX_AXES]; 3],
    pub(super) loops: [AxisLoops; MAX_AXES],
    /// Change of the reference velocity in this tick.
    pub(super) reference_m_s2: [f64; MAX_AXES],
    /// True for an axis whose drive gets offsets with its command.
    pub(super) has_offset: [bool; MAX_AXES],
    /// Time at rest after a stop before the drives are switched off.
    pub(super) rest_s: f64,
    pub(super) run: u32,
    pub(super) stall: Stall,
    pub(super) run_overruns: u32,
    /// Consecutive cycles in which the bus did not take every frame.
    pub(super) congested: u32,
    pub(super) stopping: Option<StopReason>,
    pub(super) limits: [AxisLimits; MAX_AXES],
    pub(super) start_m: [f64; MAX_AXES],
    pub(super) flight: Flight,
    tap: Option<Tap>,
    pub(super) table: Table,
}

impl std::fmt::Debug for Cycle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Cycle")
            .field("phase", &self.phase.name())
            .field("run", &self.run)
            .finish_non_exhaustive()
    }
}

impl Cycle {
    /// Creates the cycle on a network whose nodes have been brought up. Cold.
    ///
    /// # Shapes
    /// - `spec.axes`, `spec.start_m`: one entry for each axis of `interpolator`
    pub fn new(
        network: Box<dyn AxisNetwork>,
        spec: ServoSpec,
        interpolator: Interpolator,
        mail: LoopSide,
    ) -> Self {
        let dt_s = spec.cycle.as_secs_f64();
        let parts: Vec<[bool; 2]> = (0..spec.axes.len()).map(|axis| network.parts(axis)).collect();
        let [mut input_max, mut step_max, mut bend_max] = [[0.0; MAX_AXES]; 3];
        let limits: Vec<AxisLimits> = spec.axes.iter().map(|axis| axis.limits).collect();
        let mut start_m = [0.0; MAX_AXES];
        for (i, axis) in spec.axes.iter().enumerate().take(MAX_AXES) {
            input_max[i] = axis.input_max;
            step_max[i] = axis.input_step_max(dt_s);
            bend_max[i] = axis.input_bend_max(dt_s);
            start_m[i] = spec.start_m.get(i).copied().unwrap_or(0.0);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "small, positive"
        )]
        let fade_ticks = ((FADE_MAX_S / dt_s) as u32).min(spec.settle_ticks / 2).max(1);
        let path = Playback::new(interpolator);
        let feed = Feed::new(&limits, &path.peak_velocity_m_s(), dt_s);
        Self {
            network,
            mail,
            drives: [Drive::default(); MAX_AXES],
            tool_m: [0.0; MAX_AXES],
            tool_unreadable: None,
            pending: PendingCycles::new(&parts, spec.tool.is_some()),
            path,
            feed,
            run_scaled: 0,
            waits: false,
            input: LearnedInput::new(input_max, step_max, bend_max, fade_ticks),
            inputs: Default::default(),
            operational: 0,
            input_bits: InputBits::default(),
            drive_states: DriveStates::default(),
            is_pressed: false,
            phase: Phase::Enabling { ticks: 0 },
            reference: Setpoint {
                position_m: [0.0; MAX_AXES],
                velocity_m_s: [0.0; MAX_AXES],
                done: false,
            },
            commanded: [[0.0; MAX_AXES]; 3],
            loops: std::array::from_fn(|axis| {
                spec.axes
                    .get(axis)
                    .map_or_else(AxisLoops::default, |axis| AxisLoops::new(axis, dt_s))
            }),
            reference_m_s2: [0.0; MAX_AXES],
            has_offset: std::array::from_fn(|axis| {
                spec.axes.get(axis).is_some_and(AxisSpec::has_offset)
            }),
            rest_s: rest_s(&spec),
            run: spec.runs.start,
            stall: Stall::default(),
            run_overruns: 0,
            congested: 0,
            stopping: None,
            limits: AxisLimits::padded(&limits),
            start_m,
            flight: Flight::default(),
            tap: None,
            table: Table { number: 0, input: Box::default() },
            spec,
        }
    }

    /// Returns the cycle with a flight recorder of its stages, which are late after a share of the cycle. Cold.
    #[must_use]
    pub fn recorded(self, clock: Arc<dyn Clock>, late_share: f64) -> Self {
        Self { flight: Flight::new(clock, self.spec.cycle, late_share), ..self }
    }

    /// Counts interruptions of the thread from now on.
    pub fn start(&mut self) {
        self.flight.start();
    }

    /// Returns the cycle with a tap for its recording. Cold.
    #[must_use]
    pub fn tapped(self, tap: Tap) -> Self {
        Self { tap: Some(tap), ..self }
    }

    /// Records that the next tick was due at a time and began at another, after skipped cycles.
    pub fn begin(&mut self, due: Nanos, woke: Nanos, missed: u32) {
        self.flight.begin(due, woke, missed);
    }

    /// Ends the record of a tick and returns it, if there is a recorder. One that was late, or began a stop, is
    /// reported with those before it.
    pub fn end(&mut self) -> Option<Stamps> {
        let stamps = self.flight.end()?;
        if let Some(tap) = &mut self.tap {
            tap.stamps(&stamps);
        }
        if stamps.late || stamps.stopped {
            for stamps in self.flight.untold() {
                self.mail.tell(Message::Cycle(stamps));
            }
        }
        Some(stamps)
    }

    /// Returns the recorder.
    pub fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Returns the number of missed cycles that are made up for.
    pub(super) fn catch_up_cycles_max(&self) -> u64 {
        u64::from(self.spec.catch_up_cycles_max)
    }

    /// Returns the servo cycle time.
    pub fn period(&self) -> Nanos {
        self.spec.cycle
    }

    /// Runs one servo cycle; `missed` cycles before it were skipped because it started too late.
    pub fn tick(&mut self, missed: u32) -> TickStatus {
        let Some(mut tap) = self.tap.take() else { return self.step(missed) };
        tap.begin(missed);
        let status = self.step(missed);
        self.record(&mut tap);
        self.tap = Some(tap);
        status
    }

    fn step(&mut self, missed: u32) -> TickStatus {
        self.mail.look();
        self.stall.note(missed);
        self.run_overruns = self.run_overruns.saturating_add(missed);
        let received = self.receive();
        self.end_reception();
        let nodes_wait = self.pending.waits(HOLD_AFTER);
        if received.is_ok() && self.stall.holds(nodes_wait, self.spec.hold_cycles_max) {
            self.run_overruns = self.run_overruns.saturating_add(1);
            return TickStatus::Running;
        }
        self.give_out();
        self.read_inputs();
        self.tell_states();
        let fault = received.err().or_else(|| self.find_fault());
        let before = self.phase_name();
        if let Some(reason) = fault {
            self.begin_stop(reason);
        }
        let before_m_s = self.reference.velocity_m_s;
        let at = self.advance();
        self.accelerate(&before_m_s);
        self.watch_age();
        let after = self.phase_name();
        if before != after {
            self.mail.tell(Message::Phase(after, self.run));
        }
        if matches!(self.phase, Phase::Stopped) {
            return TickStatus::Stopped;
        }
        self.command();
        let mut sample = Sample {
            at,
            reference_m: self.reference.position_m,
            input: self.input.value(),
            tool_m: self.tool_m,
            ..Sample::default()
        };
        for (axis, drive) in self.drives.iter().enumerate() {
            sample.encoder_m[axis] = drive.encoder_m;
        }
        let last_of_run = at.is_some_and(|(_, k)| k as usize + 1 == self.path.n_samples());
        self.pending.send(sample, self.commanded_position_m(), last_of_run);
        TickStatus::Running
    }

    /// Returns the last emergency code of a drive in fault, 0 if it sent none; `None` for a drive that is
    /// not in fault.
    pub fn fault(&self, axis: usize) -> Option<u16> {
        let drive = self.drives.get(axis).filter(|drive| drive.faulted())?;
        Some(drive.emergency.unwrap_or(emcy::CODE_RESET))
    }

    /// Sets the acceleration of the reference; of a jump, as at the start of a stop, what the limits
    /// allow.
    fn accelerate(&mut self, before_m_s: &[f64; MAX_AXES]) {
        let dt_s = self.spec.cycle.as_secs_f64();
        for (axis, before_m_s) in before_m_s.iter().enumerate().take(self.n_axes()) {
            let max_m_s2 = REFERENCE_SHARE * self.limits[axis].acceleration_max_m_s2;
            let change_m_s = self.reference.velocity_m_s[axis] - before_m_s;
            self.reference_m_s2[axis] = (change_m_s / dt_s).min(max_m_s2).max(-max_m_s2);
        }
    }

    /// Returns the network when the loop is over.
    pub fn into_network(self) -> Box<dyn AxisNetwork> {
        self.network
    }

    /// Returns the name of the phase for messages.
    pub(super) fn phase_name(&self) -> PhaseName {
        match self.phase.name() {
            PhaseName::Settling if self.waits => PhaseName::Waiting,
            PhaseName::Running if self.feed.is_paused() => PhaseName::Paused,
            name => name,
        }
    }

    /// Returns the number of axes.
    pub(super) fn n_axes(&self) -> usize {
        self.spec.axes.len().min(MAX_AXES)
    }

    /// Returns the commanded position of each axis, m: for a velocity axis, its reference.
    pub(super) fn commanded_position_m(&self) -> [f64; MAX_AXES] {
        let mut position_m = self.reference.position_m;
        for (axis, spec) in self.spec.axes.iter().enumerate().take(MAX_AXES) {
            let command = self.commanded[0][axis];
            position_m[axis] = mode::of(spec.mode).position_m(command, position_m[axis]);
        }
        position_m
    }

    /// Swaps in the newest input table, if one is waiting, and reports the one that this run uses.
    pub(super) fn take_table(&mut self) {
        self.mail.newest_table(&mut self.table);
        self.mail.tell(Message::RunStarted { run: self.run, table: self.table.number });
    }

    /// Returns the row of the input table for a sample; zero beyond the table's end.
    pub(super) fn table_row(&self, sample: usize) -> [f64; MAX_AXES] {
        let mut row = [0.0; MAX_AXES];
        let n_axes = self.n_axes();
        let from = sample * n_axes;
        if let Some(entries) = self.table.input.get(from..from + n_axes) {
            row[..n_axes].copy_from_slice(entries);
        }
        row
    }

    /// Passes on every complete cycle.
    fn give_out(&mut self) {
        self.pending.watch_lag();
        while let Some((sample, last_of_run)) = self.pending.take() {
            self.mail.tell(Message::Sample(sample));
            if let (true, Some((run, _))) = (last_of_run, sample.at) {
                let (overruns, scaled) = (self.run_overruns, self.run_scaled);
                self.mail.tell(Message::RunEnded { run, overruns, scaled });
            }
        }
    }
}

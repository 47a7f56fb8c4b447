//! The servo cycle alone, ticked by hand, on a bus that records and that a test can interfere with.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicI32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::config::Cell;
use ilc_rt::design::Plan;
use ilc_rt::fieldbus::bring_up::{bring_up, bring_up_encoder};
use ilc_rt::fieldbus::canopen::{NmtCommand, NodeId, sync};
use ilc_rt::fieldbus::cia402::{CommandRpdo1, State};
use ilc_rt::fieldbus::transport::{InProcess, Responder, TapCount, TappedBus};
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_rt::rt::{Clock, MonotonicClock, Stamps};
use ilc_rt::servo::{
    Cycle, DriveStates, InputBits, Mailbox, Message, Orders, PhaseName, Sample, StopReason,
    Tap as LoopTap, TickStatus, mailbox,
};
use ilc_sim::Machine;
use rtrb::RingBuffer;

use crate::campaign::machine;

/// Reserved size of a test's records; within it, nothing is allocated.
const ROWS: usize = 200_000;
/// Reserved number of answers and of frames that a test puts on the bus.
const FRAMES: usize = 256;

/// Commands sent with one SYNC: the last one of each axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Target of each axis, in counts or counts per second.
    pub target_counts: Vec<i32>,
    /// Torque, or torque offset, of each axis in thousandths.
    pub torque: Vec<i16>,
    /// Controlword of each axis.
    pub controlword: Vec<u16>,
}

/// An action on the machine; frames it emits go to the controller.
pub type Meddle = Box<dyn FnOnce(&mut Machine, &mut dyn FnMut(Frame)) + Send>;

/// A distortion of the answers on their way to the controller: receives the count of SYNCs so far
/// and a frame, and queues the frames that arrive.
pub type Distort = Box<dyn FnMut(usize, Frame, &mut VecDeque<Frame>) + Send>;

/// The bus between loop and machine.
pub struct Line {
    bus: InProcess<Machine>,
    nodes: Vec<NodeId>,
    /// Axis by axis, SYNC by SYNC: the command.
    rows: Vec<CommandRpdo1>,
    pending: Vec<CommandRpdo1>,
    injected: VecDeque<Frame>,
    meddle: Option<(u32, Meddle)>,
    /// Frames that the bus refuses, as its transmit queue is full.
    refused: u32,
    distort: Option<Distort>,
    /// Axis by axis, SYNC by SYNC: position of the plant after the SYNC was answered.
    plant_m: Vec<f64>,
}

impl Line {
    /// Returns the machine, for inspection.
    pub fn machine(&self) -> &Machine {
        self.bus.responder()
    }

    /// Acts on the machine now.
    pub fn meddle(&mut self, meddle: impl FnOnce(&mut Machine, &mut dyn FnMut(Frame))) {
        let injected = &mut self.injected;
        meddle(self.bus.responder_mut(), &mut |frame| injected.push_back(frame));
    }

    /// Acts on the machine just before the n-th SYNC from now.
    pub fn meddle_after(&mut self, n_syncs: u32, meddle: Meddle) {
        self.meddle = Some((n_syncs, meddle));
    }

    /// Refuses the next frames, as a bus does whose transmit queue is full.
    pub fn refuse(&mut self, n_frames: u32) {
        self.refused = n_frames;
    }

    /// Distorts every answer from now on.
    pub fn distort(&mut self, distort: Distort) {
        self.distort = Some(distort);
    }

    /// Returns the true position of an axis of the plant, SYNC by SYNC.
    pub fn plant_m(&self, axis: usize) -> Vec<f64> {
        self.plant_m.chunks(self.nodes.len()).map(|row| row[axis]).collect()
    }

    /// Returns the commands sent with each SYNC.
    pub fn rows(&self) -> impl Iterator<Item = Row> {
        self.rows.chunks(self.nodes.len()).map(|row| Row {
            target_counts: row.iter().map(|command| command.target_counts).collect(),
            torque: row.iter().map(|command| command.torque_offset).collect(),
            controlword: row.iter().map(|command| command.controlword.0).collect(),
        })
    }

    /// Returns the number of SYNCs so far.
    pub fn n_syncs(&self) -> usize {
        self.rows.len() / self.nodes.len()
    }

    /// Forgets the commands and positions so far, and keeps their memory.
    pub fn forget(&mut self) {
        self.rows.clear();
        self.plant_m.clear();
    }

    fn note(&mut self, frame: &Frame) {
        for (axis, node) in self.nodes.iter().enumerate() {
            if let Some(command) = CommandRpdo1::decode(frame, *node) {
                self.pending[axis] = command;
            }
        }
        if !sync::is_sync(frame) {
            return;
        }
        self.rows.extend_from_slice(&self.pending);
        match self.meddle.take() {
            Some((n, meddle)) if n <= 1 => self.meddle(meddle),
            Some((n, meddle)) => self.meddle = Some((n - 1, meddle)),
            None => {}
        }
    }
}

/// One end of a [`Line`]; the test keeps the other one.
#[derive(Clone)]
pub struct Tap(Arc<Mutex<Line>>);

impl std::fmt::Debug for Tap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tap").finish_non_exhaustive()
    }
}

impl std::fmt::Debug for Line {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Line").field("n_syncs", &self.n_syncs()).finish_non_exhaustive()
    }
}

impl Tap {
    /// Creates a line to the simulated machine of a cell.
    pub fn new(cell: &Cell) -> Self {
        let nodes: Vec<NodeId> = cell.axes.iter().map(|axis| node(axis.node)).collect();
        Self(Arc::new(Mutex::new(Line {
            bus: InProcess::new(machine(cell), FRAMES),
            rows: Vec::with_capacity(ROWS),
            pending: vec![CommandRpdo1::default(); nodes.len()],
            nodes,
            injected: VecDeque::with_capacity(FRAMES),
            meddle: None,
            refused: 0,
            distort: None,
            plant_m: Vec::with_capacity(ROWS),
        })))
    }

    /// Returns the line.
    pub fn line(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Bus for Tap {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let mut line = self.line();
        if line.refused > 0 {
            line.refused -= 1;
            return Err(BusError::Full);
        }
        line.note(frame);
        let sent = line.bus.send(frame);
        if sync::is_sync(frame) {
            let line = &mut *line;
            let plant = line.bus.responder().plant();
            line.plant_m.extend((0..line.nodes.len()).map(|axis| plant.encoder_m(axis)));
        }
        sent
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let mut line = self.line();
        let line = &mut *line;
        loop {
            if let Some(frame) = line.injected.pop_front() {
                return Ok(Some(frame));
            }
            let received = line.bus.recv(timeout)?;
            let (Some(frame), Some(distort)) = (received, &mut line.distort) else {
                return Ok(received);
            };
            let n_syncs = line.rows.len() / line.nodes.len();
            distort(n_syncs, frame, &mut line.injected);
        }
    }
}

/// The loop on a line, and everything it has reported.
#[derive(Debug)]
pub struct Rig {
    /// The loop.
    pub cycle: Cycle,
    /// Its mailbox.
    pub mail: Mailbox,
    /// The bus.
    pub tap: Tap,
    /// Every sample so far.
    pub samples: Vec<Sample>,
    /// Cycles that came with the stop.
    pub before: Vec<Sample>,
    /// Cycles that the flight recorder has told.
    pub recorded: Vec<Stamps>,
    /// Digital inputs as told last.
    pub inputs: InputBits,
    /// States of the drives as told, oldest first.
    pub told_states: Vec<DriveStates>,
    /// Reason of the stop, if the axes were stopped.
    pub reason: Option<StopReason>,
    /// SYNCs sent before the tick in which the stop began.
    pub stopping_at: Option<usize>,
    /// Runs that have ended, with their overruns.
    pub ended: Vec<(u32, u32)>,
    /// Run and table of each start.
    pub started: Vec<(u32, u32)>,
    /// The phase, and the SYNCs sent when it began.
    pub phase: (PhaseName, usize),
    /// Velocity of each axis of the plant when its drive was disabled.
    pub rest_m_s: Vec<f64>,
    /// Samples in a run.
    pub n_samples: usize,
    stop: Arc<AtomicI32>,
    count: Arc<TapCount>,
}

impl Rig {
    /// Brings the nodes up as a campaign does in lock-step, and makes the loop for some runs.
    ///
    /// # Panics
    /// If a node cannot be brought up.
    pub fn new(cell: &Cell, runs: u32) -> Self {
        Self::paced(cell, runs, true)
    }

    /// Same, with a loop paced by the clock; the test makes the ticks: an answer not there in a
    /// tick is late.
    ///
    /// # Panics
    /// If a node cannot be brought up.
    pub fn on_clock(cell: &Cell, runs: u32) -> Self {
        Self::paced(cell, runs, false)
    }

    /// Brings the same nodes up again, as a second controller does, for one run.
    ///
    /// # Panics
    /// If a node cannot be brought up.
    #[must_use]
    pub fn again(&self, cell: &Cell) -> Self {
        Self::on(self.tap.clone(), cell, 1, true)
    }

    /// Returns it with a flight recorder.
    #[must_use]
    pub fn with_recorder(self, clock: Arc<dyn Clock>, late_share: f64) -> Self {
        Self { cycle: self.cycle.recorded(clock, late_share), ..self }
    }

    /// Returns it with the taps of a recording that is not read: their ring is full soon.
    #[must_use]
    pub fn tapped(self, clock: &Arc<MonotonicClock>) -> Self {
        let (records, _rest) = RingBuffer::new(1024);
        let clock: Arc<dyn Clock> = Arc::<MonotonicClock>::clone(clock);
        let period = self.cycle.period();
        let tap = LoopTap::new(records, Arc::clone(&self.count), Some(clock), period);
        Self { cycle: self.cycle.tapped(tap), ..self }
    }

    /// Returns the number of records that the taps have lost.
    pub fn n_lost(&self) -> u64 {
        self.count.lost()
    }

    fn paced(cell: &Cell, runs: u32, lockstep: bool) -> Self {
        Self::on(Tap::new(cell), cell, runs, lockstep)
    }

    /// Same as [`new`](Self::new), with runs that wait for a press of the start button.
    ///
    /// # Panics
    /// If a node cannot be brought up.
    pub fn waiting(cell: &Cell, runs: u32) -> Self {
        Self::with(Tap::new(cell), cell, runs, true, true)
    }

    fn on(tap: Tap, cell: &Cell, runs: u32, lockstep: bool) -> Self {
        Self::with(tap, cell, runs, lockstep, false)
    }

    fn with(mut tap: Tap, cell: &Cell, runs: u32, lockstep: bool, on_input: bool) -> Self {
        let mut maps = Vec::new();
        for axis in &cell.axes {
            let setup = drive_setup(cell, axis, true).expect("a validated cell");
            maps.push(bring_up(&mut tap, &setup).expect("the drive comes up").map);
        }
        if let Some(tool) = &cell.tcp_encoder {
            bring_up_encoder(&mut tap, node(tool.node), Duration::from_secs(1))
                .expect("the encoder comes up");
        }
        tap.send(&NmtCommand::Start.frame(None)).expect("the bus carries");
        let mut plan = Plan::new(cell, None, lockstep).expect("the cell can be run");
        plan.servo.runs = 0..runs;
        plan.servo.starts_on_input = on_input;
        let n_samples = plan.n_samples();
        let stop = Arc::new(AtomicI32::new(0));
        let (mail, loop_side) = mailbox(4096, Arc::clone(&stop));
        let loop_side = loop_side.following(Arc::new(Orders::new(!on_input)));
        let count = Arc::new(TapCount::default());
        let (traffic, _rest) = RingBuffer::new(1024);
        let bus = TappedBus::new(Box::new(tap.clone()), traffic, Arc::clone(&count), None);
        let network = plan.network(Box::new(bus), &maps);
        let cycle = Cycle::new(network, plan.servo, plan.interpolator, loop_side);
        Self {
            cycle,
            mail,
            tap,
            samples: Vec::new(),
            before: Vec::with_capacity(64),
            recorded: Vec::with_capacity(1024),
            inputs: InputBits::default(),
            told_states: Vec::new(),
            reason: None,
            stopping_at: None,
            ended: Vec::new(),
            started: Vec::new(),
            phase: (PhaseName::Enabling, 0),
            rest_m_s: Vec::new(),
            n_samples,
            stop,
            count,
        }
    }

    /// Requests a stop of the loop, as a signal does.
    pub fn ask_to_stop(&self, signal: i32) {
        self.stop.store(signal, Ordering::Relaxed);
    }

    /// Runs one tick, then reads all messages of the loop.
    pub fn tick(&mut self, missed: u32) -> TickStatus {
        let n_syncs = self.tap.line().n_syncs();
        let status = self.cycle.tick(missed);
        self.read_mail(n_syncs);
        status
    }

    /// Reads the messages of a tick that began after `n_syncs` SYNCs.
    pub fn read_mail(&mut self, n_syncs: usize) {
        while let Some(message) = self.mail.read() {
            match message {
                Message::Sample(sample) => self.samples.push(sample),
                Message::Phase(phase, _) => {
                    self.phase = (phase, n_syncs);
                    if phase == PhaseName::Disabling {
                        let line = self.tap.line();
                        let plant = line.machine().plant();
                        let axes = 0..plant.n_axes();
                        self.rest_m_s = axes.map(|axis| plant.encoder_velocity_m_s(axis)).collect();
                    }
                }
                Message::RunStarted { run, table } => self.started.push((run, table)),
                Message::RunEnded { run, overruns, .. } => self.ended.push((run, overruns)),
                Message::Inputs(bits) => self.inputs = bits,
                Message::Drives(states) => self.told_states.push(states),
                Message::Before(sample) => self.before.push(sample),
                Message::Cycle(stamps) => self.recorded.push(stamps),
                Message::Stopping(reason) => {
                    (self.reason, self.stopping_at) = (Some(reason), Some(n_syncs));
                }
            }
        }
    }

    /// Ticks until `there` returns true.
    ///
    /// # Panics
    /// If it never does.
    pub fn tick_until(&mut self, there: impl Fn(&Self) -> bool) {
        for _ in 0..ROWS {
            if there(self) {
                return;
            }
            assert_eq!(self.tick(0), TickStatus::Running, "over too early: {:?}", self.reason);
        }
        panic!("never came there; phase {:?}, reason {:?}", self.phase, self.reason);
    }

    /// Ticks into the middle of a run: until `n` of its samples are measured.
    pub fn tick_into_run(&mut self, run: u32, n: u32) {
        self.tick_until(|rig| rig.samples.last().is_some_and(|last| last.at == Some((run, n))));
    }

    /// Ticks to the end.
    ///
    /// # Panics
    /// If the loop does not end.
    pub fn tick_to_end(&mut self) {
        for _ in 0..ROWS {
            if self.tick(0) == TickStatus::Stopped {
                return;
            }
        }
        panic!("never stopped; phase {:?}, reason {:?}", self.phase, self.reason);
    }

    /// Returns the state of each drive.
    pub fn drive_states(&self) -> Vec<Option<State>> {
        let line = self.tap.line();
        line.nodes.iter().map(|node| line.machine().drive_state(*node)).collect()
    }
}

/// Returns an action that writes 32 bits to an object of a node, as any master on the bus could.
///
/// # Panics
/// Never: eight bytes fit a frame.
pub fn write_object(node: u8, index: u16, value: u32) -> impl Fn(&mut Machine) {
    let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
    let request = Frame::new(0x600 + u16::from(node), &[0x23, low, high, 0, a, b, c, d])
        .expect("eight bytes");
    move |machine| machine.receive(&request, &mut |_| {})
}

/// Returns a valid node number.
///
/// # Panics
/// If it is invalid.
pub fn node(number: u8) -> NodeId {
    NodeId::new(number).expect("1 to 127")
}

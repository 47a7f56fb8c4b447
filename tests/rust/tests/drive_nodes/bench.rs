//! A cell with an ideal plant, and the controller's end of its bus.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ilc_rt::config::Cell;
use ilc_rt::fieldbus::bring_up::{DriveOwn, DriveSetup, SdoClient, bring_up};
use ilc_rt::fieldbus::canopen::{Emergency, NmtCommand, NodeId, sync};
use ilc_rt::fieldbus::cia402::{
    self, CommandRpdo1, Controlword, DriveMotionTpdo2, Mode, PdoMap, State, StatusTpdo1,
    next_command,
};
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::fieldbus::{Bus, Frame};
use ilc_sim::plant::{Demand, Plant};
use ilc_sim::{ClockMode, Machine};

pub(crate) const COUNTS_PER_M: f64 = 1e6;
pub(crate) const CYCLE_US: u32 = 1000;
pub(crate) const START_M: f64 = 0.08;
pub(crate) const VELOCITY_MAX_M_S: f64 = 0.5;
pub(crate) const DECELERATION_M_S2: f64 = 10.0;
pub(crate) const ANSWER: Duration = Duration::from_secs(2);

pub(crate) fn node(number: u8) -> NodeId {
    NodeId::new(number).unwrap()
}

pub(crate) fn counts(position_m: f64) -> i32 {
    cia402::Scale::new(COUNTS_PER_M).unwrap().to_counts(position_m).unwrap()
}

pub(crate) fn cell() -> Cell {
    let axis = |name: &str, node: u8| {
        format!(
            r#"
[[axis]]
name = "{name}"
node = {node}
interface = "csp"
counts_per_m = {COUNTS_PER_M}
[axis.limits]
position_min_m = -0.02
position_max_m = 0.10
velocity_max_m_s = {VELOCITY_MAX_M_S}
acceleration_max_m_s2 = {DECELERATION_M_S2}
jerk_max_m_s3 = 1000.0
following_error_max_m = 0.005
[axis.model]
natural_frequency_hz = 15.0
damping = 1.0
[axis.simulation]
position_start_m = {START_M}
"#
        )
    };
    let text = format!(
        r#"
[cell]
name = "bench"
cycle_us = {CYCLE_US}
[bus]
address = "loopback:"
{}{}
[tcp_encoder]
node = 10
counts_per_m = {COUNTS_PER_M}
[program]
start_m = [0.0, 0.0]
feed_m_s = 0.1
corner = "exact_stop"
[[program.segment]]
to_m = [0.01, 0.01]
"#,
        axis("x", 1),
        axis("y", 2)
    );
    Cell::parse(&text, "bench.toml").unwrap()
}

/// Axes of 1 kg that follow every demand at once; a stuck one does not move at all.
pub(crate) struct Ideal {
    position_m: [f64; 2],
    velocity_m_s: [f64; 2],
    is_stuck: Arc<AtomicBool>,
}

impl Plant for Ideal {
    fn n_axes(&self) -> usize {
        2
    }

    fn step(&mut self, demand: &[Demand], dt_s: f64) {
        for (axis, demand) in demand.iter().enumerate() {
            let wanted_m_s = match *demand {
                Demand::Off => 0.0,
                Demand::Position { position_m, .. } => (position_m - self.position_m[axis]) / dt_s,
                Demand::Velocity { velocity_m_s } => velocity_m_s,
                Demand::Force { force_n } => self.velocity_m_s[axis] + force_n * dt_s,
            };
            let is_stuck = self.is_stuck.load(Ordering::Relaxed);
            self.velocity_m_s[axis] = if is_stuck { 0.0 } else { wanted_m_s };
            self.position_m[axis] = match *demand {
                Demand::Position { position_m, .. } if !is_stuck => position_m,
                _ => self.position_m[axis] + self.velocity_m_s[axis] * dt_s,
            };
        }
    }

    fn encoder_m(&self, axis: usize) -> f64 {
        self.position_m[axis]
    }

    fn encoder_velocity_m_s(&self, axis: usize) -> f64 {
        self.velocity_m_s[axis]
    }

    fn force_n(&self, _axis: usize) -> f64 {
        0.0
    }

    fn tool_m(&self, axis: usize) -> f64 {
        self.position_m[axis] + 0.001
    }
}

/// Frames of drive 1 in one cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Answer {
    pub(crate) status: Option<StatusTpdo1>,
    pub(crate) extra: Option<DriveMotionTpdo2>,
    pub(crate) emergencies: Vec<u16>,
    pub(crate) frames: Vec<Frame>,
}

impl Answer {
    pub(crate) fn position(&self) -> i32 {
        self.status.expect("a status every cycle").position_counts
    }

    pub(crate) fn state(&self) -> State {
        self.status.expect("a status every cycle").statusword.state().expect("a defined state")
    }
}

pub(crate) struct Bench {
    pub(crate) bus: InProcess<Machine>,
    pub(crate) is_stuck: Arc<AtomicBool>,
}

impl Bench {
    pub(crate) fn new(clock: ClockMode) -> Self {
        let is_stuck = Arc::new(AtomicBool::new(false));
        let plant = Ideal {
            position_m: [START_M; 2],
            velocity_m_s: [0.0; 2],
            is_stuck: Arc::clone(&is_stuck),
        };
        let machine = Machine::with_plant(&cell(), clock, Box::new(plant)).unwrap();
        Self { bus: InProcess::new(machine, 4096), is_stuck }
    }

    /// Creates a bench with drive 1 brought up and operational, not yet enabled.
    pub(crate) fn started(mode: Mode) -> Self {
        let mut bench = Self::new(ClockMode::LockStep);
        bring_up(&mut bench.bus, &setup(mode)).unwrap();
        bench.bus.send(&NmtCommand::Start.frame(None)).unwrap();
        bench
    }

    /// Creates a bench with drive 1 enabled, holding its position.
    pub(crate) fn enabled(mode: Mode) -> Self {
        let mut bench = Self::started(mode);
        bench.enable(if mode == Mode::Csp { counts(START_M) } else { 0 });
        bench
    }

    pub(crate) fn enable(&mut self, target_counts: i32) {
        let mut state = self.sync().state();
        for _ in 0..6 {
            if state == State::OperationEnabled {
                return;
            }
            state = self.cycle(next_command(state), target_counts).state();
        }
        panic!("not enabled but {state}");
    }

    /// Runs one cycle: command first, then SYNC, at which the drive takes over the last command.
    pub(crate) fn cycle(&mut self, controlword: Controlword, target_counts: i32) -> Answer {
        let command = CommandRpdo1 { controlword, target_counts, ..CommandRpdo1::default() };
        self.bus.send(&command.encode(node(1))).unwrap();
        self.sync()
    }

    /// Runs one cycle of an enabled drive.
    pub(crate) fn follow(&mut self, target_counts: i32) -> Answer {
        self.cycle(Controlword::ENABLE_OPERATION, target_counts)
    }

    /// Runs one cycle without a command.
    pub(crate) fn sync(&mut self) -> Answer {
        self.bus.send(&sync::frame()).unwrap();
        self.collect()
    }

    pub(crate) fn collect(&mut self) -> Answer {
        let mut answer = Answer::default();
        while let Some(frame) = self.bus.recv(Duration::ZERO).unwrap() {
            if let Some(status) = StatusTpdo1::decode(&frame, node(1)) {
                answer.status = Some(status);
            }
            if let Some(extra) = DriveMotionTpdo2::decode(&frame, node(1)) {
                answer.extra = Some(extra);
            }
            if let Some(emergency) = Emergency::decode(&frame) {
                answer.emergencies.push(emergency.code);
            }
            answer.frames.push(frame);
        }
        answer
    }

    pub(crate) fn write(&mut self, index: u16, sub: u8, bytes: &[u8]) {
        SdoClient::new(node(1), ANSWER).download(&mut self.bus, index, sub, bytes).unwrap();
    }

    pub(crate) fn read(&mut self, index: u16, sub: u8) -> u32 {
        SdoClient::new(node(1), ANSWER).upload_u32(&mut self.bus, index, sub).unwrap()
    }
}

pub(crate) fn setup(mode: Mode) -> DriveSetup {
    DriveSetup {
        node: node(1),
        mode,
        map: PdoMap::full(mode),
        cycle_us: CYCLE_US,
        following_error_max_counts: 5000,
        position_min_counts: counts(-0.02),
        position_max_counts: counts(0.10),
        velocity_max_counts_s: 500_000,
        acceleration_max_counts_s2: 10_000_000,
        position_unit: None,
        velocity_unit: None,
        torque_max: 0,
        needs_torque_offset: false,
        heartbeat_ms: 0,
        rpdo_deadline_ms: 0,
        controller: node(127),
        answer_timeout: ANSWER,
        own: DriveOwn::default(),
        is_to_be_homed: false,
    }
}

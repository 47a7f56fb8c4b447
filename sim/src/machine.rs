//! A whole simulated machine: its nodes, its plant, and their common time.

mod error;
mod parameters;

use std::collections::VecDeque;

use ilc_rt::config::Cell;
use ilc_rt::fieldbus::Frame;
use ilc_rt::fieldbus::canopen::{NmtState, NodeId, sync};
use ilc_rt::fieldbus::cia402::State;
use ilc_rt::fieldbus::transport::Responder;

use crate::event::{Change, Event};
use crate::node::{Dictionary, DriveNode, EncoderNode};
use crate::plant::{Demand, Gantry, Mechanisms, Plant};
use crate::script::{Happening, Script};

pub use error::MachineError;

/// Number of events kept until they are taken; older ones are dropped.
const EVENTS_MAX: usize = 64;

/// Source of the machine's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockMode {
    /// Every SYNC advances the machine by one cycle, before the nodes sample.
    LockStep,
    /// [`Machine::advance`], at the pace of its caller.
    RealTime,
}

/// A drive on its axis, and its last published state.
#[derive(Clone, Debug)]
struct Axis {
    drive: DriveNode,
    is_muted: bool,
    nmt: NmtState,
    state: State,
    /// Share of its force available to the motor.
    force_share: f64,
}

/// The encoder of the tool, and its last published state.
#[derive(Clone, Debug)]
struct Tool {
    encoder: EncoderNode,
    is_muted: bool,
    nmt: NmtState,
}

/// All nodes of a cell, and their plant.
///
/// # Real Time
/// Set-up allocates; [`receive`](Responder::receive) and [`advance`](Self::advance) do not.
pub struct Machine {
    clock: ClockMode,
    axes: Vec<Axis>,
    tool: Option<Tool>,
    plant: Box<dyn Plant>,
    demands: Vec<Demand>,
    cycle_us: u32,
    step_us: u32,
    time_us: u64,
    has_booted: bool,
    events: VecDeque<Event>,
    script: Script,
}

impl Machine {
    /// Creates the machine of a cell description, at rest and not yet booted.
    ///
    /// # Errors
    /// [`MachineError`] for an unvalidated cell.
    pub fn from_cell(cell: &Cell, clock: ClockMode) -> Result<Self, MachineError> {
        let plant: Box<dyn Plant> = match &cell.simulation.delta {
            Some(delta) => Box::new(Mechanisms::from_cell(cell, delta)?),
            None => Box::new(Gantry::from_cell(cell)),
        };
        Self::with_plant(cell, clock, plant)
    }

    /// Creates the same nodes on another plant.
    ///
    /// # Errors
    /// [`MachineError`] for an unvalidated cell, or a plant with another number of axes.
    pub fn with_plant(
        cell: &Cell,
        clock: ClockMode,
        plant: Box<dyn Plant>,
    ) -> Result<Self, MachineError> {
        if plant.n_axes() != cell.n_axes() {
            return Err(MachineError::Axes { expected: cell.n_axes(), found: plant.n_axes() });
        }
        let node_of = |number| NodeId::new(number).ok_or(MachineError::Node(number));
        let mut axes = Vec::with_capacity(cell.n_axes());
        for axis in &cell.axes {
            let node = node_of(axis.node)?;
            let parameters = parameters::of(cell, axis);
            let drive = DriveNode::new(node, parameters)
                .map_err(|code| MachineError::Dictionary { node, code })?;
            let (nmt, state) = (drive.nmt(), drive.state());
            axes.push(Axis { drive, is_muted: false, nmt, state, force_share: 1.0 });
        }
        let tool = match cell.tcp_encoder {
            None => None,
            Some(described) => {
                let node = node_of(described.node)?;
                let encoder = EncoderNode::new(node, described.counts_per_m)
                    .map_err(|code| MachineError::Dictionary { node, code })?;
                let nmt = encoder.nmt();
                Some(Tool { encoder, is_muted: false, nmt })
            }
        };
        let mut machine = Self {
            clock,
            demands: vec![Demand::Off; axes.len()],
            axes,
            tool,
            plant,
            cycle_us: cell.cell.cycle_us,
            step_us: cell.simulation.step_us,
            time_us: 0,
            has_booted: false,
            events: VecDeque::with_capacity(EVENTS_MAX),
            script: Script::new(cell),
        };
        machine.measure_axes();
        machine.measure_tool();
        Ok(machine)
    }

    /// Powers the nodes: each sends its boot-up. Otherwise done by the first frame or step.
    pub fn boot(&mut self, out: &mut dyn FnMut(Frame)) {
        if self.has_booted {
            return;
        }
        self.has_booted = true;
        for axis in self.axes.iter_mut().filter(|axis| !axis.is_muted) {
            axis.drive.boot(out);
        }
        if let Some(tool) = self.tool.as_mut().filter(|tool| !tool.is_muted) {
            tool.encoder.boot(out);
        }
        self.note_changes();
    }

    /// Advances by `n_steps` steps of the drives' own loops.
    pub fn advance(&mut self, n_steps: u32, out: &mut dyn FnMut(Frame)) {
        self.boot(out);
        for _ in 0..n_steps {
            self.step(out);
        }
        self.measure_tool();
    }

    /// Cuts the power of a node: it sends no more frames, and its axis is braked. Returns true if
    /// the node exists.
    pub fn mute(&mut self, node: NodeId) -> bool {
        let axis = self.axes.iter_mut().find(|axis| axis.drive.node() == node);
        let tool = self.tool.as_mut().filter(|tool| tool.encoder.node() == node);
        let is_muted = match (axis, tool) {
            (Some(axis), _) => &mut axis.is_muted,
            (None, Some(tool)) => &mut tool.is_muted,
            (None, None) => return false,
        };
        if !std::mem::replace(is_muted, true) {
            self.note(node, Change::Muted);
        }
        true
    }

    /// Switches the digital inputs of a drive that are on beside its switches. Returns true if it exists.
    pub fn set_inputs(&mut self, node: NodeId, inputs: u32) -> bool {
        let axis = self.axes.iter_mut().find(|axis| axis.drive.node() == node);
        axis.map(|axis| axis.drive.set_inputs(inputs)).is_some()
    }

    /// Activates the safe torque off of all drives, as an emergency stop does, or releases it.
    pub fn set_torque_off(&mut self, is_off: bool) {
        self.axes.iter_mut().for_each(|axis| axis.drive.set_torque_off(is_off));
    }

    /// Returns the time since power-on.
    pub fn time_us(&self) -> u64 {
        self.time_us
    }

    /// Returns the step of the drives' own loops.
    pub fn step_us(&self) -> u32 {
        self.step_us
    }

    /// Returns the plant, for reading.
    pub fn plant(&self) -> &dyn Plant {
        self.plant.as_ref()
    }

    /// Returns the state of the drive at `node`, if there is one.
    pub fn drive_state(&self, node: NodeId) -> Option<State> {
        self.axes.iter().find(|axis| axis.drive.node() == node).map(|axis| axis.drive.state())
    }

    /// Returns whether any drive has power over its axis, so that it may move.
    pub fn is_energised(&self) -> bool {
        self.axes.iter().any(|axis| {
            let state = axis.drive.state();
            !axis.is_muted
                && matches!(
                    state,
                    State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive
                )
        })
    }

    /// Returns the objects of `node`, if it exists.
    pub fn dictionary(&self, node: NodeId) -> Option<&Dictionary> {
        let tool = self.tool.iter().map(|tool| (tool.encoder.node(), tool.encoder.dictionary()));
        let drives = self.axes.iter().map(|axis| (axis.drive.node(), axis.drive.dictionary()));
        drives.chain(tool).find(|(found, _)| *found == node).map(|(_, dictionary)| dictionary)
    }

    /// Returns all nodes: the axes in order, then the encoder.
    pub fn nodes(&self) -> impl Iterator<Item = NodeId> {
        let tool = self.tool.iter().map(|tool| tool.encoder.node());
        self.axes.iter().map(|axis| axis.drive.node()).chain(tool)
    }

    /// Takes the oldest event.
    pub fn take_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    fn step(&mut self, out: &mut dyn FnMut(Frame)) {
        while let Some((axis, what)) = self.script.due(self.time_us) {
            let Some(axis) = self.axes.get_mut(axis) else { continue };
            match what {
                Happening::Inputs(inputs) => axis.drive.set_inputs(inputs),
                Happening::TorqueOff(is_off) => axis.drive.set_torque_off(is_off),
            }
        }
        for (number, (axis, demand)) in self.axes.iter_mut().zip(&mut self.demands).enumerate() {
            let share = axis.drive.force_share();
            if std::mem::replace(&mut axis.force_share, share).to_bits() != share.to_bits() {
                self.plant.limit_force(number, share);
            }
            *demand = if axis.is_muted { Demand::Off } else { axis.drive.step(self.step_us, out) };
            self.plant.feed_force(number, axis.drive.force_offset_n());
        }
        if let Some(tool) = self.tool.as_mut().filter(|tool| !tool.is_muted) {
            tool.encoder.step(self.step_us, out);
        }
        self.plant.step(&self.demands, f64::from(self.step_us) * 1e-6);
        self.time_us += u64::from(self.step_us);
        self.measure_axes();
        self.note_changes();
    }

    fn measure_axes(&mut self) {
        for (number, axis) in self.axes.iter_mut().enumerate() {
            axis.drive.measure(self.plant.measured(number));
        }
    }

    /// The encoder of the tool shows only what it is asked for, so that steps need not measure it.
    fn measure_tool(&mut self) {
        if let Some(tool) = &mut self.tool {
            tool.encoder.measure([self.plant.tool_m(0), self.plant.tool_m(1)]);
        }
    }

    fn note_changes(&mut self) {
        let time_us = self.time_us;
        let mut note = |node, change| push(&mut self.events, Event { time_us, node, change });
        for axis in &mut self.axes {
            let node = axis.drive.node();
            if let Some(code) = axis.drive.take_emergency() {
                note(node, Change::Emergency(code));
            }
            if std::mem::replace(&mut axis.nmt, axis.drive.nmt()) != axis.nmt {
                note(node, Change::Nmt(axis.nmt));
            }
            if std::mem::replace(&mut axis.state, axis.drive.state()) != axis.state {
                note(node, Change::Drive(axis.state));
            }
        }
        if let Some(tool) = &mut self.tool {
            let node = tool.encoder.node();
            if let Some(code) = tool.encoder.take_emergency() {
                note(node, Change::Emergency(code));
            }
            if std::mem::replace(&mut tool.nmt, tool.encoder.nmt()) != tool.nmt {
                note(node, Change::Nmt(tool.nmt));
            }
        }
    }

    fn note(&mut self, node: NodeId, change: Change) {
        push(&mut self.events, Event { time_us: self.time_us, node, change });
    }
}

fn push(events: &mut VecDeque<Event>, event: Event) {
    if events.len() == EVENTS_MAX {
        events.pop_front();
    }
    events.push_back(event);
}

impl Responder for Machine {
    /// Handles a frame from the bus. In lock-step a SYNC first advances one cycle, so that the
    /// nodes' answers are the state at the end of that cycle.
    fn receive(&mut self, frame: &Frame, reply: &mut dyn FnMut(Frame)) {
        self.boot(reply);
        if self.clock == ClockMode::LockStep && sync::is_sync(frame) {
            self.advance(self.cycle_us / self.step_us, reply);
        }
        for axis in self.axes.iter_mut().filter(|axis| !axis.is_muted) {
            axis.drive.receive(frame, reply);
        }
        if let Some(tool) = self.tool.as_mut().filter(|tool| !tool.is_muted) {
            tool.encoder.receive(frame, reply);
        }
        self.note_changes();
    }
}

impl std::fmt::Debug for Machine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Machine")
            .field("clock", &self.clock)
            .field("axes", &self.axes)
            .field("tool", &self.tool)
            .field("time_us", &self.time_us)
            .finish_non_exhaustive()
    }
}

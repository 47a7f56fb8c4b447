//! The player: the loop of a recording, built again, and ticked on what it read.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use rtrb::{Consumer, RingBuffer};

use super::compare;
use super::line::ReplayBus;
use super::relearned::Relearned;
use super::{Difference, ReplayError, Replayed, Tick};
use crate::campaign::recording::digest;
use crate::config::{Cell, Measure};
use crate::design::{DesignError, Plan};
use crate::fieldbus::cia402::PdoMap;
use crate::fieldbus::frame::FD_PAYLOAD_MAX;
use crate::fieldbus::transport::{BusEvent, TapCount};
use crate::interpolate::MAX_AXES;
use crate::record::{NAME_MAX, printable};
use crate::recording::{
    AxisMessage, CycleMessage, LoopSetup, TableMessage, Traffic, column_digest, read_event,
};
use crate::servo::{Cycle, LoopRecord, Mailbox, Message, Orders, OrdersSeen, Tap, mailbox};
use crate::trajectory::Interpolator;

/// Largest number of samples of an experiment.
const SAMPLES_MAX: usize = 100_000_000;
/// Messages of one tick, with those of a stop.
const MESSAGES: usize = 4096;

/// A loop that is replayed.
pub(super) struct Player {
    cycle: Cycle,
    mail: Mailbox,
    bus: ReplayBus,
    rows: Consumer<LoopRecord>,
    orders: Arc<Orders>,
    stop: Arc<AtomicI32>,
    plan: Plan,
    maps: Vec<PdoMap>,
    names: Vec<String>,
    tables: BTreeMap<u32, Vec<f64>>,
    table: u32,
    relearned: Relearned,
    /// Table whose recorded digest is not its own: reported unless a tick shows where.
    doubt: Option<Difference>,
    result: Replayed,
}

impl Player {
    pub(super) fn new(setup: LoopSetup, cell: &Cell) -> Result<Self, ReplayError> {
        if setup.axes.len() != cell.n_axes() || setup.hold_samples > Some(SAMPLES_MAX) {
            let (axes, samples) = (setup.axes.len(), setup.hold_samples.unwrap_or_default());
            return Err(ReplayError::Contradiction {
                what: format!(
                    "the recording has {axes} axes and {samples} samples at rest; its cell has {} axes, and at \
                     most {SAMPLES_MAX} samples are replayed",
                    cell.n_axes()
                ),
            });
        }
        let measure = if setup.measure == "tcp" { Measure::Tcp } else { Measure::Encoder };
        let plan = planned(&setup, cell, measure)?;
        if digest(&plan.reference_m) != setup.set_points_digest {
            return Err(ReplayError::OtherSetPoints {
                this: env!("CARGO_PKG_VERSION"),
                then: printable(&setup.program_version, NAME_MAX),
            });
        }
        let maps: Vec<PdoMap> =
            setup.maps.iter().map(PdoMap::try_from).collect::<Result<_, _>>()?;
        if maps.len() != cell.n_axes() {
            return Err(ReplayError::Contradiction {
                what: format!(
                    "the recording has the process data of {} axes, its cell has {}",
                    maps.len(),
                    cell.n_axes()
                ),
            });
        }
        for (axis, map) in cell.axes.iter().zip(&maps) {
            map.check(axis.interface, FD_PAYLOAD_MAX)?;
        }
        let relearned = Relearned::new(&setup, cell, &plan)?;
        let stop = Arc::new(AtomicI32::new(0));
        let orders = Arc::new(Orders::default());
        let (mail, loop_side) = mailbox(MESSAGES, Arc::clone(&stop));
        let loop_side = loop_side.following(Arc::clone(&orders));
        let bus = ReplayBus::default();
        let network = plan.network(Box::new(bus.clone()), &maps);
        let (records, rows) = RingBuffer::new(MAX_AXES + 2);
        let tap = Tap::new(records, Arc::new(TapCount::default()), None, plan.servo.cycle);
        let cycle = Cycle::new(network, plan.servo.clone(), plan.interpolator.clone(), loop_side);
        let result =
            Replayed { law_is_not_run: setup.law_is_not_run.clone(), ..Replayed::default() };
        Ok(Self {
            cycle: cycle.tapped(tap),
            mail,
            bus,
            rows,
            orders,
            stop,
            plan,
            maps,
            names: setup.axes,
            tables: BTreeMap::new(),
            table: 0,
            relearned,
            doubt: None,
            result,
        })
    }

    /// Returns the number of axes.
    pub(super) fn n_axes(&self) -> usize {
        self.names.len()
    }

    /// Returns the cycle that comes next.
    pub(super) fn next_cycle(&self) -> u64 {
        self.result.cycles
    }

    /// Takes an input table of the recording.
    pub(super) fn table(&mut self, message: TableMessage) {
        let n_axes = self.n_axes();
        for (axis, name) in self.names.iter().enumerate() {
            let replayed = column_digest(&message.input, axis, n_axes);
            let recorded = message.digests.get(axis).cloned().unwrap_or_default();
            if recorded != replayed && self.doubt.is_none() {
                self.doubt = Some(Difference {
                    cycle: self.result.cycles,
                    axes: vec![name.clone()],
                    field: format!("digest of the learned input in table {}", message.table),
                    recorded,
                    replayed,
                });
            }
        }
        self.relearned.recorded(message.table, message.input.clone());
        self.tables.insert(message.table, message.input);
        // The loop has two that wait and one in use.
        while self.tables.len() > 8 {
            self.tables.pop_first();
        }
    }

    /// Runs a tick and compares it; returns false at the first difference.
    ///
    /// # Errors
    /// A sentence on what the recording lacks or contradicts.
    pub(super) fn tick(&mut self, tick: &Tick) -> Result<bool, String> {
        let Some(recorded) = &tick.cycle else { return Err("a tick without a cycle".to_owned()) };
        let number = recorded.cycle;
        self.feed(tick, recorded)?;
        self.cycle.tick(recorded.missed);
        self.result.cycles += 1;
        let (unlike, n_untaken) = self.bus.line().end();
        if let Some(difference) = self.compare(recorded, &tick.axes) {
            self.result.difference = Some(difference);
            return Ok(false);
        }
        if let Some(unlike) = unlike {
            let parts = (&self.plan, &self.maps[..], &self.names[..]);
            self.result.difference = Some(compare::frame(number, unlike, parts));
            return Ok(false);
        }
        if n_untaken > 0 {
            self.result.difference = Some(Difference {
                cycle: number,
                axes: self.names.clone(),
                field: "messages taken from the bus".to_owned(),
                recorded: tick.frames.received.len().to_string(),
                replayed: (tick.frames.received.len() - n_untaken).to_string(),
            });
            return Ok(false);
        }
        self.learn(number);
        Ok(self.result.difference.is_none())
    }

    /// Gives the loop what it read in a recorded tick.
    fn feed(&mut self, tick: &Tick, recorded: &CycleMessage) -> Result<(), String> {
        let number = recorded.cycle;
        let events = |traffic, texts: &[String]| -> Result<Vec<BusEvent>, String> {
            let event = |text: &String| {
                read_event(traffic, text)
                    .ok_or_else(|| format!("cycle {number}: `{text}` is no frame"))
            };
            texts.iter().map(event).collect()
        };
        let frames = &tick.frames;
        let is_ours = frames.cycle == number;
        let of = |texts: &[String]| if is_ours { texts.to_vec() } else { Vec::new() };
        let received = events(Traffic::Received, &of(&frames.received))?;
        let sent = events(Traffic::Sent, &of(&frames.sent))?;
        self.bus.line().begin(received, sent);
        self.orders.restore(OrdersSeen {
            released: recorded.released,
            feed_percent: recorded.feed_percent,
            is_paused: recorded.paused,
        });
        self.stop.store(recorded.asked, Ordering::Relaxed);
        if recorded.table != self.table {
            let Some(input) = self.tables.get(&recorded.table) else {
                return Err(format!("cycle {number}: table {} is missing", recorded.table));
            };
            // The ring is empty: the loop takes a table in the tick that is given it.
            let _ = self.mail.send_table(recorded.table, input.clone().into_boxed_slice());
            self.table = recorded.table;
        }
        Ok(())
    }

    /// Compares what the tap of the replayed loop has with the recording.
    fn compare(&mut self, recorded: &CycleMessage, axes: &[AxisMessage]) -> Option<Difference> {
        let cycle = recorded.cycle;
        let mut own = None;
        let mut rows = Vec::with_capacity(axes.len());
        while let Ok(record) = self.rows.pop() {
            match record {
                LoopRecord::Loop(row) => own = Some(CycleMessage::from(&row)),
                LoopRecord::Axis(row) => rows.push(AxisMessage::new(cycle, &row)),
                LoopRecord::Stamps(_) => {}
            }
        }
        for ((name, then), now) in self.names.iter().zip(axes).zip(&rows) {
            if let Some((field, recorded, replayed)) = compare::field(then, now) {
                return Some(Difference {
                    cycle,
                    axes: vec![name.clone()],
                    field,
                    recorded,
                    replayed,
                });
            }
        }
        let (field, recorded, replayed) = match own {
            Some(own) => compare::field(recorded, &own)?,
            None => ("cycle".to_owned(), cycle.to_string(), "none".to_owned()),
        };
        Some(Difference { cycle, axes: self.names.clone(), field, recorded, replayed })
    }

    /// Runs the law again after the runs that end in this tick.
    fn learn(&mut self, cycle: u64) {
        while let Some(message) = self.mail.read() {
            if let Message::RunEnded { .. } = message {
                self.result.runs += 1;
            }
            self.relearned.take(&message);
        }
        self.result.difference = self.relearned.difference(cycle, &self.names);
    }

    /// Returns the result.
    pub(super) fn end(mut self) -> Replayed {
        self.result.frames = self.bus.line().n_sent();
        self.result.learned = self.relearned.n_compared();
        let last = self.result.cycles;
        self.result.difference = self
            .result
            .difference
            .or_else(|| self.relearned.difference(last, &self.names))
            .or(self.doubt);
        self.result
    }
}

/// Plans the loop as it was planned.
fn planned(setup: &LoopSetup, cell: &Cell, measure: Measure) -> Result<Plan, DesignError> {
    let mut plan = match setup.hold_samples {
        None => Plan::new(cell, Some(measure), setup.lockstep)?,
        Some(n_samples) => {
            let hold = Interpolator::hold(&cell.program.start_m, n_samples, cell.cycle_s());
            let hold = hold.map_err(|source| DesignError::Program {
                file: cell.file.display().to_string(),
                key: "[program] start_m".to_owned(),
                source: Box::new(source),
                units: cell.units(),
            })?;
            Plan::with(cell, Some(measure), setup.lockstep, hold, String::new())?
        }
    };
    plan.simulated = setup.simulated;
    plan.servo.runs = setup.runs.clone();
    plan.servo.resets_faults = setup.resets_faults;
    plan.servo.starts_on_input = setup.starts_on_input;
    plan.servo.hold_cycles_max = setup.hold_cycles_max;
    plan.servo.overrun_cycles_max = setup.overrun_cycles_max;
    Ok(plan)
}

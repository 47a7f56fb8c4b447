//! Ticks of the servo loop alone, to count their instructions (`benchmarks/instructions.py`).
//!
//! `ticks AXES N` makes the same ticks twice: first with simulated drives, whose answers are written down, then
//! with nothing but these answers, `N` ticks into the first run. The difference between two `N` is the loop's.

use std::collections::VecDeque;
use std::error::Error;
use std::sync::atomic::AtomicI32;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use ilc_rt::campaign::drive_setup;
use ilc_rt::config::Cell;
use ilc_rt::design::Plan;
use ilc_rt::fieldbus::bring_up::bring_up;
use ilc_rt::fieldbus::canopen::{NmtCommand, sync};
use ilc_rt::fieldbus::transport::InProcess;
use ilc_rt::fieldbus::{Bus, BusError, Frame};
use ilc_rt::servo::{Cycle, Mailbox, Message, Orders, mailbox};
use ilc_sim::Machine;
use ilc_tests::campaign::machine;

/// Ticks that are written down.
const N_WRITTEN: u32 = 12_000;

type Answers = Arc<Mutex<Vec<VecDeque<Frame>>>>;

/// Drives that write down their answers to each SYNC, or the answers alone.
struct Drives {
    machine: InProcess<Machine>,
    answers: Answers,
    /// In place of the machine, once bring-up is over: the SYNCs so far, and what is left of the answers.
    repeats: Option<(usize, VecDeque<Frame>)>,
    is_up: bool,
}

impl Bus for Drives {
    fn send(&mut self, frame: &Frame) -> Result<(), BusError> {
        let mut answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
        if sync::is_sync(frame) {
            self.is_up = true;
            match &mut self.repeats {
                Some((n_syncs, left)) => {
                    *left = answers.get_mut(*n_syncs).map(std::mem::take).unwrap_or_default();
                    *n_syncs += 1;
                }
                None => answers.push(VecDeque::new()),
            }
        }
        if self.is_up && self.repeats.is_some() { Ok(()) } else { self.machine.send(frame) }
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        if let (Some((_, left)), true) = (&mut self.repeats, self.is_up) {
            return Ok(left.pop_front());
        }
        let frame = self.machine.recv(timeout)?;
        let mut answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
        if let (Some(frame), Some(answers)) = (frame, answers.last_mut()) {
            answers.push_back(frame);
        }
        Ok(frame)
    }
}

/// A cell with this number of axes in csp, which move together.
fn cell(n_axes: u8) -> Result<Cell, Box<dyn Error>> {
    let axis = |node: u8| {
        format!(
            "[[axis]]\nname = \"a{node}\"\nnode = {node}\ninterface = \"csp\"\ncounts_per_m = 1e6\n\n\
             [axis.limits]\nposition_min_m = -0.1\nposition_max_m = 0.5\nvelocity_max_m_s = 0.5\n\
             acceleration_max_m_s2 = 5.0\njerk_max_m_s3 = 500.0\nfollowing_error_max_m = 0.02\n\n\
             [axis.model]\nnatural_frequency_hz = 15.0\ndamping = 1.0\n\n"
        )
    };
    let axes: String = (1..=n_axes).map(axis).collect();
    let row = |value: f64| format!("{:?}", vec![value; usize::from(n_axes)]);
    let text = format!(
        "[cell]\nname = \"ticks\"\ncycle_us = 1000\n\n[bus]\naddress = \"loopback:\"\n\n{axes}\
         [program]\nstart_m = {}\nfeed_m_s = 0.05\n\n[[program.segment]]\nto_m = {}\n\n\
         [[program.segment]]\nto_m = {}\n\n[learning]\nlaw = \"none\"\n",
        row(0.0),
        row(0.4),
        row(0.0)
    );
    Ok(Cell::parse(&text, "ticks.toml")?)
}

/// Brings the drives up, and returns the loop.
fn brought_up(cell: &Cell, mut bus: Drives) -> Result<(Cycle, Mailbox), Box<dyn Error>> {
    let mut maps = Vec::new();
    for axis in &cell.axes {
        maps.push(bring_up(&mut bus, &drive_setup(cell, axis, true)?)?.map);
    }
    bus.send(&NmtCommand::Start.frame(None))?;
    let mut plan = Plan::new(cell, None, true)?;
    plan.servo.runs = 0..u32::MAX;
    let (mail, loop_side) = mailbox(4096, Arc::new(AtomicI32::new(0)));
    let network = plan.network(Box::new(bus), &maps);
    let loop_side = loop_side.following(Arc::new(Orders::new(true)));
    Ok((Cycle::new(network, plan.servo, plan.interpolator, loop_side), mail))
}

/// Makes ticks, and returns how many of them were in a run.
fn tick(cell: &Cell, answers: &Answers, repeats: bool, n: u32) -> Result<u32, Box<dyn Error>> {
    let bus = Drives {
        machine: InProcess::new(machine(cell), 256),
        answers: Arc::clone(answers),
        repeats: repeats.then(Default::default),
        is_up: false,
    };
    let (mut cycle, mut mail) = brought_up(cell, bus)?;
    let mut n_samples = 0;
    for _ in 0..n {
        cycle.tick(0);
        while let Some(message) = mail.read() {
            match message {
                Message::Sample(sample) => n_samples += u32::from(sample.at.is_some()),
                Message::Stopping(reason) => return Err(format!("stopped: {reason:?}").into()),
                _ => {}
            }
        }
    }
    Ok(n_samples)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut next = || arguments.next().ok_or("usage: ticks AXES N");
    let (n_axes, n): (u8, u32) = (next()?.parse()?, next()?.parse()?);
    let (cell, answers) = (cell(n_axes)?, Answers::default());
    tick(&cell, &answers, false, N_WRITTEN)?;
    let n_samples = tick(&cell, &answers, true, n.min(N_WRITTEN))?;
    let mut told = std::io::stdout();
    std::io::Write::write_fmt(&mut told, format_args!("{n_samples}\n"))?;
    Ok(())
}

//! Cycles of a homing on the bus: commands, SYNC, answers, until every drive of a turn is off. For `homing` only.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};
use std::time::{Duration, Instant};

use super::Report;
use super::seeker::Seeker;
use crate::campaign::options::Session;
use crate::campaign::{inputs, nodes};
use crate::config::{Axis, Cell};
use crate::fieldbus::canopen::{NmtCommand, NodeId, sync};
use crate::fieldbus::cia402::pdo_map::{COMMAND_PDO, STATUS_PDO};
use crate::fieldbus::cia402::{PdoMap, Scale};
use crate::fieldbus::{Bus, BusError, Frame};

/// Time between two reports.
const REPORT_S: f64 = 0.2;
/// Time between two looks at guards and stop buttons.
const LOOK_S: f64 = 0.05;

/// A drive of the turn.
pub(super) type Station = (NodeId, Scale, Seeker);

/// A turn in progress.
pub(super) struct Round<'a> {
    cell: &'a Cell,
    session: &'a Session,
    axes: &'a [&'a Axis],
    stations: &'a mut [Station],
    map: PdoMap,
    cycle: Duration,
    /// Cycles between two reports.
    every: u32,
    /// Cycles between two looks at guards and stop buttons, if the cell has any.
    look_every: Option<u32>,
    /// In lock-step: the time to wait for the answers.
    wait: Option<Duration>,
    stop: Arc<AtomicI32>,
}

impl<'a> Round<'a> {
    pub(super) fn new(
        cell: &'a Cell,
        session: &'a Session,
        axes: &'a [&'a Axis],
        stations: &'a mut [Station],
    ) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small")]
        let cycles = |span_s: f64| ((span_s / cell.cycle_s()) as u32).max(1);
        let every = cycles(REPORT_S);
        let look_every = cell.inputs.iter().any(inputs::stops_all).then(|| cycles(LOOK_S));
        Self {
            cell,
            session,
            axes,
            stations,
            map: PdoMap::of_homing(),
            cycle: Duration::from_secs_f64(cell.cycle_s()),
            every,
            look_every,
            wait: session.lockstep.then(|| nodes::timeout(cell, session)),
            stop: Arc::clone(&session.stop),
        }
    }

    /// Goes on until every drive is off; returns the reason of the caller to stop, if it gave one.
    ///
    /// # Errors
    /// [`BusError`]; the drives stop by themselves, as no command comes any more.
    pub(super) fn pursue(
        mut self,
        bus: &mut dyn Bus,
        began: &str,
        report: &mut Report<'_>,
    ) -> Result<Option<String>, BusError> {
        let mut wish = report(Some(began));
        for (node, _, _) in self.stations.iter() {
            bus.send(&NmtCommand::Start.frame(Some(*node)))?;
        }
        let mut next = Instant::now();
        for cycle in 1_u32.. {
            next = (next + self.cycle).max(Instant::now());
            let has_failed = self.stations.iter().any(|(_, _, seeker)| seeker.failure().is_some());
            if has_failed || wish.is_some() || self.stop.load(Ordering::Relaxed) != 0 {
                self.stations.iter_mut().for_each(|(_, _, seeker)| seeker.break_off());
            }
            self.exchange(bus, next)?;
            if self.stations.iter().all(|(_, _, seeker)| seeker.is_over()) {
                break;
            }
            if wish.is_none() && self.look_every.is_some_and(|every| cycle.is_multiple_of(every)) {
                wish = self.look(bus);
            }
            if wish.is_none() {
                let line = cycle.is_multiple_of(self.every).then(|| self.described());
                wish = report(line.as_deref());
            }
        }
        Ok(wish)
    }

    /// Asks the drives for their inputs, between two cycles; returns the reason of an input to stop.
    fn look(&self, bus: &mut dyn Bus) -> Option<String> {
        match nodes::read_inputs(self.cell, bus, self.session) {
            Ok(words) => inputs::forbidding(self.cell, &words),
            Err(error) => Some(error.to_string()),
        }
    }

    fn described(&self) -> String {
        let shown = self.axes.iter().zip(self.stations.iter()).map(|(axis, (_, scale, seeker))| {
            let at_m = seeker.counts().map_or(f64::NAN, |counts| scale.position_m(counts));
            format!("{} shows {at_m:.6} {}", axis.name, axis.unit.symbol())
        });
        format!("homing: {}", shown.collect::<Vec<_>>().join(", "))
    }

    /// One cycle: commands, SYNC, answers until the next one is due.
    fn exchange(&mut self, bus: &mut dyn Bus, next: Instant) -> Result<(), BusError> {
        for (node, _, seeker) in self.stations.iter() {
            let command = seeker.command().0.to_le_bytes();
            if let Some(frame) = Frame::new(COMMAND_PDO.default_cob_id(*node), &command) {
                bus.send(&frame)?;
            }
        }
        bus.send(&sync::frame())?;
        let mut answers = vec![None; self.stations.len()];
        let until = self.wait.map_or(next, |wait| Instant::now() + wait);
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let Some(frame) = bus.recv(left)? else { break };
            for ((node, _, _), answer) in self.stations.iter().zip(&mut answers) {
                if frame.id() == STATUS_PDO.default_cob_id(*node) {
                    let reading = self.map.answers[0].read(frame.payload());
                    *answer = reading.and_then(|got| Some((got.statusword?, got.position_counts)));
                }
            }
            let is_complete = || {
                let mut all = self.stations.iter().zip(&answers);
                all.all(|((_, _, seeker), answer)| answer.is_some() || seeker.is_over())
            };
            if self.wait.is_some() && is_complete() {
                break;
            }
        }
        if self.wait.is_none() {
            // A bus in this program does not wait.
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
        for ((_, _, seeker), answer) in self.stations.iter_mut().zip(answers) {
            seeker.step(answer);
        }
        Ok(())
    }
}

//! From the records of the taps to messages.

use super::message::{AxisMessage, CycleMessage, FramesMessage, TimingMessage};
use super::notation::{Traffic, event_text};
use crate::fieldbus::transport::BusRecord;
use crate::rt::flight::PLACES_MAX;
use crate::rt::{Interruptions, Nanos, Stamps};
use crate::servo::{AxisRow, LoopRow};

impl From<&LoopRow> for CycleMessage {
    fn from(row: &LoopRow) -> Self {
        Self {
            cycle: row.tick,
            missed: row.missed,
            asked: row.asked,
            released: row.orders.released,
            feed_percent: row.orders.feed_percent,
            paused: row.orders.is_paused,
            table: row.table,
            phase: row.phase,
            run: row.run,
            sample: row.sample,
            overruns: row.overruns,
            scaled_cycles: row.scaled,
            scale: row.scale,
            tool_x_m: row.tool_m[0],
            tool_y_m: row.tool_m[1],
            inputs_known: row.inputs.known,
            inputs_on: row.inputs.on,
            stopping: row.stopping.map(|reason| format!("{reason:?}")).unwrap_or_default(),
            lost: row.lost,
        }
    }
}

impl AxisMessage {
    /// Returns the message of an axis in a tick.
    pub fn new(cycle: u64, row: &AxisRow) -> Self {
        Self {
            cycle,
            reference_m: row.reference_m,
            reference_m_s: row.reference_m_s,
            correction: row.correction,
            position_m: row.position_m,
            velocity_m_s: row.velocity_m_s,
            error_m: row.error_m,
            following_error_m: row.following_error_m,
            command: row.command,
            controlword: row.sent.controlword.0,
            target_counts: row.sent.target_counts,
            torque_offset: row.sent.torque_offset,
            velocity_offset_counts_s: row.sent.velocity_offset,
            statusword: row.statusword,
            drive_velocity_counts_s: row.drive_counts_s,
            drive_torque: row.torque,
        }
    }
}

impl FramesMessage {
    /// Adds an event of this tick, which began at a time; without a clock events have no time.
    pub(super) fn add(&mut self, record: &BusRecord, began: Nanos) {
        let (traffic, text) = event_text(&record.event);
        let (texts, times) = match traffic {
            Traffic::Received => (&mut self.received, &mut self.received_ns),
            Traffic::Sent => (&mut self.sent, &mut self.sent_ns),
        };
        texts.push(text);
        if record.at != Nanos(0) {
            times.push(record.at.0.cast_signed().saturating_sub(began.0.cast_signed()));
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.received.is_empty() && self.sent.is_empty()
    }
}

impl From<&Stamps> for TimingMessage {
    fn from(stamps: &Stamps) -> Self {
        let after = |time: Nanos| time.since(stamps.due).0;
        let answers = stamps.answer_ns.iter().rposition(|ns| *ns > 0).map_or(0, |last| last + 1);
        Self {
            cycle: stamps.tick,
            due_ns: stamps.due.0,
            woke_ns: after(stamps.woke),
            received_ns: after(stamps.received),
            controlled_ns: after(stamps.controlled),
            sent_ns: after(stamps.sent),
            ended_ns: after(stamps.ended),
            missed: stamps.missed,
            answer_ns: stamps.answer_ns[..answers].to_vec(),
            late_answers: stamps.late_answers,
            waited_ns: stamps.waited_ns,
            waited_for: stamps.waited_for,
            refused: stamps.refused,
            preemptions: stamps.interruptions.preemptions,
            minor_faults: stamps.interruptions.minor_faults,
            major_faults: stamps.interruptions.major_faults,
            late: stamps.late,
            stopped: stamps.stopped,
        }
    }
}

/// Returns the stamps of a message.
pub fn stamps_of(message: &TimingMessage) -> Stamps {
    let due = Nanos(message.due_ns);
    let at = |span_ns: u64| due.plus(Nanos(span_ns));
    let mut answer_ns = [0; PLACES_MAX];
    for (room, ns) in answer_ns.iter_mut().zip(&message.answer_ns) {
        *room = *ns;
    }
    Stamps {
        tick: message.cycle,
        due,
        woke: at(message.woke_ns),
        received: at(message.received_ns),
        controlled: at(message.controlled_ns),
        sent: at(message.sent_ns),
        ended: at(message.ended_ns),
        missed: message.missed,
        answer_ns,
        late_answers: message.late_answers,
        waited_ns: message.waited_ns,
        waited_for: message.waited_for,
        refused: message.refused,
        interruptions: Interruptions {
            preemptions: message.preemptions,
            minor_faults: message.minor_faults,
            major_faults: message.major_faults,
        },
        late: message.late,
        stopped: message.stopped,
    }
}

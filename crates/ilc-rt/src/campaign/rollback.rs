//! Decision on the input of the next run: learned, the best one so far, or the last one again.

use std::collections::VecDeque;

use crate::learning::Purpose;
use crate::record::{Figures, IterationRecord};
use crate::recording::Notes;
use crate::servo::Mailbox;

/// Number of rollbacks after which learning is switched off.
const ROLLBACKS_MAX: u32 = 2;
/// Tables whose computing time may still be asked for: one in use, two that wait, one more.
const TABLES_MAX: usize = 4;
/// Reason for learning being off.
const GROWN: &str = "the error grew twice";

/// Decision after a run.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Decision {
    /// Learn from it.
    Learn,
    /// Restore this input, as the error has grown too far.
    RollBack(Vec<f64>),
    /// Repeat the input.
    Hold,
}

/// The best run so far.
#[derive(Debug)]
struct Best {
    rms: f64,
    input: Vec<f64>,
    disturbance: Vec<f64>,
}

/// Rollback of the learned input when the error grows.
#[derive(Debug)]
pub(super) struct RollbackPolicy {
    rollback_ratio: f64,
    best: Option<Best>,
    rollbacks: u32,
    /// Number of the table for the next run.
    promised: u32,
    late_updates: u32,
    /// Tables passed to the loop so far.
    n_sent: u32,
    /// Number of the newest of them, with computing time and purpose, oldest first.
    sent: VecDeque<(u32, f64, Purpose)>,
    table_in_use: u32,
    /// Overruns are not a disturbance, as the plant paused as well.
    forgives_overruns: bool,
    notes: Notes,
}

impl RollbackPolicy {
    pub(super) fn new(rollback_ratio: f64) -> Self {
        Self {
            rollback_ratio,
            best: None,
            rollbacks: 0,
            promised: 0,
            late_updates: 0,
            n_sent: 0,
            sent: VecDeque::new(),
            table_in_use: 0,
            forgives_overruns: false,
            notes: Notes::default(),
        }
    }

    /// Notes every table in a recording.
    pub(super) fn noting(self, notes: Notes) -> Self {
        Self { notes, ..self }
    }

    /// Sets whether overruns are forgiven: true if a stall of the computer also stalls the plant,
    /// whose time advances by SYNC, so that the samples are those of a run without overruns.
    pub(super) fn forgiving(self, forgives_overruns: bool) -> Self {
        Self { forgives_overruns, ..self }
    }

    /// Returns true if computer or bus disturbed a run, so that it is not evidence.
    pub(super) fn is_disturbed(&self, figures: &Figures) -> bool {
        figures.is_incomplete() || figures.overruns > 0 && !self.forgives_overruns
    }

    /// Records that a run began with a table.
    pub(super) fn started(&mut self, table: u32) {
        self.table_in_use = table;
        self.late_updates += u32::from(table < self.promised);
    }

    /// Records that the law was asked for an update.
    pub(super) fn asked(&mut self) {
        self.promised = self.next_number();
    }

    fn next_number(&self) -> u32 {
        self.n_sent.saturating_add(1)
    }

    /// Writes the learning figures of a run into its record.
    pub(super) fn annotate(&self, record: &mut IterationRecord) {
        record.figures.late_updates = self.late_updates;
        let sent = self.sent.iter().find(|(table, ..)| *table == self.table_in_use);
        let (_, update_ms, purpose) = sent.copied().unwrap_or_default();
        record.figures.update_ms = update_ms;
        // By the table that the run had: a late one leaves the run its old purpose as well.
        record.figures.phase = (purpose != Purpose::Learning).then(|| purpose.as_str().to_owned());
    }

    /// Decides on the input after a run, and marks the run if the best input is restored because of
    /// it.
    ///
    /// Growth is measured in the RMS error over the best run so far. After two rollbacks the law
    /// has failed to converge, and learning stays off. A run that computer or bus disturbed
    /// (overruns, missing samples) is no evidence for or against the law, be it the first or
    /// seemingly the best: its input is repeated. A larger error under another disturbance than the
    /// best run's is no evidence against the law either: it continues to learn. A run that only measures
    /// is passed to the law, and is neither the best one nor held against it.
    pub(super) fn decide(&mut self, record: &mut IterationRecord) -> Decision {
        let rms = record.figures.judged_by();
        let off = self.rollbacks >= ROLLBACKS_MAX;
        if off {
            record.figures.learning_off = true;
            record.figures.remark = Some(format!("learning is off: {GROWN}"));
        }
        if self.is_disturbed(&record.figures) {
            if !off {
                record.figures.remark = Some(disturbance_remark(&record.figures));
            }
            return Decision::Hold;
        }
        if record.figures.only_measures() {
            return if off { Decision::Hold } else { Decision::Learn };
        }
        match &self.best {
            Some(best)
                if rms > best.rms * self.rollback_ratio
                    && !off
                    && record.disturbance == best.disturbance =>
            {
                self.rollbacks += 1;
                record.figures.rolled_back = true;
                record.figures.learning_off = self.rollbacks >= ROLLBACKS_MAX;
                record.figures.remark =
                    Some(growth_remark(rms / best.rms, record.figures.learning_off));
                Decision::RollBack(best.input.clone())
            }
            Some(best) if rms >= best.rms => {
                if off {
                    Decision::Hold
                } else {
                    Decision::Learn
                }
            }
            _ => {
                let (input, disturbance) = (record.input.clone(), record.disturbance.clone());
                self.best = Some(Best { rms, input, disturbance });
                if off { Decision::Hold } else { Decision::Learn }
            }
        }
    }

    /// Counts an input that a campaign would pass to the loop, in a replay.
    pub(super) fn would_send(&mut self, purpose: Purpose) {
        self.n_sent = self.next_number();
        self.promised = self.n_sent;
        self.sent.push_back((self.n_sent, 0.0, purpose));
        if self.sent.len() > TABLES_MAX {
            self.sent.pop_front();
        }
    }

    /// Passes the input of the next run to the loop.
    pub(super) fn send(
        &mut self,
        mail: &mut Mailbox,
        input: Vec<f64>,
        update_ms: f64,
        purpose: Purpose,
    ) {
        let number = self.next_number();
        // Refused only if two tables wait already; the run then repeats an input and is counted
        // late.
        self.promised = number;
        self.notes.table(number, &input);
        if mail.send_table(number, input.into_boxed_slice()).is_ok() {
            self.n_sent = number;
            self.sent.push_back((number, update_ms, purpose));
            if self.sent.len() > TABLES_MAX {
                self.sent.pop_front();
            }
        }
    }
}

/// Remark on a run that is no evidence.
pub(super) fn disturbance_remark(figures: &Figures) -> String {
    let scaled = match figures.scaled_cycles {
        0 => String::new(),
        cycles => format!(", {cycles} cycles at another feed than 100 %"),
    };
    format!(
        "nothing is learned from it, its input is repeated: {} overruns, {} samples missing{scaled}",
        figures.overruns, figures.missing_samples
    )
}

/// Remark on a restored input; `growth` is the error over the best one.
fn growth_remark(growth: f64, off: bool) -> String {
    let how_far = if growth < 1e3 {
        format!("to {growth:.2} times the best one")
    } else {
        "far beyond the best one".to_owned()
    };
    let then = if off { format!("; learning is off from here on: {GROWN}") } else { String::new() };
    format!("the RMS error grew {how_far}: the best input is restored{then}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(rms: f64) -> IterationRecord {
        IterationRecord {
            input: vec![rms],
            figures: Figures { tracking_rms_m: rms, ..Figures::default() },
            ..IterationRecord::default()
        }
    }

    #[test]
    fn growth_restores_the_best_input_twice_and_then_learning_is_off() {
        let mut policy = RollbackPolicy::new(1.5);
        assert_eq!(policy.decide(&mut record(1.0)), Decision::Learn);
        assert_eq!(policy.decide(&mut record(0.4)), Decision::Learn);
        assert_eq!(policy.decide(&mut record(0.5)), Decision::Learn, "within the ratio");
        let mut grown = record(0.7);
        assert_eq!(policy.decide(&mut grown), Decision::RollBack(vec![0.4]));
        assert!(grown.figures.rolled_back && !grown.figures.learning_off);
        let said = grown.figures.remark.unwrap();
        assert_eq!(
            said,
            "the RMS error grew to 1.75 times the best one: the best input is restored"
        );
        assert_eq!(policy.decide(&mut record(0.4)), Decision::Learn);
        let mut burst = record(f64::INFINITY);
        assert_eq!(policy.decide(&mut burst), Decision::RollBack(vec![0.4]));
        assert!(burst.figures.learning_off);
        let said = burst.figures.remark.unwrap();
        assert!(said.contains("far beyond") && said.contains("off from here on"), "{said}");
        let mut after = record(0.4);
        assert_eq!(policy.decide(&mut after), Decision::Hold);
        assert!(after.figures.learning_off && !after.figures.rolled_back);
        assert_eq!(after.figures.remark.unwrap(), "learning is off: the error grew twice");
        assert_eq!(policy.decide(&mut record(9.0)), Decision::Hold);
    }

    #[test]
    fn an_error_under_another_disturbance_is_not_held_against_the_law() {
        let under =
            |rms, disturbance| IterationRecord { disturbance: vec![disturbance], ..record(rms) };
        let mut policy = RollbackPolicy::new(1.5);
        assert_eq!(policy.decide(&mut under(0.4, 20.0)), Decision::Learn);
        assert_eq!(policy.decide(&mut under(9.0, 80.0)), Decision::Learn);
        assert_eq!(policy.decide(&mut under(9.0, 20.0)), Decision::RollBack(vec![0.4]));
    }

    #[test]
    fn a_disturbed_run_is_neither_learned_from_nor_held_against_the_law() {
        let disturbed = |rms, overruns, missing_samples| {
            let mut record = record(rms);
            (record.figures.overruns, record.figures.missing_samples) = (overruns, missing_samples);
            record
        };
        let mut policy = RollbackPolicy::new(1.5);
        // Neither the first run nor one that seems to be the best.
        assert_eq!(policy.decide(&mut disturbed(0.1, 0, 1)), Decision::Hold);
        assert_eq!(policy.decide(&mut record(1.0)), Decision::Learn);
        let mut worse = disturbed(9.0, 3, 0);
        assert_eq!(policy.decide(&mut worse), Decision::Hold);
        assert!(!worse.figures.rolled_back);
        let said = worse.figures.remark.unwrap();
        assert!(said.ends_with("its input is repeated: 3 overruns, 0 samples missing"), "{said}");
        assert_eq!(policy.decide(&mut disturbed(0.2, 0, 1)), Decision::Hold);
        assert_eq!(policy.decide(&mut record(1.4)), Decision::Learn, "1.0 is still the best");
        assert_eq!(policy.decide(&mut record(1.6)), Decision::RollBack(vec![1.0]));
    }

    #[test]
    fn a_run_that_only_measures_is_neither_the_best_nor_held_against_the_law() {
        let measuring = |rms, phase: &str| {
            let mut record = record(rms);
            record.figures.phase = Some(phase.to_owned());
            record
        };
        let mut policy = RollbackPolicy::new(1.5);
        assert_eq!(policy.decide(&mut record(1.0)), Decision::Learn);
        let mut probing = measuring(7.0, "probing");
        assert_eq!(policy.decide(&mut probing), Decision::Learn);
        assert!(!probing.figures.rolled_back && probing.figures.remark.is_none());
        assert_eq!(policy.decide(&mut measuring(0.2, "searching")), Decision::Learn);
        assert_eq!(policy.decide(&mut record(1.4)), Decision::Learn, "1.0 is still the best");
        assert_eq!(policy.decide(&mut record(1.6)), Decision::RollBack(vec![1.0]));
        let mut disturbed = measuring(1.0, "probing");
        disturbed.figures.missing_samples = 1;
        assert_eq!(policy.decide(&mut disturbed), Decision::Hold, "its input is repeated");
    }

    #[test]
    fn a_run_has_the_purpose_of_its_table_even_if_that_is_an_old_one() {
        let (mut mail, _loop_side) = crate::servo::mailbox(16, std::sync::Arc::default());
        let mut policy = RollbackPolicy::new(1.5);
        policy.send(&mut mail, vec![0.0], 1.0, Purpose::Learning);
        policy.send(&mut mail, vec![1.0], 2.0, Purpose::Probing);
        let mut phase_of = |table| {
            policy.started(table);
            let mut made = record(1.0);
            policy.annotate(&mut made);
            made.figures.phase
        };
        assert_eq!(phase_of(1), None);
        assert_eq!(phase_of(2).as_deref(), Some("probing"));
        assert_eq!(phase_of(0), None, "the zero input of a first run");
    }

    #[test]
    fn a_stall_that_stalls_the_plant_as_well_disturbs_nothing() {
        let mut policy = RollbackPolicy::new(1.5).forgiving(true);
        let mut stalled = record(1.0);
        stalled.figures.overruns = 50;
        assert_eq!(policy.decide(&mut stalled), Decision::Learn);
        stalled.figures.missing_samples = 1;
        assert_eq!(policy.decide(&mut stalled), Decision::Hold);
    }

    #[test]
    fn a_run_with_an_older_table_than_promised_is_late() {
        let mut policy = RollbackPolicy::new(1.5);
        policy.started(0);
        policy.asked();
        policy.started(0);
        let mut late = record(1.0);
        policy.annotate(&mut late);
        assert_eq!(late.figures.late_updates, 1);
    }
}

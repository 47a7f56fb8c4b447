//! The law of a recording, run again on the records of the replayed loop.

use std::collections::VecDeque;

use super::{Difference, ReplayError};
use crate::campaign::collect::Collector;
use crate::campaign::learner::learn;
use crate::campaign::rollback::{Decision, RollbackPolicy};
use crate::config::Cell;
use crate::design::{DesignError, Plan};
use crate::learning::{Law, Purpose};
use crate::record::{AxisKinds, IterationRecord};
use crate::recording::LoopSetup;
use crate::servo::Message;

/// A law that is run again, or none.
pub(super) struct Relearned {
    law: Option<Box<dyn Law>>,
    collector: Collector,
    policy: RollbackPolicy,
    first: u32,
    n_axes: usize,
    /// Inputs of the recording and of the law, oldest first, which are not compared yet.
    recorded: VecDeque<(u32, Vec<f64>)>,
    own: VecDeque<Vec<f64>>,
    n_compared: u32,
}

impl Relearned {
    pub(super) fn new(setup: &LoopSetup, cell: &Cell, plan: &Plan) -> Result<Self, ReplayError> {
        let mut law = match &setup.law_is_not_run {
            Some(_) => None,
            None => plan.law(cell)?.law,
        };
        let own = match law.as_deref_mut() {
            Some(law) => law.first_input().map_err(|source| {
                let file = cell.file.display().to_string();
                DesignError::Learning { file, source }
            })?,
            None => None,
        };
        let mut policy =
            RollbackPolicy::new(setup.growth_allowed).forgiving(setup.forgives_overruns);
        if own.is_some() {
            policy.would_send(Purpose::Learning);
        }
        Ok(Self {
            law,
            collector: Collector::new(
                plan.n_samples(),
                AxisKinds::new(&plan.meta.input_units, cell.n_axes()),
                plan.measure,
                cell.tcp_encoder.is_some(),
                cell.cycle_s(),
            ),
            policy,
            first: setup.first,
            n_axes: cell.n_axes(),
            recorded: VecDeque::new(),
            own: own.into_iter().collect(),
            n_compared: 0,
        })
    }

    /// Takes an input of the recording.
    pub(super) fn recorded(&mut self, table: u32, input: Vec<f64>) {
        if self.law.is_some() {
            self.recorded.push_back((table, input));
        }
    }

    /// Takes a message of the replayed loop.
    pub(super) fn take(&mut self, message: &Message) {
        if self.law.is_none() {
            return;
        }
        match message {
            Message::Sample(sample) => {
                if let Some((run, k)) = sample.at {
                    self.collector.take(run, k, sample);
                }
            }
            Message::RunStarted { run, table } => {
                self.collector.begin(*run);
                self.policy.started(*table);
            }
            Message::RunEnded { run, overruns, scaled } if *run >= self.first => {
                if let Some(mut record) = self.collector.end() {
                    record.figures.overruns = *overruns;
                    record.figures.scaled_cycles = *scaled;
                    self.learn(record);
                }
            }
            _ => {}
        }
    }

    /// Decides on a run and learns from it, as the campaign does.
    fn learn(&mut self, mut record: IterationRecord) {
        let Some(law) = self.law.as_deref_mut() else { return };
        self.policy.annotate(&mut record);
        match self.policy.decide(&mut record) {
            Decision::Learn => {
                self.policy.asked();
                let update = learn(law, &record.input, &record.error_m);
                if let Ok(next) = update.input {
                    self.policy.would_send(update.purpose);
                    self.own.push_back(next);
                }
            }
            Decision::RollBack(input) => {
                law.on_rollback();
                self.policy.would_send(Purpose::Learning);
                self.own.push_back(input);
            }
            Decision::Hold => {}
        }
    }

    /// Compares what both have; returns the first difference.
    pub(super) fn difference(&mut self, cycle: u64, names: &[String]) -> Option<Difference> {
        while !self.recorded.is_empty()
            && let Some(own) = self.own.pop_front()
            && let Some((table, recorded)) = self.recorded.pop_front()
        {
            self.n_compared += 1;
            let differs = |at: &usize| {
                recorded.get(*at).map(|x| x.to_bits()) != own.get(*at).map(|x| x.to_bits())
            };
            if let Some(at) = (0..recorded.len().max(own.len())).find(differs) {
                let shown =
                    |values: &[f64]| values.get(at).map_or("none".to_owned(), f64::to_string);
                return Some(Difference {
                    cycle,
                    axes: vec![names[at % self.n_axes].clone()],
                    field: format!("learned input in table {table}, sample {}", at / self.n_axes),
                    recorded: shown(&recorded),
                    replayed: shown(&own),
                });
            }
        }
        None
    }

    /// Returns the number of inputs compared.
    pub(super) fn n_compared(&self) -> u32 {
        self.n_compared
    }
}

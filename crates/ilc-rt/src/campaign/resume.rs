//! Resuming a campaign from the library.

use super::disturbance::Disturbance;
use super::error::{CampaignError, ResumeError};
use super::learner::{UpdateResult, learn, set_disturbance};
use super::rollback::{Decision, RollbackPolicy};
use crate::design::Plan;
use crate::learning::{Law, LearningError, Purpose};
use crate::library::{Library, Row, Task};
use crate::record::{Figures, IterationRecord, Meta};

/// A resumed campaign.
#[derive(Debug, Default)]
pub(super) struct Resumed {
    /// Number and figures of the stored runs.
    pub(super) runs: Vec<(u32, Figures)>,
    /// Input of the next run, its computing time and purpose.
    pub(super) next: Option<(Vec<f64>, f64, Purpose)>,
    /// Disturbance of the next run.
    pub(super) next_disturbance: Vec<f64>,
}

impl Resumed {
    /// Returns the number of the next run.
    pub(super) fn next_index(&self) -> u32 {
        self.runs.last().map_or(0, |(index, _)| index + 1)
    }
}

/// Returns the newest campaign of the same fingerprint, also from libraries of older versions.
pub(super) fn to_resume(library: &Library, plan: &Plan) -> Result<String, CampaignError> {
    if let Some(campaign) = library.newest_campaign(&plan.meta.fingerprint)? {
        return Ok(campaign);
    }
    let older = library.newest_campaign(&plan.legacy_fingerprint)?;
    let campaign = older.ok_or(ResumeError::NoCampaign)?;
    tracing::info!("campaign {campaign} was begun by an older version; it goes on as it was");
    Ok(campaign)
}

impl RollbackPolicy {
    /// Passes stored runs of this cell, program and measurement from before this campaign to a law
    /// that weights runs by their disturbance.
    pub(super) fn recall(
        &self,
        library: &Library,
        plan: &Plan,
        law: &mut dyn Law,
    ) -> Result<(), CampaignError> {
        let Some(n_disturbances) = law.n_disturbances() else { return Ok(()) };
        let meta = &plan.meta;
        let task = Task { cell: Some(meta.cell.clone()) };
        let fitting = library.fitting(plan.n_samples(), meta.n_axes, n_disturbances, &task)?;
        for (id, _) in fitting.runs {
            let Row { meta: stored, record, .. } = library.load(id)?;
            if stored.campaign == meta.campaign {
                break;
            }
            let is_alike = stored.program == meta.program
                && stored.measure == meta.measure
                && stored.cycle_s.to_bits() == meta.cycle_s.to_bits();
            if is_alike && !self.is_disturbed(&record.figures) {
                law.recall(&record.input, &record.error_m, &record.disturbance).map_err(refused)?;
            }
        }
        Ok(())
    }

    /// Resumes the campaign of `meta`: its runs, and the next input with its computing time.
    ///
    /// All runs pass through the law again, which then has the state of an uninterrupted campaign.
    pub(super) fn resume(
        &mut self,
        library: &Library,
        meta: &Meta,
        mut law: Option<&mut (dyn Law + '_)>,
        disturbance: &Disturbance,
    ) -> Result<Resumed, CampaignError> {
        let rows = library.list(Some(&meta.campaign))?;
        let mut last: Option<(Decision, IterationRecord)> = None;
        for row in &rows {
            let mut record = library.load(row.id)?.record;
            if let Some(law) = law.as_deref_mut() {
                set_disturbance(law, &record.disturbance);
                if let Some((Decision::Learn, before)) = last.take() {
                    learn(law, &before.input, &before.error_m).input.map_err(refused)?;
                }
            }
            let decision = self.decide(&mut record);
            if let (Decision::RollBack(_), Some(law)) = (&decision, law.as_deref_mut()) {
                law.on_rollback();
            }
            last = Some((decision, record));
        }
        let index = last.as_ref().map_or(0, |(_, record)| record.index + 1);
        let next_disturbance = disturbance.of(index)?;
        if let Some(law) = law.as_deref_mut() {
            set_disturbance(law, &next_disturbance);
        }
        let next = match (last, law) {
            (Some((Decision::RollBack(input), _)), _) => Some(Ok((input, 0.0, Purpose::Learning))),
            (Some((Decision::Learn, record)), Some(law)) => {
                let update = learn(law, &record.input, &record.error_m);
                let UpdateResult { update_ms, purpose, .. } = update;
                Some(update.input.map(|input| (input, update_ms, purpose)))
            }
            (Some((_, record)), law) => {
                // The run is repeated, with the same purpose.
                let measures = record.figures.only_measures();
                let purpose =
                    law.filter(|_| measures).map_or(Purpose::Learning, |law| law.purpose());
                Some(Ok((record.input, 0.0, purpose)))
            }
            (None, _) => None,
        };
        let next = next.transpose().map_err(refused)?;
        let runs = rows.into_iter().map(|row| (row.record.index, row.record.figures)).collect();
        Ok(Resumed { runs, next, next_disturbance })
    }
}

fn refused(error: LearningError) -> CampaignError {
    ResumeError::Refused(error).into()
}

//! End of a run with a frozen input, and the start of learning after a drift.

use super::claim::Claim;
use super::running::Running;
use crate::record::{Event, IterationRecord, Meta};

impl Running<'_> {
    /// Judges and stores a run with a frozen input, and starts the law again if it is to.
    pub(super) fn frozen_run_ended(&mut self, mut record: IterationRecord) {
        let Some(mut frozen) = self.frozen.take() else { return };
        let is_disturbed = self.policy.is_disturbed(&record.figures);
        let drift = frozen.judge(&mut record.figures, is_disturbed);
        let index = record.index;
        self.keep(record, false);
        let Some(ratio) = drift else {
            self.frozen = Some(frozen);
            return;
        };
        // After the last run there is nothing left to learn from.
        let relearning = frozen.relearning.take().filter(|_| index + 1 < self.iterations);
        self.announcer.publish(&Event::Drift {
            index,
            ratio: Some(ratio).filter(|ratio| ratio.is_finite()),
            allowed: frozen.allowed,
            origin: frozen.origin.to_string(),
            relearned_in: relearning.as_ref().map(|(meta, _)| meta.campaign.clone()),
        });
        match relearning {
            Some((meta, claim)) => self.learn_again(meta, claim, index + 1),
            None => self.frozen = Some(frozen),
        }
    }

    /// Begins the campaign in which the law learns from the frozen input on.
    fn learn_again(&mut self, meta: Meta, claim: Claim, next: u32) {
        if let Event::Start { campaign, law, first_index, .. } = &mut self.start {
            campaign.clone_from(&meta.campaign);
            law.clone_from(&meta.law);
            *first_index = next;
        }
        self.campaign.clone_from(&meta.campaign);
        self.claim = claim;
        self.keeper.begin(meta);
        if let Some(learner) = &mut self.learner {
            learner.set_disturbance(&self.current_disturbance);
        }
        let start = self.start.clone();
        self.announcer.publish(&start);
    }
}

//! Runs with a frozen input: nothing is learned, the error is watched, and a drift is reported.
//!
//! A drift may start the law again: in a campaign of its own, whose first run has the frozen input, so
//! that its runs alone are the evidence for a rollback, and all that a resumed campaign needs.

use super::claim::{Claim, claim};
use super::error::CampaignError;
use super::input::{self, Chosen, FROZEN, Origin};
use super::options::Options;
use super::rollback::{RollbackPolicy, disturbance_remark};
use crate::config::{Cell, LawName};
use crate::design::Plan;
use crate::library::Library;
use crate::record::{Figures, Meta};

/// Watch over the error of a frozen input.
#[derive(Debug)]
pub(super) struct Frozen {
    pub(super) origin: Origin,
    /// Ratio of errors above which the input has drifted.
    pub(super) allowed: f64,
    /// Campaign in which the law learns again, and the claim to it.
    pub(super) relearning: Option<(Meta, Claim)>,
    /// True for the first run: drives that were just switched on start from elsewhere.
    is_first: bool,
    is_drifting: bool,
}

/// Chooses the input that the options name.
///
/// # Errors
/// [`CampaignError::Input`] if none fits; [`CampaignError::Library`].
pub(super) fn choose(
    library: &Library,
    options: &Options,
    (cell, plan): (&Cell, &Plan),
    policy: &RollbackPolicy,
) -> Result<Chosen, CampaignError> {
    if let Some(path) = &options.input_file {
        return Ok(input::load(path, cell, plan)?);
    }
    let path = options.session.library.display().to_string();
    let source = options.input_from.unwrap_or_default();
    let is_disturbed = |figures: &Figures| policy.is_disturbed(figures);
    Ok(input::choose(library, &path, source, (cell, plan), is_disturbed)??)
}

impl Frozen {
    /// Prepares the watch, and names the plan's runs after their input; `plan` is named after the law
    /// that would learn again.
    ///
    /// # Errors
    /// [`CampaignError::NothingToRelearn`] without a law; [`CampaignError::Library`].
    pub(super) fn new(
        library: &Library,
        options: &Options,
        cell: &Cell,
        chosen: &Chosen,
        learns: bool,
        plan: &mut Plan,
    ) -> Result<Self, CampaignError> {
        let relearning = match options.relearn_above {
            Some(ratio) if !learns => return Err(CampaignError::NothingToRelearn { ratio }),
            Some(_) => {
                let meta = Meta { campaign: library.new_campaign()?, ..plan.meta.clone() };
                let claim = claim(&options.session.library, &meta.campaign)?;
                Some((meta, claim))
            }
            None => None,
        };
        let mut nothing = cell.clone();
        nothing.learning.law = LawName::None;
        let parameters = chosen.parameters();
        plan.name_law(&nothing, FROZEN, &parameters, &parameters);
        Ok(Self {
            origin: chosen.origin.clone(),
            allowed: options.relearn_above.unwrap_or_else(|| cell.learning.rollback()),
            relearning,
            is_first: true,
            is_drifting: false,
        })
    }

    /// Writes the ratio of the errors into the figures of a run, and returns it if the run begins a
    /// drift.
    pub(super) fn judge(&mut self, figures: &mut Figures, is_disturbed: bool) -> Option<f64> {
        let error = figures.judged_by();
        // Without an error there is nothing to compare with: any error is a drift.
        let reference = self.origin.error;
        let ratio = if error <= reference {
            error / reference.max(f64::MIN_POSITIVE)
        } else {
            error / reference
        };
        figures.frozen_ratio = ratio.is_finite().then_some(ratio);
        if is_disturbed {
            figures.remark = Some(disturbance_remark(figures));
            return None;
        }
        if std::mem::take(&mut self.is_first) {
            return None;
        }
        let drifts = ratio.is_nan() || ratio > self.allowed;
        let begins = drifts && !self.is_drifting;
        self.is_drifting = drifts;
        if drifts {
            figures.remark = Some(format!(
                "the frozen input does not fit any more: the error is {} that of {}",
                if ratio < 1e3 { format!("{ratio:.2} times") } else { "far beyond".to_owned() },
                self.origin
            ));
        }
        begins.then_some(ratio)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frozen(error: f64) -> Frozen {
        let text = String::new;
        Frozen {
            origin: Origin {
                campaign: "c".into(),
                index: 7,
                law: text(),
                law_parameters: text(),
                fingerprint: text(),
                run_digest: text(),
                error,
            },
            allowed: 1.5,
            relearning: None,
            is_first: true,
            is_drifting: false,
        }
    }

    fn figures(error: f64) -> Figures {
        Figures { axes_tracking_rms_m: vec![error], ..Figures::default() }
    }

    #[test]
    fn a_drift_is_told_when_it_begins_and_never_of_the_first_or_a_disturbed_run() {
        let mut frozen = frozen(2.0);
        let mut told = |error: f64, is_disturbed: bool| {
            let mut figures = figures(error);
            let drift = frozen.judge(&mut figures, is_disturbed);
            (drift, figures)
        };
        assert_eq!(told(9.0, false).0, None, "drives start from elsewhere in the first run");
        let (drift, fine) = told(3.0, false);
        assert_eq!((drift, fine.frozen_ratio, fine.remark), (None, Some(1.5), None));
        let (drift, disturbed) = told(9.0, true);
        assert!(drift.is_none() && disturbed.remark.unwrap().contains("overruns"));
        let (drift, grown) = told(4.0, false);
        assert_eq!(drift, Some(2.0));
        assert!(grown.remark.unwrap().contains("2.00 times that of run 7 of campaign c"));
        let (drift, grown) = told(5.0, false);
        assert!(drift.is_none() && grown.remark.is_some(), "told once");
        assert_eq!(told(1.0, false).0, None);
        assert_eq!(told(4.0, false).0, Some(2.0), "and again after it was within");
    }

    #[test]
    fn without_an_error_to_compare_with_any_error_is_a_drift() {
        let mut frozen = frozen(0.0);
        frozen.is_first = false;
        assert_eq!(frozen.judge(&mut figures(0.0), false), None);
        let mut some = figures(1e-6);
        assert_eq!(frozen.judge(&mut some, false), Some(f64::INFINITY));
        assert_eq!(some.frozen_ratio, None);
    }
}

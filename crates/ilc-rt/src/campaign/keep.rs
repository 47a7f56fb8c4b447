//! Runs that stay in the library when nothing is learned from them.
//!
//! Runs of a law are evidence: a rollback restores one of them, and a resumed campaign passes all of them
//! through the law again. They are always kept. Of other runs the newest always stays, as the number
//! of the next one follows from it.

use crate::config::Keep;
use crate::record::{IterationRecord, Meta};

/// The runs stored so far that may have to go.
#[derive(Debug)]
pub(super) struct Thinning {
    keep: Keep,
    /// The newest run, and true if it stays when it is not the newest any more.
    newest: Option<(i64, bool)>,
    best: Option<(i64, f64)>,
}

impl Thinning {
    pub(super) fn new(keep: Keep) -> Self {
        Self { keep, newest: None, best: None }
    }

    /// Adds a stored run, and returns those to delete.
    pub(super) fn add(&mut self, id: i64, meta: &Meta, record: &IterationRecord) -> Vec<i64> {
        if self.keep == Keep::All || !["frozen", "none"].contains(&meta.law.as_str()) {
            self.newest = None;
            return Vec::new();
        }
        let mut gone: Vec<i64> =
            self.newest.take().filter(|(_, stays)| !stays).map(|(id, _)| id).into_iter().collect();
        let stays = match self.keep {
            Keep::All => true,
            Keep::Every(n) => record.index.is_multiple_of(n),
            Keep::Best => {
                let error = record.figures.judged_by();
                let is_best = !record.figures.is_incomplete()
                    && self.best.is_none_or(|(_, best)| error < best);
                if is_best {
                    gone.extend(self.best.replace((id, error)).map(|(id, _)| id));
                }
                is_best
            }
        };
        self.newest = Some((id, stays));
        gone
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::Figures;

    /// Returns the runs left in the end, of runs with these errors.
    fn left(keep: Keep, law: &str, errors: &[f64]) -> Vec<i64> {
        let meta = Meta {
            cell: "c".into(),
            campaign: "k".into(),
            fingerprint: String::new(),
            law: law.into(),
            law_parameters: "{}".into(),
            measure: "encoder".into(),
            program: "{}".into(),
            cycle_s: 1e-3,
            n_axes: 1,
            axis_names: vec!["x".into()],
            input_units: vec!["m".into()],
        };
        let mut thinning = Thinning::new(keep);
        let mut there = Vec::new();
        for (index, error) in (0_u32..).zip(errors) {
            let figures = Figures { axes_tracking_rms_m: vec![*error], ..Figures::default() };
            let record = IterationRecord { index, figures, ..IterationRecord::default() };
            there.push(i64::from(index));
            let gone = thinning.add(i64::from(index), &meta, &record);
            assert!(gone.iter().all(|id| there.contains(id)), "{gone:?} of {there:?}");
            there.retain(|id| !gone.contains(id));
        }
        there
    }

    #[test]
    fn the_newest_run_and_those_of_the_rule_stay() {
        let errors = [5.0, 4.0, 2.0, 3.0, 1.0, 6.0, 7.0, 8.0];
        assert_eq!(left(Keep::Every(3), "frozen", &errors), [0, 3, 6, 7]);
        assert_eq!(left(Keep::Best, "none", &errors), [4, 7]);
        assert_eq!(left(Keep::Best, "none", &errors[..5]), [4]);
        assert_eq!(left(Keep::All, "none", &errors).len(), 8);
        assert_eq!(
            left(Keep::Best, "norm_optimal", &errors).len(),
            8,
            "runs of a law are evidence"
        );
    }
}

//! Numbers and figures of the runs of a campaign, as its outcome has them. For `running` and `ending`.

use std::collections::VecDeque;

use crate::record::Figures;

/// Number of runs that a campaign without an end keeps: its newest ones.
pub(super) const RUNS_KEPT: usize = 200;

/// The runs that are stored, oldest first.
#[derive(Debug, Default)]
pub(super) struct Runs {
    newest: VecDeque<(u32, Figures)>,
    /// Older ones that were given up.
    n_gone: usize,
    /// True if the number of runs has no end.
    is_endless: bool,
}

impl Runs {
    /// Starts with the runs of a resumed campaign.
    pub(super) fn new(earlier: Vec<(u32, Figures)>, is_endless: bool) -> Self {
        let mut runs = Self { newest: earlier.into(), n_gone: 0, is_endless };
        runs.bound();
        runs
    }

    /// Adds a run; returns its place.
    pub(super) fn add(&mut self, index: u32, figures: Figures) -> usize {
        self.newest.push_back((index, figures));
        self.bound();
        self.len() - 1
    }

    /// Returns the run of a place, unless it was given up.
    pub(super) fn at(&mut self, place: usize) -> Option<&mut (u32, Figures)> {
        self.newest.get_mut(place.checked_sub(self.n_gone)?)
    }

    /// Returns the number of all runs.
    pub(super) fn len(&self) -> usize {
        self.n_gone + self.newest.len()
    }

    /// Returns the runs that are left.
    pub(super) fn into_newest(self) -> Vec<(u32, Figures)> {
        self.newest.into()
    }

    fn bound(&mut self) {
        while self.is_endless && self.newest.len() > RUNS_KEPT {
            self.newest.pop_front();
            self.n_gone += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_endless_campaign_keeps_its_newest_runs_and_their_places() {
        for (is_endless, kept) in [(true, RUNS_KEPT), (false, 1000)] {
            let mut runs = Runs::new(vec![(0, Figures::default())], is_endless);
            for index in 1..1000 {
                assert_eq!(runs.add(index, Figures::default()), index as usize);
            }
            assert_eq!(runs.len(), 1000);
            assert_eq!(runs.at(999).unwrap().0, 999);
            assert_eq!(runs.at(1000 - kept).unwrap().0 as usize, 1000 - kept);
            assert_eq!(runs.at(0).is_none(), is_endless);
            assert_eq!(runs.into_newest().len(), kept);
        }
    }
}

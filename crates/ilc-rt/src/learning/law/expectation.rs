//! Disturbances of the finished and of the next run, for the laws that weigh runs by them.

use crate::learning::{LearningError, Result};

/// Stores the disturbance of the finished run and of the coming one.
///
/// Each disturbance is set once, before its run: the last one set is that of the coming run, the
/// one before it that of the finished run. If none is set between two updates, the disturbance is
/// assumed unchanged.
#[derive(Debug)]
pub(super) struct Expectation {
    finished: Option<Vec<f64>>,
    coming: Option<Vec<f64>>,
    /// Spare buffers for the two that are not set yet.
    spare: Vec<Vec<f64>>,
    is_new: bool,
    n_disturbances: usize,
    refused: Option<LearningError>,
}

impl Expectation {
    pub(super) fn new(n_disturbances: usize) -> Self {
        let mut expectation = Self {
            finished: None,
            coming: None,
            spare: (0..2).map(|_| Vec::with_capacity(n_disturbances)).collect(),
            is_new: false,
            n_disturbances,
            refused: None,
        };
        expectation.forget();
        expectation
    }

    /// Forgets all disturbances. A law without disturbances needs none.
    pub(super) fn forget(&mut self) {
        self.spare.extend(self.finished.take().into_iter().chain(self.coming.take()));
        if self.n_disturbances == 0 {
            (self.finished, self.coming) = (self.spare.pop(), self.spare.pop());
        }
        self.is_new = false;
        self.refused = None;
    }

    /// Sets the disturbance of the next run. An invalid one is reported by the update.
    pub(super) fn announce(&mut self, disturbance: &[f64]) {
        if let Err(refused) = check(disturbance, self.n_disturbances) {
            self.refused = Some(refused);
            return;
        }
        let mut place = self.finished.take().or_else(|| self.spare.pop()).unwrap_or_default();
        place.clear();
        place.extend_from_slice(disturbance);
        self.finished = self.coming.replace(place);
        self.is_new = true;
    }

    /// Returns the disturbance of the coming run, if it is known.
    pub(super) fn coming(&self) -> Option<&[f64]> {
        self.coming.as_deref().filter(|_| self.refused.is_none())
    }

    /// Returns the disturbances of the finished run, if it is known, and of the coming one; then
    /// the coming run begins.
    pub(super) fn settle(&mut self) -> Result<(Option<&[f64]>, &[f64])> {
        if let Some(refused) = self.refused.take() {
            return Err(refused);
        }
        let expected = self.n_disturbances;
        let Some(coming) = self.coming.as_deref() else {
            return Err(LearningError::Disturbance { found: 0, expected });
        };
        let is_new = std::mem::take(&mut self.is_new);
        let finished = if is_new { self.finished.as_deref() } else { Some(coming) };
        Ok((finished, coming))
    }
}

/// Checks number and values of a disturbance.
pub(super) fn check(disturbance: &[f64], expected: usize) -> Result {
    let found = disturbance.len();
    if found != expected {
        return Err(LearningError::Disturbance { found, expected });
    }
    match disturbance.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(channel) => {
            let (what, value) = ("disturbance", disturbance[channel]);
            Err(LearningError::NotFinite { what, sample: 0, channel, value })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_keeps_the_disturbance_it_was_announced_with() {
        let mut told = Expectation::new(1);
        told.announce(&[20.0]);
        told.announce(&[25.0]);
        assert_eq!(told.settle().unwrap(), (Some([20.0].as_slice()), [25.0].as_slice()));
        told.announce(&[30.0]);
        assert_eq!(told.settle().unwrap(), (Some([25.0].as_slice()), [30.0].as_slice()));
        // None was set: it is unchanged.
        assert_eq!(told.settle().unwrap(), (Some([30.0].as_slice()), [30.0].as_slice()));
        // A run from which nothing was learned.
        told.announce(&[35.0]);
        told.announce(&[40.0]);
        assert_eq!(told.settle().unwrap(), (Some([35.0].as_slice()), [40.0].as_slice()));
    }

    #[test]
    fn the_first_run_may_be_unknown_and_the_coming_one_may_not() {
        let mut told = Expectation::new(1);
        let line = told.settle().unwrap_err().to_string();
        assert!(line.contains("0 numbers") && line.contains("1 needed"), "{line}");
        told.announce(&[20.0]);
        assert_eq!(told.settle().unwrap(), (None, [20.0].as_slice()));
        told.announce(&[1.0, 2.0]);
        assert!(matches!(told.settle(), Err(LearningError::Disturbance { found: 2, expected: 1 })));
        told.announce(&[f64::NAN]);
        assert!(matches!(told.settle(), Err(LearningError::NotFinite { .. })));
        told.forget();
        assert!(told.settle().is_err());
        assert_eq!(Expectation::new(0).settle().unwrap(), (Some([].as_slice()), [].as_slice()));
    }
}

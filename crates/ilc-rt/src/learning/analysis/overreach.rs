//! Check of a law's low-pass (Q-filter) against the critical frequency.
//!
//! A filter keeps out the frequencies at which each update would make the error grow; this file says
//! whether it begins to do so early enough. `design` and the Python bindings warn with it.

use std::fmt;

use super::frequency::Spectrum;
use super::iteration::Iteration;
use crate::learning::{Law, LowPass, Result, Surrogate};
use crate::model::StateSpace;

/// A low-pass whose cut-off lies above the critical frequency of its law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overreach {
    /// Cut-off of one pass; the highest one if it varies along the run.
    pub cutoff_hz: f64,
    /// First frequency at which the law without its filter amplifies the error.
    pub critical_hz: f64,
}

impl fmt::Display for Overreach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the law's low-pass begins at {:.3} Hz, but from {:.3} Hz on the law makes the error grow; \
             what lies between may grow from run to run: set the cut-off below {:.3} Hz",
            self.cutoff_hz, self.critical_hz, self.critical_hz
        )
    }
}

/// Returns the cut-off and the critical frequency if the law's low-pass starts above the frequency
/// up to which the law can learn.
///
/// The critical frequency is the first with `|1 - L P| >= 1`, `L` being the law without filter and
/// bounds. `None` if the cut-off is below it, if the law has no low-pass, or if the unfiltered
/// law's impulse response is longer than the run.
///
/// # Errors
/// - any error of the law.
/// # Source
/// - \[filter-based\], Eq. (9): the critical frequency.
pub fn overreach(
    law: &mut dyn Law,
    model: &StateSpace,
    n_samples: usize,
) -> Result<Option<Overreach>> {
    if let Surrogate::Inside(inside) = law.linear_surrogate() {
        return overreach(inside, model, n_samples);
    }
    let low_pass = model.dt_s().and_then(|dt_s| law.low_pass(dt_s));
    let Some(LowPass { cutoff_hz, mut unfiltered }) = low_pass else { return Ok(None) };
    let mut iteration = Iteration::new(unfiltered.as_mut(), model, n_samples)?;
    let spectrum = Spectrum::new(&mut iteration, model)?;
    let critical_hz = spectrum.and_then(|spectrum| spectrum.critical_hz());
    Ok(critical_hz
        .filter(|critical_hz| cutoff_hz > *critical_hz)
        .map(|critical_hz| Overreach { cutoff_hz, critical_hz }))
}

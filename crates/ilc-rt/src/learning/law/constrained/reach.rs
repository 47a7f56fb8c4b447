//! Feasibility of the bounds of an input's value and of its steps.

use super::BoundsError;
use super::solver::Bands;
use crate::learning::sweep::Run;

/// Returns the first sample that no input can reach within its bounds.
///
/// From 0 before the run, the values reachable by the steps are an interval; the bounds of the
/// value intersect it, and the next step starts from the intersection.
pub(super) fn conflict(
    bands: &Bands,
    inputs: &[usize],
    width: usize,
    run: &Run,
) -> Option<BoundsError> {
    // Without them nothing depends on the run: it was checked when the law was created.
    bands.change.as_ref()?;
    let before = |k: usize, i: usize| run.input[k * run.n_inputs + inputs[i]];
    search(bands, inputs, width, &before)
}

/// The same before any run, without bounds of the change.
pub(super) fn standing_conflict(
    bands: &Bands,
    inputs: &[usize],
    width: usize,
) -> Option<BoundsError> {
    search(&Bands { change: None, ..bands.clone() }, inputs, width, &|_, _| 0.0)
}

fn search(
    bands: &Bands,
    inputs: &[usize],
    width: usize,
    before: &dyn Fn(usize, usize) -> f64,
) -> Option<BoundsError> {
    let free = (f64::NEG_INFINITY, f64::INFINITY);
    for (i, channel) in inputs.iter().enumerate() {
        let (mut low, mut high) = (0.0_f64, 0.0_f64);
        for k in 0..bands.n_samples {
            let here = k * width + i;
            let step = bands.step.as_ref().map_or(free, |band| band.at(here));
            let (lowest, highest) = (low + step.0, high + step.1);
            let (mut least, mut most) = bands.input.as_ref().map_or(free, |band| band.at(here));
            if let Some(change) = &bands.change {
                let (down, up) = change.at(here);
                least = least.max(before(k, i) + down);
                most = most.min(before(k, i) + up);
            }
            (low, high) = (lowest.max(least), highest.min(most));
            let slip = 1e-12 * low.abs().max(high.abs()).min(f64::MAX);
            if low > high + slip {
                let (sample, channel) = (k, *channel);
                return Some(BoundsError::OutOfReach {
                    sample,
                    channel,
                    lowest,
                    highest,
                    least,
                    most,
                });
            }
            high = high.max(low);
        }
    }
    None
}

//! Identification of an axis: experiments in one band after the other, until a model fits.

use super::band::BandSearch;
use super::error::IdentificationError;
use super::experiment::{Experiment, Signals};
use super::identified::Identified;
use super::options::ExperimentOptions;
use crate::config::Cell;

/// Identifies an axis: `excite` executes an experiment (`None` if it was stopped), `report`
/// receives a sentence on each band.
///
/// With a highest frequency in the options there is one experiment; without one, bands are searched by
/// [`BandSearch`].
///
/// # Errors
/// [`IdentificationError`] for an unusable axis or amplitude and for signals that cannot be fitted;
/// any error of `excite`.
pub fn identify<E: From<IdentificationError>>(
    cell: &Cell,
    options: &ExperimentOptions,
    excite: &mut dyn FnMut(&Experiment) -> Result<Option<Signals>, E>,
    report: &mut dyn FnMut(&str),
) -> Result<Option<(Experiment, Identified)>, E> {
    let mut identified = |experiment: Experiment| -> Result<Option<(Experiment, Identified)>, E> {
        let Some(signals) = excite(&experiment)? else { return Ok(None) };
        let found = Identified::new(cell, &experiment, &signals)?;
        Ok(Some((experiment, found)))
    };
    if options.to_hz.is_some() {
        return identified(options.experiment(cell, None)?);
    }
    let mut search = BandSearch::new(cell, options.axis(cell)?);
    let mut best: Option<(Experiment, Identified)> = None;
    while let Some(band) = search.next_band() {
        let experiment = match options.experiment(cell, Some(band)) {
            // A given amplitude may fit into a narrower band only.
            Err(IdentificationError::Experiment { .. })
                if options.amplitude.is_some() && best.is_none() && search.is_open() =>
            {
                continue;
            }
            experiment => experiment?,
        };
        let Some((experiment, found)) = identified(experiment)? else { break };
        let left = 100.0 * found.residual_rms();
        let verdict =
            found.doubt.map_or(format!("the model leaves {left:.0} %"), |doubt| doubt.to_string());
        let Experiment { excitation, .. } = &experiment;
        report(&format!(
            "{:.3} to {:.3} Hz, amplitude {:.3e}: {verdict}",
            excitation.from_hz, excitation.to_hz, excitation.amplitude
        ));
        if search.judge(band, &found, best.as_ref().map(|(_, found)| found)) {
            best = Some((experiment, found));
        }
    }
    Ok(best)
}

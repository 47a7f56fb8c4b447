//! Texts by which versions up to 0.1 told native laws apart in their libraries, so that their campaigns go on.

use ilc_rt::learning::law::q_filter::QFilter;
use pyo3::prelude::*;

use super::figure::Figure;
use super::{PyLaw, State};
use crate::argument::read_array;
use crate::arguments::Arguments;
use crate::signal::read_filter;

/// Returns the `repr` that a law had; `None` for a kind whose `repr` or meaning was another, as that of a gate.
pub(crate) fn repr(py: Python<'_>, law: &PyLaw) -> Option<String> {
    let state = law.state.borrow(py).ok()?;
    of(law.kind, Arguments::new(law.arguments.bind(py)), &state).ok().flatten()
}

fn of(kind: &str, a: Arguments<'_, '_>, state: &State) -> PyResult<Option<String>> {
    let filter = |name: &str| -> PyResult<&'static str> {
        Ok(filter_kind(&read_filter(name, a.given(name)?.as_ref())?))
    };
    Ok(Some(match kind {
        "pd" => {
            let (kp, kd, lead) = (a.number("kp")?, a.number("kd")?, a.whole("lead_samples")?);
            format!("PdIlc(kp={kp}, kd={kd}, q_filter={}, lead={lead})", filter("q_filter")?)
        }
        "error_feedforward" => {
            let (gain, lead) = (a.number("gain_per_s")?, a.whole("lead_samples")?);
            let limit = a.maybe_number("input_max")?.filter(|limit| limit.is_finite());
            let limit = limit.map_or_else(|| "None".to_owned(), |limit| limit.to_string());
            let filter = filter("filter")?;
            format!("ErrorFeedforwardIlc(gain={gain}, filter={filter}, lead={lead}, limit={limit})")
        }
        "adjoint" => {
            let Some(Figure::Number(gain)) = state.law.figure("gain") else { return Ok(None) };
            let (n, filter) = (a.whole("n_samples")?, filter("q_filter")?);
            format!("AdjointIlc(n_samples={n}, gain={gain}, q_filter={filter})")
        }
        "model_inverse" => {
            let (n, gain, filter) = (a.whole("n_samples")?, a.number("gain")?, filter("q_filter")?);
            format!("ModelInverseIlc(n_samples={n}, gain={gain}, q_filter={filter})")
        }
        "norm_optimal" => {
            let (n, rate) = (a.whole("n_samples")?, a.number("rate")?);
            let [q, s, r] = ["q", "s", "r"].map(|name| weight(a, name));
            format!("NormOptimalIlc(n_samples={n}, q={}, s={}, r={}, rate={rate})", q?, s?, r?)
        }
        "ladder" => {
            let inner = a.get("law")?;
            let native = inner.cast::<PyLaw>().ok().and_then(|law| repr(a.py(), law.get()));
            let inner = native.map_or_else(|| inner.repr().map(|text| text.to_string()), Ok)?;
            format!("Ladder({inner}, repeats={})", a.whole("repeats")?)
        }
        _ => return Ok(None),
    }))
}

/// Returns a weight that is a number, or the shape of an array.
fn weight(a: Arguments<'_, '_>, name: &str) -> PyResult<String> {
    let (values, shape) = read_array(name, &a.get(name)?)?;
    Ok(match shape[..] {
        [] => values[0].to_string(),
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    })
}

fn filter_kind(filter: &QFilter) -> &'static str {
    match filter {
        QFilter::None => "None",
        QFilter::ZeroPhase(_) => "zero-phase",
        QFilter::Causal(_) => "causal",
        QFilter::Gaussian(_) => "Gaussian",
        QFilter::Switched(_) => "switched",
        QFilter::Fir(_) => "FIR",
    }
}

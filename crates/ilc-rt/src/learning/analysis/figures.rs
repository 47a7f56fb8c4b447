//! The figures of an analysis.

use serde::Serialize;

use super::condition::PdCondition;
use crate::learning::krylov::Estimate;

/// How figures were found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// From whole matrices.
    Dense,
    /// From products with signals; no matrix of the run's length.
    Structured,
}

/// What a law will do with a model.
///
/// # Units
/// - errors in the units of the reference and of the noise; frequencies in hertz; factors without
///   unit
/// # Source
/// - \[barton2010\], Eq. (3.16) to (3.23); filter-based open-loop learning, its Eq. (9), for the
///   frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// Samples of a run.
    pub n_samples: usize,
    /// How the figures were found.
    pub method: Method,
    /// Whether the error converges, without growing beyond all measure before.
    pub converges: bool,
    /// Whether it converges and the distance to the final input is known to fall in every run.
    pub monotonic: bool,
    /// The verdict with its figures, as a sentence.
    pub why: String,
    /// Largest absolute eigenvalue of `T`: the factor of each iteration in the long run.
    pub spectral_radius: Estimate,
    /// Largest singular value of `T`: the worst factor of a single iteration, never below the spectral
    /// radius. `None` where the law has no transpose and the run is longer than
    /// [`COLUMNS_MAX`](super::COLUMNS_MAX).
    pub monotonic_factor: Option<Estimate>,
    /// How far an error may grow before it falls: the largest norm of a power of `T` (with
    /// [`Method::Structured`] the largest growth seen from a start without pattern).
    pub transient_growth: f64,
    /// Frequencies of [`Analysis::contraction`]; empty for a law that changes along the run, or that
    /// looks farther than the run is long.
    pub frequency_hz: Vec<f64>,
    /// Largest singular value of `T` at each frequency.
    pub contraction: Vec<f64>,
    /// First frequency at which an iteration makes the error grow; `None` if there is none.
    pub critical_frequency_hz: Option<f64>,
    /// The same for the law without its filter: content above it must be filtered out.
    pub learnable_frequency_hz: Option<f64>,
    /// Largest `|T| + |W| |L_e P|` over frequency: below 1, every plant `P (I + W Delta)` with
    /// `|Delta| <= 1` converges monotonically, run ends left aside.
    pub robust_factor: Option<f64>,
    /// Largest uncertainty, the same at all frequencies, for which that factor would stay below 1.
    pub uncertainty_allowed: Option<f64>,
    /// `|T| + w |L_e P|` of the whole run, for uncertainty that may also change along the run; short
    /// runs only.
    pub robust_lifted: Option<f64>,
    /// RMS error before learning, for the reference given.
    pub initial_error_rms: Option<f64>,
    /// Input to which learning converges, time first; inputs that reach nothing are zero.
    pub converged_input: Option<Vec<f64>>,
    /// Error that stays, time first.
    pub converged_error: Option<Vec<f64>>,
    /// Its RMS: root of the mean over time of the squared length.
    pub converged_error_rms: Option<f64>,
    /// Expected RMS error of each run under white noise, from a first run with input zero.
    pub expected_rms: Vec<f64>,
    /// Expected RMS error in the limit.
    pub expected_rms_limit: Option<f64>,
    /// The usual condition for the gains of proportional-derivative learning.
    pub pd_condition: Option<PdCondition>,
}

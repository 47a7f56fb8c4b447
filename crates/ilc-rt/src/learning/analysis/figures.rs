//! The figures of an analysis.

use serde::Serialize;

use super::condition::PdCondition;
use crate::learning::krylov::Estimate;

/// Method of computation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Dense matrices.
    Dense,
    /// Matrix-free: products with signals.
    Structured,
}

impl Method {
    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dense => "dense",
            Self::Structured => "structured",
        }
    }
}

/// Convergence and performance of a law on a model, predicted.
///
/// # Units
/// - errors in the units of the reference and of the noise; frequencies in hertz; factors are
///   dimensionless
/// # Source
/// - \[barton2010\], Eq. (3.16) to (3.23); \[filter-based\], Eq. (9), for the frequencies.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// Samples of a run.
    pub n_samples: usize,
    /// Method of computation.
    pub method: Method,
    /// True if the error converges without excessive transient growth.
    pub converges: bool,
    /// True if convergence is monotone: the distance to the final input falls in every run.
    pub monotonic: bool,
    /// The verdict and its figures, as a sentence.
    pub why: String,
    /// Spectral radius of `T`: the asymptotic factor per iteration.
    pub spectral_radius: Estimate,
    /// Largest singular value of `T`: the worst factor of a single iteration, at least the spectral
    /// radius. `None` if the law has no adjoint and the run is longer than
    /// [`COLUMNS_MAX`](super::COLUMNS_MAX).
    pub monotonic_factor: Option<Estimate>,
    /// Transient growth of the error before it falls: the largest norm of a power of `T` (with
    /// [`Method::Structured`] a lower bound: the larger of the monotonic factor and the growth of a
    /// random error).
    pub transient_growth: f64,
    /// Frequencies of [`Analysis::contraction`]; empty for a time-varying law, or one whose impulse
    /// response is longer than the run.
    pub frequency_hz: Vec<f64>,
    /// Largest singular value of `T` at each frequency.
    pub contraction: Vec<f64>,
    /// First frequency at which an iteration amplifies the error; `None` if there is none.
    pub critical_frequency_hz: Option<f64>,
    /// The same for the law without its Q-filter, which must suppress everything above.
    pub learnable_frequency_hz: Option<f64>,
    /// Robustness: largest `|T| + |W| |L_e P|` over frequency. Below 1, every plant `P (I + W
    /// Delta)` with `|Delta| <= 1` converges monotonically, apart from effects at the ends of the
    /// run.
    pub robust_factor: Option<f64>,
    /// Largest frequency-independent uncertainty for which that factor stays below 1.
    pub uncertainty_allowed: Option<f64>,
    /// `|T| + w |L_e P|` of the lifted system, for uncertainty that may also vary along the run;
    /// short runs only.
    pub robust_lifted: Option<f64>,
    /// RMS error before learning, for the given reference.
    pub initial_error_rms: Option<f64>,
    /// Converged input, time first; inputs without effect are zero.
    pub converged_input: Option<Vec<f64>>,
    /// Converged error, time first.
    pub converged_error: Option<Vec<f64>>,
    /// RMS of the converged error: over time, of its Euclidean norm.
    pub converged_error_rms: Option<f64>,
    /// Expected RMS error of each run under white measurement noise; the first run has input zero.
    pub expected_rms: Vec<f64>,
    /// Limit of the expected RMS error.
    pub expected_rms_limit: Option<f64>,
    /// The common gain condition of PD-type ILC.
    pub pd_condition: Option<PdCondition>,
}

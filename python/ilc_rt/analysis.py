"""Analysis before the first run: convergence, robustness, weights, and repeatability."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

from ilc_rt import _native

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import AnyLaw, Model

__all__ = [
    "Analysis",
    "Repeatability",
    "Tuning",
    "analyze",
    "refuse_divergent",
    "repeatability",
    "tune",
]

SIGNALS = ("frequency_hz", "contraction", "converged_input", "converged_error")
TEXTS = {
    "spectral_radius": "spectral radius",
    "monotonic_factor": "worst factor of a run",
    "critical_frequency_hz": "critical frequency in Hz",
    "learnable_frequency_hz": "learnable frequency in Hz",
    "robust_factor": "worst factor within the uncertainty",
    "uncertainty_allowed": "uncertainty allowed",
    "initial_error_rms": "RMS error before learning",
    "converged_error_rms": "RMS error in the end",
    "expected_rms_limit": "expected RMS error in the end",
}


@dataclass(frozen=True, repr=False, eq=False)
class Analysis:
    """Predicted convergence and performance of a law on a model.

    ``u[j+1] = T u[j] + L_e r`` with ``T = L_u - L_e P``.

    Attributes
    ----------
    n_samples : int
        Samples of a run.
    method : {"dense", "structured"}
        Method of the analysis: whole matrices, or products with signals in long runs and where they
        say as much.
    converges : bool
        The error converges, without excessive transient growth.
    monotonic : bool
        Monotone convergence: every run brings the input nearer to its limit.
    why : str
        The verdict as a sentence with its figures.
    spectral_radius, spectral_radius_error : float
        Largest absolute eigenvalue of T, and its uncertainty.
    monotonic_factor, monotonic_factor_error : float or None
        Largest singular value of T, the worst factor of a run, and its uncertainty;
        None where it is not computed.
    transient_growth : float
        Transient growth: largest growth of an error before it falls; in long runs a lower
        bound, at least the monotonic factor.
    critical_frequency_hz : float or None
        First frequency in Hz at which a run amplifies the error; None if there is none.
    learnable_frequency_hz : float or None
        The same for the law without its Q-filter.
    robust_factor, robust_lifted : float or None
        Worst factor of a run within the uncertainty over frequency, and its upper
        bound over the whole run.
    uncertainty_allowed : float or None
        Largest frequency-independent uncertainty for which the law still converges.
    initial_error_rms, converged_error_rms : float or None
        RMS error before learning and in the steady state, for the reference given.
    expected_rms_limit : float or None
        Limit of the expected RMS error under the given noise.
    pd_factor : float or None
        ``|1 - (kp + kd) p_1|`` of a PD-type law.
    pd_gain_range : tuple[float, float] or None
        Range of kp + kd in which that factor is below 1.
    frequency_hz, contraction : ndarray of float64
        Frequencies in Hz, and the largest singular value of T at each.
    converged_input, converged_error : ndarray of float64 or None
        Steady state, shape (n_samples, n_inputs or n_outputs); None if not known.
    expected_rms : ndarray of float64
        Expected RMS error of each run under the given noise; may be empty.
    """

    n_samples: int
    method: Literal["dense", "structured"]
    converges: bool
    monotonic: bool
    why: str
    spectral_radius: float
    spectral_radius_error: float
    monotonic_factor: float | None
    monotonic_factor_error: float | None
    transient_growth: float
    critical_frequency_hz: float | None
    learnable_frequency_hz: float | None
    robust_factor: float | None
    robust_lifted: float | None
    uncertainty_allowed: float | None
    initial_error_rms: float | None
    converged_error_rms: float | None
    expected_rms_limit: float | None
    pd_factor: float | None
    pd_gain_range: tuple[float, float] | None
    frequency_hz: NDArray[np.float64]
    contraction: NDArray[np.float64]
    converged_input: NDArray[np.float64] | None
    converged_error: NDArray[np.float64] | None
    expected_rms: NDArray[np.float64]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures as a dict of numbers, texts and None.

        Returns
        -------
        dict
            Everything but the signals; ready for JSON, infinities as None.
        """
        figures = {name: value for name, value in asdict(self).items() if name not in SIGNALS}
        del figures["pd_gain_range"]
        figures["expected_rms"] = self.expected_rms.tolist()
        for name, value in figures.items():
            if isinstance(value, float) and not math.isfinite(value):
                figures[name] = None
        return figures

    def __str__(self) -> str:
        """Return the verdict and the figures, one per line."""
        verdict = "converges in every run" if self.monotonic else "converges, not in every run"
        lines = [f"{verdict if self.converges else 'will not converge'}: {self.why}"]
        for name, text in TEXTS.items():
            value = getattr(self, name)
            if value is not None:
                lines.append(f"  {text:36} {value:.6e}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        """Return the verdict."""
        return (
            f"Analysis(converges={self.converges}, monotonic={self.monotonic}, "
            f"spectral_radius={self.spectral_radius})"
        )


@dataclass(frozen=True, repr=False, eq=False)
class Tuning:
    """Weights of norm-optimal ILC, with the reasons for them.

    Attributes
    ----------
    q : float
        Weight of the error.
    s : float
        Weight of the input.
    r : float
        Weight of the change of the input.
    smoothing_hz : float or None
        Bandwidth in Hz above which the learned input is mostly noise.
    steps : list of dict
        ``name``, ``what``, ``value`` and ``why`` of each step.
    analysis : Analysis
        Prediction for the law with these weights.
    """

    q: float
    s: float
    r: float
    smoothing_hz: float | None
    steps: list[dict[str, Any]]
    analysis: Analysis

    def __str__(self) -> str:
        """Return the weights, and each step with its reason."""
        lines = [f"q = {self.q:g}, s = {self.s:.6e}, r = {self.r:.6e}"]
        for step in self.steps:
            lines.append(f"  {step['name']:10} {step['what']:12} {step['why']}")  # noqa: PERF401
        return "\n".join(lines)

    def __repr__(self) -> str:
        """Return the weights."""
        return f"Tuning(q={self.q}, s={self.s}, r={self.r})"


@dataclass(frozen=True, repr=False, eq=False)
class Repeatability:
    """Comparison of several runs with the same input.

    Attributes
    ----------
    mean : ndarray of float64
        Mean error of the runs, sample by sample.
    spread : ndarray of float64
        Standard deviation from run to run, sample by sample.
    mean_rms : float
        RMS of the mean error: the part that learning can remove.
    spread_rms : float
        RMS of the standard deviation: the part that it cannot.
    ratio : float
        `spread_rms` over `mean_rms`; well below 1 if learning is worthwhile.
    learnable : float
        Repeatable share of the mean square of one run's error, 0 to 1.
    least_rms : float
        Smallest RMS of any run.
    largest_rms : float
        Largest RMS of any run.
    """

    mean: NDArray[np.float64]
    spread: NDArray[np.float64]
    mean_rms: float
    spread_rms: float
    ratio: float
    learnable: float
    least_rms: float
    largest_rms: float

    def __repr__(self) -> str:
        """Return the figures."""
        return (
            f"Repeatability(mean_rms={self.mean_rms:.6g}, spread_rms={self.spread_rms:.6g}, "
            f"ratio={self.ratio:.3f}, learnable={self.learnable:.3f})"
        )


def analyze(
    law: AnyLaw | dict[str, float],
    model: Model,
    n_samples: int | None = None,
    uncertainty: float | ArrayLike | None = None,
    reference: ArrayLike | None = None,
    noise_std: float | None = None,
    n_runs: int = 20,
) -> Analysis:
    """Predict the convergence and performance of a law on a model, before the first run.

    ``u[j+1] = T u[j] + L_e (r - d[j])`` with ``T = L_u - L_e P``.

    Parameters
    ----------
    law : object or dict
        A law of this package, any object with ``update(u, e, disturbance=None)``, or the weights of
        norm-optimal ILC, e.g. ``{"q": 1.0, "r": 0.1}``.
    model : StateSpace or compatible
        Discrete model from the learned input to the measurement.
    n_samples : int or None
        Samples of a run; None if the law or the reference determines them.
    uncertainty : float, array_like or None
        Multiplicative model uncertainty, 0.2 for 20 %; an array holds gains at equally spaced
        frequencies from zero to the Nyquist frequency.
    reference : array_like or None, shape (n_samples,) or (n_samples, n_outputs)
        Error of a run with input zero: the reference itself if only the learned input moves the
        axis.
    noise_std : float or None
        Standard deviation of white measurement noise.
    n_runs : int
        Number of runs for which the expected error is computed.

    Raises
    ------
    LearningError
        If the law is nonlinear, or an argument does not match it.
    ValueError, TypeError
        If an argument has the wrong shape or kind.

    Notes
    -----
    A law written in Python is tested for linearity, and reset before each of its updates; it should
    keep no state between runs. For a `Gate` or a `Ladder` the inner law is analysed, with gain 1;
    for a law with bounds the same law without them: an active bound only holds the input. Up to 640
    inputs dense matrices are used, beyond that matrix-free products; a law written in Python is
    analysed column by column up to 3000 inputs, and has no `monotonic_factor` beyond.

    References
    ----------
    [barton2010], Eq. (3.16) to (3.23); [dimarco2016], Eq. (3.4), which is not a condition for
    monotone convergence: `monotonic_factor` is.

    Examples
    --------
    >>> from ilc_rt import PdIlc, analyze, discretize, second_order
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> analyze({"q": 1.0, "s": 0.01, "r": 0.1}, axis, 200).monotonic
    True
    >>> analyze(PdIlc(kp=5.0, kd=0.0), axis, 200).converges
    False
    """
    return Analysis(**_native.analyze(locals()))


def refuse_divergent(law: AnyLaw, model: Model, n_samples: int) -> None:
    """Refuse a law that is predicted to diverge on a model.

    The quick part of `analyze`: less than a second up to 60 000 samples. A law written in Python is
    accepted; for a `Gate` or a `Ladder` the inner law is analysed, for a law with bounds the
    same law without them.

    Parameters
    ----------
    law : object
        The law.
    model : StateSpace or compatible
        Discrete model from the learned input to the measurement.
    n_samples : int
        Samples of a run.

    Raises
    ------
    LearningError
        With the figures.

    Warns
    -----
    UserWarning
        If the cut-off of the law's low-pass is above the critical frequency, above which the law
        amplifies the error; both are named.

    Examples
    --------
    >>> from ilc_rt import PdIlc, discretize, second_order
    >>> from ilc_rt.analysis import refuse_divergent
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> refuse_divergent(PdIlc(kp=5.0, kd=0.0), axis, 400)
    Traceback (most recent call last):
    ilc_rt.LearningError: this law will not converge: ...
    """
    _native.refuse_divergent(locals())


def tune(
    model: Model,
    n_samples: int,
    uncertainty: float | ArrayLike | None = None,
    noise_std: float | None = None,
    reference: ArrayLike | None = None,
    n_runs: int = 10,
) -> Tuning:
    """Propose the weights of norm-optimal ILC, with reasons.

    The guidelines s1 to s4: ``q = 1``; the smallest robust s, times 2; r as long as it reduces the
    error under noise; a check of the result.

    Parameters
    ----------
    model : StateSpace or compatible
        Discrete model from the learned input to the measurement.
    n_samples : int
        Samples of a run.
    uncertainty : float, array_like or None
        Multiplicative model uncertainty, 0.2 for 20 %; an array holds gains at equally spaced
        frequencies from zero to the Nyquist frequency.
    noise_std : float or None
        Standard deviation of white measurement noise.
    reference : array_like or None, shape (n_samples,) or (n_samples, n_outputs)
        Error of a run with input zero.
    n_runs : int
        Number of runs within which learning should be finished.

    Raises
    ------
    LearningError
        If an argument does not match the model.
    ValueError, TypeError
        If an argument has the wrong shape or kind.

    References
    ----------
    [barton2010], Sec. 3.3.4.

    Examples
    --------
    >>> from ilc_rt import discretize, second_order, tune
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> tuning = tune(axis, 300, uncertainty=0.3, noise_std=1e-6)
    >>> tuning.q, tuning.s, tuning.r > 0
    (1.0, 0.0, True)
    """
    found = _native.tune(locals())
    found["analysis"] = Analysis(**found["analysis"])
    return Tuning(**found)


def repeatability(errors: ArrayLike) -> Repeatability:
    """Compare the errors of runs with the same input.

    ``learnable = (ms(m) - ms(s)/n) / (ms(m) - ms(s)/n + ms(s))``, m the mean and s the
    standard deviation over n runs

    Parameters
    ----------
    errors : ndarray of float64, shape (n_runs, n_samples) or (n_runs, n_samples, n_channels)
        Errors of at least two runs.

    Returns
    -------
    Repeatability
        Repeatable and non-repeatable parts of the error.

    Raises
    ------
    LearningError
        For fewer than two runs.

    References
    ----------
    [filter-based], Section 6.1.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import repeatability
    >>> repeatability(np.array([[1.0, 1.0], [3.0, -1.0]])).mean
    array([2., 0.])
    """
    return Repeatability(**_native.repeatability(errors))

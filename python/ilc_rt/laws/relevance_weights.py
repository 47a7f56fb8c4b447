"""Weights of the relevance of past runs: `RelevanceWeights`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import check_relevance_weights

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

RENAMED = {"e": "error", "er": "error_rate", "d": "disturbance"}


@dataclass(frozen=True, init=False)
class RelevanceWeights:
    """Weights of the relevance of a past run for the coming one.

    ``N_j = 1 / (sum_k [error |e_j|^2 + error_rate |de_j/dt|^2
    + sum disturbance (d_i - d_j)^2] + epsilon)``

    Parameters
    ----------
    error : float
        Weight of the error.
    error_rate : float
        Weight of the error's rate.
    disturbance : float, array_like of float64, shape (n_disturbances,), or None
        Weight of the distance in disturbance; one number for all of them, None is 0.5.
    epsilon : float
        Added to every sum: below it runs count as equally good. Choose the
        weights in proportion to it.
    rate_filter_s : float
        Time constant in seconds of the filter that computes the error's rate, ``s / (rate_filter_s
        s + 1)``.
    error_gain, input_gain : float
        Gains Gamma_1 of the core law's correction, and Gamma_2 of the input.

    Raises
    ------
    LearningError
        If a weight is negative or not finite.

    Notes
    -----
    The sum runs over the samples of a run, as in the source's listing. Its
    integral is the sum times the sample time, a factor that cancels in the
    weights; only epsilon is then scaled alike. The defaults are the source's, for
    errors of the order of 1: with errors in metres choose the first two larger.

    References
    ----------
    [dimarco2016], Eq. (4.12), (4.13), Appendix C.

    Examples
    --------
    >>> from ilc_rt import RelevanceWeights
    >>> RelevanceWeights(error=3.0, disturbance=0.1).error_rate
    2.0
    """

    error: float
    error_rate: float
    disturbance: tuple[float, ...]
    epsilon: float
    rate_filter_s: float
    error_gain: float
    input_gain: float

    def __init__(
        self,
        error: float = 10.0,
        error_rate: float = 2.0,
        disturbance: ArrayLike | None = None,
        epsilon: float = 1.0,
        rate_filter_s: float = 0.1,
        error_gain: float = 1.0,
        input_gain: float = 1.0,
        **old: object,
    ) -> None:
        for name in old:
            now = f"is called {RENAMED[name]} now" if name in RENAMED else "is not a weight"
            line = f"{name}: {now}"
            raise TypeError(line)
        values = {
            "error": error,
            "error_rate": error_rate,
            "disturbance": 0.5 if disturbance is None else disturbance,
            "epsilon": epsilon,
            "rate_filter_s": rate_filter_s,
            "error_gain": error_gain,
            "input_gain": input_gain,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        check_relevance_weights(self)
        numbers = np.atleast_1d(np.asarray(values["disturbance"], float)).tolist()
        object.__setattr__(self, "disturbance", tuple(numbers))

"""Laws that follow a whole reference, with parameters, and their predictions side by side.

Imported by `ilc_rt.recommendation` alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import LearningError, ModelError
from ilc_rt.analysis import Analysis, analyze, tune
from ilc_rt.laws import AdjointIlc, ModelInverseIlc, NormOptimalIlc, StableInverseIlc
from ilc_rt.signal import butterworth

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ilc_rt._native import StateSpace
    from ilc_rt.learning_facts import LearningFacts

    Array = NDArray[np.float64]

# Largest worst factor of a run within the uncertainty, and shares of the known band that are tried
# as cut-off of a Q-filter.
ROBUST = 0.98
CUTOFFS = (1.0, 0.8, 0.63, 0.5, 0.4, 0.315, 0.25, 0.2, 0.16, 0.1)
GAIN = 0.7
# Noise that is assumed where it is not known, as share of the first error.
ASSUMED = 1e-3
# Advantage in predicted error that another law must have over norm-optimal ILC.
ADVANTAGE = 1.3
# Samples up to which a law written in Python is analysed: each is one update.
PYTHON_MAX = 3000


@dataclass(frozen=True)
class Candidate:
    """A law with its prediction.

    Attributes
    ----------
    kind : type
        Class of the law.
    arguments : dict
        Its arguments.
    law : object or None
        The law; None if it could not be made.
    analysis : Analysis or None
        Prediction.
    left : float
        Predicted error after the runs asked for, as share of the first one; infinite if the law is
        not robust.
    against : str
        Reason against it; empty if there is none.
    """

    kind: type
    arguments: dict[str, Any]
    law: Any
    analysis: Analysis | None
    left: float
    against: str = ""


def candidates(
    model: StateSpace,
    n_samples: int,
    facts: LearningFacts,
    reference: Array,
    noise_std: float | None,
    n_runs: int,
) -> list[Candidate]:
    """Return every law that could follow the reference, norm-optimal ILC first.

    Parameters
    ----------
    model : StateSpace
        Time-invariant model.
    n_samples : int
        Samples of a run.
    facts : LearningFacts
        Facts of the model.
    reference : ndarray of float64, shape (n_samples, n_outputs)
        Error of a run with input zero.
    noise_std : float or None
        Standard deviation of white measurement noise.
    n_runs : int
        Runs by which learning should be complete.
    """
    asked = _Question(model, n_samples, facts, reference, noise_std, n_runs)
    found = [asked.norm_optimal()]
    if facts.known_hz is None and not facts.is_non_minimum_phase:
        return found
    if facts.is_single and facts.zeros_outside:
        found.append(asked.filtered(StableInverseIlc, {"gain": GAIN, **_method(facts)}))
    else:
        found.append(asked.filtered(ModelInverseIlc, {"gain": GAIN}))
    if facts.known_hz is not None:
        found.append(asked.filtered(AdjointIlc, {}))
    return found


def best_of(found: list[Candidate]) -> Candidate:
    """Return the first candidate than which no later one is clearly better."""
    best = found[0]
    for one in found[1:]:
        if ADVANTAGE * one.left < best.left:
            best = one
    return best


def _method(facts: LearningFacts) -> dict[str, Any]:
    """Return the kind of inversion: exact for true zeros outside, by phase for sampling zeros."""
    nearest = min(abs(abs(zero) - 1.0) for zero in facts.zeros_outside)
    if facts.is_non_minimum_phase and nearest > 1e-3:
        return {}
    return {"method": "zpetc", "zero_radius": 0.9}


@dataclass(frozen=True)
class _Question:
    """Plant, motion and time that the laws are compared for."""

    model: StateSpace
    n_samples: int
    facts: LearningFacts
    reference: Array
    noise_std: float | None
    n_runs: int

    def norm_optimal(self) -> Candidate:
        """Return norm-optimal ILC with tuned weights.

        Without a known noise a little of it is assumed, so that the inverse is no exact one.
        """
        tuned = tune(
            self.model, self.n_samples, uncertainty=self.facts.uncertainty,
            noise_std=self.noise_std or ASSUMED * rms(self.reference), reference=self.reference,
            n_runs=self.n_runs,
        )  # fmt: skip
        weights = {"q": tuned.q, "s": tuned.s, "r": tuned.r}
        arguments = {"model": self.model, "n_samples": self.n_samples, **weights}
        return self._candidate(NormOptimalIlc, arguments)

    def filtered(self, kind: type, own: dict[str, Any]) -> Candidate:
        """Return a law with a Q-filter, of the highest cut-off at which it is robust.

        ``|Q| (|1 - L P| + |W| |L P|) < 1`` at all frequencies
        """
        facts = self.facts
        arguments = {"model": self.model, "n_samples": self.n_samples, **own}
        try:
            learned = self._learned(kind, arguments)
        except (LearningError, ModelError) as error:
            return Candidate(kind, arguments, None, None, np.inf, f"cannot be used: {error}")
        at_hz = np.linspace(0.0, facts.nyquist_hz, len(facts.uncertainty))
        worst = np.abs(1.0 - learned) + facts.uncertainty * learned
        top_hz = min(facts.known_hz or np.inf, 0.4 / facts.dt_s)
        for share in CUTOFFS:
            # A Butterworth filter of second order, there and back.
            passed = 1.0 / (1.0 + (at_hz / (share * top_hz)) ** 4)
            if float(np.max(passed * worst)) < ROBUST:
                q_filter = butterworth(2, share * top_hz, facts.dt_s)
                return self._candidate(kind, {**arguments, "q_filter": q_filter})
        why = "no Q-filter makes it robust within the uncertainty"
        return Candidate(kind, arguments, None, None, np.inf, why)

    def _learned(self, kind: type, arguments: dict[str, Any]) -> Array:
        """Return ``|L P|`` of a law without filter, over the grid of the uncertainty."""
        law = kind(**arguments)
        w = np.linspace(0.0, np.pi / self.facts.dt_s, len(self.facts.uncertainty))
        if kind is AdjointIlc:
            # At rest an integrator has no finite gain.
            w[0] = 1e-3 * w[1]
            size = np.linalg.norm(self.model.frequency_response(w), ord=2, axis=(1, 2))
            return np.asarray(np.minimum(law.gain * size**2, 1.0), dtype=np.float64)
        if arguments.get("method") == "zpetc":
            bu = np.poly(law.zeros_outside) if len(law.zeros_outside) else np.ones(1)
            shape = np.abs(np.polyval(bu, np.exp(1j * w * self.facts.dt_s)) / bu.sum()) ** 2
            return np.asarray(arguments["gain"] * shape, dtype=np.float64)
        return np.full(len(w), arguments["gain"])

    def _candidate(self, kind: Callable[..., Any], arguments: dict[str, Any]) -> Candidate:
        made: type = kind  # type: ignore[assignment]
        if kind is StableInverseIlc and self.n_samples > PYTHON_MAX:
            why = f"it is predicted for at most {PYTHON_MAX} samples"
            return Candidate(made, arguments, None, None, np.inf, why)
        try:
            law = kind(**arguments)
            analysis = analyze(
                law, self.model, self.n_samples, uncertainty=self.facts.uncertainty,
                reference=self.reference, noise_std=self.noise_std or 0.0, n_runs=self.n_runs + 1,
            )  # fmt: skip
        except (LearningError, ModelError, ValueError) as error:
            return Candidate(made, arguments, None, None, np.inf, f"cannot be used: {error}")
        robust, left = analysis.robust_factor, self._left(analysis)
        if not analysis.converges:
            return Candidate(made, arguments, law, analysis, np.inf, analysis.why)
        if robust is not None and robust >= ROBUST and made is not NormOptimalIlc:
            why = f"a run may multiply the error by {robust:.3g} within the uncertainty"
            return Candidate(made, arguments, law, analysis, np.inf, why)
        return Candidate(made, arguments, law, analysis, left)

    def _left(self, analysis: Analysis) -> float:
        first = analysis.initial_error_rms or 0.0
        runs = analysis.expected_rms
        last = float(runs[-1]) if runs.size else analysis.converged_error_rms
        if first <= 0.0 or last is None or not np.isfinite(last):
            return 1.0
        return last / first


def rms(signal: Array) -> float:
    """Return the RMS over time of the Euclidean norm."""
    return float(np.sqrt(np.sum(signal**2) / len(signal)))

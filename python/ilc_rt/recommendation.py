"""Recommendation of a law for a plant and a task, from computed facts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import LearningError
from ilc_rt.law_choice import Task
from ilc_rt.laws import ModelFreeIlc, PdIlc
from ilc_rt.learning_facts import learning_facts
from ilc_rt.recommended import KINDS, Reason, Recommendation, Refused
from ilc_rt.signal import butterworth

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from ilc_rt.laws.arguments import VaryingModel

__all__ = ["Reason", "Recommendation", "Refused", "recommend"]

# Lag of a position loop as share of a period of its bandwidth / 2 pi, and cut-off of the Q-filter.
LAG = 1.4
SHARE = 0.6


def recommend(
    model: VaryingModel | None,
    n_samples: int | None = None,
    *,
    uncertainty: float | ArrayLike = 0.3,
    noise_std: float | None = None,
    reference: ArrayLike | None = None,
    n_runs: int = 10,
    points: Sequence[int] | None = None,
    changes_task: bool = False,
    has_friction: bool = False,
    bounds: Mapping[str, Any] | None = None,
    disturbance_std: float | None = None,
    bandwidth_hz: float | None = None,
    delay_samples: int = 0,
    dt_s: float | None = None,
    n_axes: int = 1,
) -> Recommendation:
    """Recommend a law for a plant and a task, ready to use, with the facts that decided.

    Parameters
    ----------
    model : StateSpace, TimeVarying, compatible or None
        Discrete model from the learned input to the measurement, including its dead time; None if
        there is no model.
    n_samples : int or None
        Samples of a run; None for those of the reference.
    uncertainty : float or array_like
        Multiplicative model uncertainty, 0.3 for 30 %, as `ilc_rt.identify.uncertainty` measures
        it; an array holds gains at equally spaced frequencies from zero to the Nyquist frequency.
    noise_std : float or None
        Standard deviation of white measurement noise, as `ilc_rt.repeatability` measures it.
    reference : array_like or None, shape (n_samples,) or (n_samples, n_outputs)
        Error of a run with input zero; the reference itself if only the learned input moves the
        axis. None for a smooth motion through the whole run.
    n_runs : int
        Runs by which learning should be complete.
    points : sequence of int or None
        Samples that count, if the motion between them is free.
    changes_task : bool
        The reference changes often, and what was learned must hold for the next one.
    has_friction : bool
        The axis has Coulomb friction, for `changes_task`.
    bounds : mapping or None
        Limits, as keywords of `ConstrainedIlc`: ``{"input_max": 0.01, "velocity_bounds": 0.5}``.
    disturbance_std : float or None
        Spread from run to run of a disturbance that is measured before each, e.g. a temperature.
    bandwidth_hz, delay_samples, dt_s : float, int, float
        Without a model: frequency in Hz up to which the output follows the input one to one, e.g.
        that of a position loop; dead time in samples; sample time in s.
    n_axes : int
        Without a model: number of channels.

    Returns
    -------
    Recommendation
        The law, its reasons, and why the others are refused.

    Raises
    ------
    LearningError
        If no law suits, saying what would help; if the model is continuous or unstable, or a number
        is out of range.
    ValueError, TypeError
        If an argument has the wrong shape or kind.

    Notes
    -----
    Laws that follow the whole reference are compared by `analyze`: the smallest predicted error
    after `n_runs` runs among those that are robust within the uncertainty; norm-optimal ILC if
    another one is not at least 1.3 times better. What is refused was computed as well.

    References
    ----------
    [barton2010], section 3.3; [vanzundert2018].

    Examples
    --------
    >>> from ilc_rt import discretize, recommend, second_order
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> recommend(axis, 300, uncertainty=0.2, noise_std=1e-6).name
    'NormOptimalIlc'
    >>> recommend(axis, 300, points=[150, 299]).name
    'PointToPointIlc'
    >>> recommend(None, 300, dt_s=0.002, bandwidth_hz=15.0).name
    'PdIlc'
    """
    if not isinstance(n_runs, int) or n_runs < 1:
        message = f"n_runs = {n_runs!r}: a whole number from 1 is needed"
        raise LearningError(message)
    if disturbance_std is not None and not 0.0 < disturbance_std < np.inf:
        message = f"disturbance_std = {disturbance_std}: a finite number above 0 is needed"
        raise LearningError(message)
    if bounds is not None and not isinstance(bounds, Mapping):
        message = f"bounds = {bounds!r}: a mapping of keywords of ConstrainedIlc is needed"
        raise TypeError(message)
    if model is None:
        return _without_model(bandwidth_hz, delay_samples, dt_s, n_axes)
    facts = learning_facts(model, uncertainty)
    task = Task(model, facts, n_samples, reference, noise_std, n_runs)
    if facts.known_hz == 0.0:
        return task.unknown()
    if points is not None:
        return task.points(points)
    if changes_task:
        return task.basis(has_friction=has_friction)
    found = task.tracking()
    if bounds:
        found = task.bounded(found, bounds)
    if disturbance_std is not None:
        found = task.relevant(found, disturbance_std)
    return found


def _without_model(
    bandwidth_hz: float | None, delay_samples: int, dt_s: float | None, n_axes: int
) -> Recommendation:
    """Return the law of a plant without a model: P-type with a Q-filter, or a measured gradient."""
    if bandwidth_hz is not None:
        if dt_s is None or not 0.0 < dt_s < np.inf:
            message = f"dt_s = {dt_s}: the sample time in s is needed with bandwidth_hz"
            raise LearningError(message)
        if not 0.0 < bandwidth_hz < 0.5 / dt_s:
            message = (
                f"bandwidth_hz = {bandwidth_hz}: between 0 and {0.5 / dt_s:g} Hz, half the sample "
                "rate, is needed"
            )
            raise LearningError(message)
        # A position loop with a damping of 0.7 lags by 1.4 / (2 pi bandwidth).
        lag = round(LAG / (2.0 * np.pi * bandwidth_hz * dt_s))
        arguments: dict[str, Any] = {
            "kp": 0.5, "q_filter": butterworth(2, SHARE * bandwidth_hz, dt_s),
            "lead_samples": 1 + delay_samples + lag,
        }  # fmt: skip
        reasons: tuple[Reason, ...] = (
            Reason("model", None, "there is no model: the law takes the error as it is"),
            Reason("bandwidth_hz", bandwidth_hz,
                   f"the output follows the input up to {bandwidth_hz:g} Hz: a Q-filter at "
                   f"{SHARE * bandwidth_hz:.3g} Hz keeps learning below"),
            Reason("delay_samples", delay_samples,
                   f"{delay_samples} samples of dead time and {lag} of lag: the law looks ahead"),
        )  # fmt: skip
        refused = (
            *_need_a_model(),
            Refused("ModelFreeIlc", "every iteration takes three runs; the bandwidth is known"),
        )
        return Recommendation(PdIlc(**arguments), "PdIlc", arguments, KINDS["PdIlc"],
                              reasons, refused)  # fmt: skip
    if n_axes != 1:
        message = (
            f"n_axes = {n_axes}: without a model and without a bandwidth no law suits several "
            "axes; `ilc identify` measures a model, `bandwidth_hz` is that of the position loops"
        )
        raise LearningError(message)
    reasons = (
        Reason("model", None, "there is no model: the gradient is measured on the plant itself"),
        Reason("bandwidth_hz", None, "no bandwidth is known up to which the error could be taken"),
    )
    refused = (
        *_need_a_model(),
        Refused("PdIlc", "its gain and its lead need a bandwidth and a dead time"),
    )
    return Recommendation(
        ModelFreeIlc(), "ModelFreeIlc", {}, KINDS["ModelFreeIlc"], reasons, refused
    )


def _need_a_model() -> tuple[Refused, ...]:
    names = ("NormOptimalIlc", "ConstrainedIlc", "StableInverseIlc", "BasisFunctions")
    return tuple(Refused(name, "it needs a model; `ilc identify` measures one") for name in names)

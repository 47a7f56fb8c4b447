"""Error between the samples of a run, by a finer discretisation of a continuous-time plant.

Imported by `ilc_rt.pictures`, and by users.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ilc_rt._native import StateSpace
from ilc_rt.models import discretize

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt.laws.arguments import Model
    from ilc_rt.record import IterationRecord

    Array = NDArray[np.float64]

__all__ = ["error_between_samples"]


def error_between_samples(
    record: IterationRecord,
    plant: Model,
    dt_s: float,
    *,
    ratio: int = 16,
    delay_s: float = 0.0,
    command: Literal["input", "sum"] = "input",
) -> tuple[Array, Array]:
    """Return the error of a run between its samples.

    ``e(t) = r(t) - P(u(t))``, u held from sample to sample, r linear between samples

    Parameters
    ----------
    record : IterationRecord
        The run.
    plant : StateSpace or compatible
        Continuous-time plant P, from rest.
    dt_s : float
        Sample time of the run in s.
    ratio : int
        Points per sample, 1 to 1000.
    delay_s : float
        Dead time of the plant in s, rounded to a point.
    command : {"input", "sum"}
        Input of the plant: the learned input alone, or its sum with the reference, as in a cell
        whose learned input is added to the set point.

    Returns
    -------
    time_s : ndarray of float64, shape (n_points,)
        Times in s; every `ratio`-th one is a sample.
    error : ndarray of float64, shape (n_points, n_outputs)
        The error, without noise and disturbances.

    Raises
    ------
    ValueError
        If the plant is sampled, does not suit the run, or a number is out of range.

    Notes
    -----
    An exact inverse of a sampled plant may make the error vanish at every sample and oscillate
    between them, as the zeros that sampling adds ring: this shows it.

    References
    ----------
    [astrom1984].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import discretize, second_order, simulate
    >>> plant = second_order(94.0, 0.7)
    >>> result = simulate(discretize(plant, 0.002), None, np.hanning(100), trials=1)
    >>> time_s, error = error_between_samples(result.records[0], plant, 0.002)
    >>> bool(np.allclose(error[::16], result.error[0], atol=1e-12))
    True
    """
    model = StateSpace._of(plant)
    u, r = record.input, record.reference_m
    if model.dt_s is not None:
        message = f"plant has a sample time of {model.dt_s} s; a continuous-time model is needed"
        raise ValueError(message)
    if not isinstance(ratio, int) or not 1 <= ratio <= 1000:
        message = f"ratio = {ratio!r}: a whole number from 1 to 1000 is needed"
        raise ValueError(message)
    if not (np.isfinite(delay_s) and delay_s >= 0.0):
        message = f"delay_s = {delay_s}: a finite number from 0 is needed"
        raise ValueError(message)
    if command not in {"input", "sum"}:
        message = f"command = {command!r}: allowed 'input' or 'sum'"
        raise ValueError(message)
    if (model.n_inputs, model.n_outputs) != (u.shape[1], r.shape[1]):
        message = (
            f"plant has {model.n_inputs} inputs and {model.n_outputs} outputs; the run has "
            f"{u.shape[1]} and {r.shape[1]}"
        )
        raise ValueError(message)
    given = u + r if command == "sum" else u
    n_points = (len(u) - 1) * ratio + 1
    held = np.repeat(given, ratio, axis=0)[:n_points]
    late = min(round(delay_s * ratio / dt_s), n_points)
    held = np.concatenate((np.zeros((late, held.shape[1])), held))[:n_points]
    y = discretize(model, dt_s / ratio).simulate(held).reshape(n_points, -1)
    time_s: Array = np.arange(n_points, dtype=np.float64) * (dt_s / ratio)
    samples_s = np.arange(len(r)) * dt_s
    fine = np.column_stack([np.interp(time_s, samples_s, channel) for channel in r.T])
    return time_s, fine - y

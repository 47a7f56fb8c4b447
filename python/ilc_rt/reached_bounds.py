"""Bounds of a constrained law that a predicted input would reach.

Imported by `ilc_rt.law_choice` alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Order of the difference that a bound is for; those of the set point are of reference plus input.
OF_INPUT = {"input_max": 0, "step_max": 1}
OF_SET_POINT = {"position_bounds": 0, "velocity_bounds": 1, "acceleration_bounds": 2}


def reached_bounds(
    bounds: Mapping[str, Any], predicted: Array | None, dt_s: float, share: float
) -> list[str]:
    """Return a sentence for each bound that would be reached, or of which that is not known.

    Parameters
    ----------
    bounds : mapping
        Keywords of `ConstrainedIlc`.
    predicted : ndarray of float64 or None, shape (n_samples,) or (n_samples, n_inputs)
        Input to which an unconstrained law converges.
    dt_s : float
        Sample time in s.
    share : float
        Share of a bound from which it counts as reached.

    Examples
    --------
    >>> reached_bounds({"input_max": 0.5, "step_max": 2.0}, np.array([0.0, 1.0]), 0.1, 0.9)
    ['the input would be 1, of which input_max allows 0.5']
    >>> reached_bounds({"input_max": 2.0}, np.array([0.0, 1.0]), 0.1, 0.9)
    []
    """
    found = []
    for name, bound in bounds.items():
        if name in {"reference", "output_reference"} or bound is None:
            continue
        if predicted is None or name not in {**OF_INPUT, **OF_SET_POINT}:
            found.append(f"{name} is given, and it is not known that it stays inactive")
            continue
        signal = predicted.reshape(len(predicted), -1)
        order = {**OF_INPUT, **OF_SET_POINT}[name]
        if name in OF_SET_POINT and bounds.get("reference") is not None:
            signal = signal + np.asarray(bounds["reference"], float).reshape(signal.shape)
        for _ in range(order):
            signal = np.diff(signal, axis=0, prepend=0.0 if name in OF_INPUT else signal[:1])
        if name in OF_SET_POINT:
            signal = signal / dt_s**order
        low, high = _sides(bound, len(signal))
        if (signal > share * high).any() or (signal < share * low).any():
            peak = float(np.abs(signal).max())
            allowed = f"{bound:g}" if isinstance(bound, (int, float)) else "less"
            what = name.removesuffix("_max").removesuffix("_bounds")
            found.append(f"the {what} would be {peak:.3g}, of which {name} allows {allowed}")
    return found


def _sides(bound: Any, n_samples: int) -> tuple[Array, Array]:  # noqa: ANN401
    """Return lower and upper bound, to be compared with (n_samples, n_channels)."""
    low, high = bound if isinstance(bound, tuple) else (-np.abs(bound), np.abs(bound))
    sides = []
    for side, free in ((low, -np.inf), (high, np.inf)):
        values = np.asarray(free if side is None else side, dtype=np.float64)
        if values.ndim == 1 and len(values) == n_samples:
            values = values[:, None]
        sides.append(values)
    return sides[0], sides[1]

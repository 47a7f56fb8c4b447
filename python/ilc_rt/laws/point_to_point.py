"""Point-to-point ILC: only some samples of the reference count: `PointToPointIlc`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import Law, LearningError
from ilc_rt.given import given
from ilc_rt.laws.python_law import whole

if TYPE_CHECKING:
    from typing_extensions import Self

    from ilc_rt._native import StateSpace

POINTS_MAX = 2000


class PointToPointIlc(Law):
    """Point-to-point ILC: the error at some samples vanishes with the smallest change of the input.

    ``u' = u + gain P_s' (P_s P_s' + r I)^-1 e_s``, P_s the rows of the lifted system at the points

    Parameters
    ----------
    model : StateSpace
        Discrete model from the learned input to the measurement, including its dead time.
    n_samples : int
        Samples of a run.
    points : sequence of int
        Samples that count, each once, from 0; the motion between them is free.
    gain : float
        Share of the correction, above 0 and below 2.
    r : float
        Weight of the change of the input against the error; 0 for an exact solution.

    Raises
    ------
    LearningError
        If a point is out of range or before the first effect of the input, the points contradict
        each other, or a number is out of range.
    ModelError, TypeError
        If the model is continuous or not a model, or the points are not whole numbers.

    Notes
    -----
    With an exact model, gain 1 and r = 0 the points are reached after one run. The error counts at
    the points alone.

    References
    ----------
    [freeman2013]; [owens2013].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import discretize, second_order, simulate
    >>> from ilc_rt.laws import PointToPointIlc
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> law = PointToPointIlc(axis, 200, [60, 199])
    >>> error = simulate(axis, law, np.linspace(0.0, 0.01, 200), trials=2).error[1, :, 0]
    >>> bool(np.abs(error[[60, 199]]).max() < 1e-12 < np.abs(error).max())
    True
    """

    def __new__(
        cls,
        model: StateSpace,
        n_samples: int,
        points: Sequence[int],
        gain: float = 1.0,
        r: float = 0.0,
    ) -> Self:
        if isinstance(points, str) or not isinstance(points, (Sequence, np.ndarray)):
            message = f"points = {points!r}: a list of samples is needed"
            raise TypeError(message)
        n_samples = whole("n_samples", n_samples, 1, 10_000_000)
        points = [whole("points", point, 0, n_samples - 1) for point in points]
        if not 1 <= len(points) <= POINTS_MAX or len(set(points)) < len(points):
            message = f"points: 1 to {POINTS_MAX} different samples are needed"
            raise LearningError(message)
        return super().__new__(cls, "point_to_point", given(locals()))

"""Point-to-point ILC: only some samples of the reference count: `PointToPointIlc`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import LearningError, StateSpace
from ilc_rt.given import given
from ilc_rt.laws.python_law import PythonLaw, number, signals, whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

POINTS_MAX = 2000
VALUES_MAX = 50_000_000


class PointToPointIlc(PythonLaw):
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
    TypeError
        If the model is not a `StateSpace`, or the points are not whole numbers.

    Notes
    -----
    With an exact model, gain 1 and r = 0 the points are reached after one run. The system at the
    points has one row per point and output, so that an update is a product with a matrix of
    n_points times n_samples.

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

    def __init__(
        self,
        model: StateSpace,
        n_samples: int,
        points: Sequence[int],
        gain: float = 1.0,
        r: float = 0.0,
    ) -> None:
        super().__init__(**given(locals()))
        if not isinstance(model, StateSpace):
            message = f"model is a {type(model).__name__}; a StateSpace is needed"
            raise TypeError(message)
        if model.dt_s is None:
            message = "model: a discrete-time model is needed"
            raise LearningError(message)
        self._n = whole("n_samples", n_samples, 1, 10_000_000)
        if isinstance(points, str) or not isinstance(points, (Sequence, np.ndarray)):
            message = f"points = {points!r}: a list of samples is needed"
            raise TypeError(message)
        self._points = [whole("points", point, 0, self._n - 1) for point in points]
        if not 1 <= len(self._points) <= POINTS_MAX or len(set(self._points)) < len(self._points):
            message = f"points: 1 to {POINTS_MAX} different samples are needed"
            raise LearningError(message)
        self._m, self._p = model.n_inputs, model.n_outputs
        if len(self._points) * self._n * self._m * self._p > VALUES_MAX:
            message = f"points: at most {VALUES_MAX} values of points times samples are allowed"
            raise LearningError(message)
        self._gain = number("gain", gain, np.nextafter(0.0, 1.0), np.nextafter(2.0, 0.0))
        self._rows = self._lifted_rows(model.markov(max(self._points) + 1))
        self._factor = self._solved(number("r", r, 0.0, 1e12))

    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the next input.

        Parameters
        ----------
        u, e : array_like, shape (n_samples,) or (n_samples, n_channels)
            Input and error of a run; the error counts at the points alone.
        disturbance : object
            Not used.

        Returns
        -------
        ndarray of float64, shape of `u`
            The next input.

        Raises
        ------
        ValueError, TypeError
            If an array does not suit the law.
        """
        del disturbance
        given_u, given_e = signals(u, e, self._n, self._m, self._p)
        change = self._rows.T @ (self._factor @ given_e[self._points].ravel())
        return (given_u + self._gain * change.reshape(given_u.shape)).reshape(np.shape(u))

    def _lifted_rows(self, markov: Array) -> Array:
        """Return the rows of the lifted system at the points, one per point and output."""
        rows = np.zeros((len(self._points), self._p, self._n, self._m))
        for number_of, point in enumerate(self._points):
            # Row k of the lifted system holds h[k], h[k-1], ..., h[0].
            rows[number_of, :, : point + 1] = markov[point::-1].transpose(1, 0, 2)
        return rows.reshape(len(self._points) * self._p, self._n * self._m)

    def _solved(self, r: float) -> Array:
        gram = self._rows @ self._rows.T
        unreached = np.flatnonzero(np.diag(gram) == 0.0)
        if unreached.size and r == 0.0:
            point = self._points[int(unreached[0]) // self._p]
            message = f"points: sample {point} is before the first effect of the input"
            raise LearningError(message)
        regular = gram + r * np.eye(len(gram))
        if np.linalg.cond(regular) > 1e13:
            message = "points: too near to each other for this model: give an r above 0"
            raise LearningError(message)
        return np.linalg.inv(regular).astype(np.float64)

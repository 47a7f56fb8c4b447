"""The newest seconds of fast signals, thinned to minima and maxima; imported by `model`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

N_BUCKETS = 250
WINDOW_S = 10.0


class Window:
    """Ring of minima and maxima over equal spans of servo cycles.

    A peak of a single cycle stays visible, however few points are drawn.

    Parameters
    ----------
    n_signals : int
        Number of signals.
    span : int
        Servo cycles per bucket.
    n_buckets : int
        Length of the ring.

    Examples
    --------
    >>> window = Window(1, span=2, n_buckets=4)
    >>> window.extend(0, np.array([[1.0], [5.0], [2.0], [0.0], [9.0]]))
    >>> first, low, high = window.since(0)
    >>> first, low.ravel().tolist(), high.ravel().tolist()
    (0, [1.0, 0.0], [5.0, 2.0])
    """

    def __init__(self, n_signals: int, span: int, n_buckets: int = N_BUCKETS) -> None:
        self.n_signals = n_signals
        self.span = max(1, span)
        self.n_buckets = n_buckets
        self._low = np.full((n_buckets, n_signals), np.nan)
        self._high = np.full((n_buckets, n_signals), np.nan)
        # First bucket with values, and the newest one, which is still being filled.
        self._first = self._head = -1

    @property
    def end(self) -> int:
        """Number of the bucket that is complete next."""
        return max(0, self._head)

    def extend(self, first: int, values: Array) -> None:
        """Add cycles from number `first` on, of shape (n_cycles, n_signals); NaN has no value.

        Skipped cycles leave a gap. Numbers must not fall: a loop that starts again needs a new
        window.
        """
        numbers = (first + np.arange(len(values))) // self.span
        starts = np.flatnonzero(np.concatenate(([True], np.diff(numbers) > 0)))
        low = np.fmin.reduceat(values, starts, axis=0)
        high = np.fmax.reduceat(values, starts, axis=0)
        for number, least, most in zip(numbers[starts].tolist(), low, high, strict=True):
            if self._first < 0:
                self._first, self._head = number, number - 1
            for new in range(max(self._head + 1, number - self.n_buckets + 1), number + 1):
                self._low[new % self.n_buckets] = self._high[new % self.n_buckets] = np.nan
            self._head = max(self._head, number)
            slot = number % self.n_buckets
            self._low[slot] = np.fmin(self._low[slot], least)
            self._high[slot] = np.fmax(self._high[slot], most)

    def since(self, bucket: int) -> tuple[int, Array, Array]:
        """Return the complete buckets from a number on, as far as they are kept.

        Returns
        -------
        first : int
            Number of the first bucket returned.
        low, high : ndarray of float64, shape (n, n_signals)
            Minima and maxima; NaN in a gap.
        """
        first = max(bucket, self._first, self._head - self.n_buckets + 1, 0)
        slots = np.arange(first, max(first, self._head)) % self.n_buckets
        return first, self._low[slots], self._high[slots]

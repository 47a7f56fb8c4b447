"""Time that may be spent on waiting for others; imported by `monitor`."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

#: What may be spent at once, and the share of the time that is given back.
MAX_S = 20.0
SHARE = 0.1


class Patience:
    """Budget of waiting: who never answers takes a tenth of the time at most.

    Parameters
    ----------
    clock : callable
        Returns the time in seconds; only differences count.

    Examples
    --------
    >>> now_s = [0.0]
    >>> patience = Patience(lambda: now_s[0])
    >>> with patience.spent():
    ...     now_s[0] = 25.0
    >>> patience.is_left
    False
    >>> now_s[0] += 60.0
    >>> patience.is_left
    True
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._left_s, self._at_s = MAX_S, clock()

    @property
    def is_left(self) -> bool:
        """Return whether there is time to wait."""
        self._give_back()
        return self._left_s > 0.0

    @contextmanager
    def spent(self) -> Iterator[None]:
        """Take the time of the block from what is left."""
        since_s = self._clock()
        try:
            yield
        finally:
            self._give_back()
            self._left_s -= self._clock() - since_s

    def _give_back(self) -> None:
        now_s = self._clock()
        self._left_s = min(MAX_S, self._left_s + SHARE * (now_s - self._at_s))
        self._at_s = now_s

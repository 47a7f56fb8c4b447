"""Runs of a law on a simulated plant; only the sections of this package import it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Law(Protocol):
    """Settings that all laws share."""

    def update(self, u: Any, e: Any, disturbance: Any = None) -> Array:  # noqa: ANN401
        """Return the input of the next run."""
        ...


def runs(
    law: Law | None,
    plant: Callable[[Array], Array],
    first_error: Array,
    iterations: int,
    disturbance: Callable[[int], Array | float] = lambda _: 0.0,
) -> Iterator[tuple[Array, Array]]:
    """Yield input and error of each run, from run 0 with no input.

    `e_j = e_0 - P u_j - d_j`

    `e_0` is the error without learning and disturbance; `law` None leaves the input at zero.

    References
    ----------
    Barton 2010, eq. (3.2), (3.9), (3.10).
    """
    u = np.zeros_like(first_error)
    for j in range(iterations + 1):
        e = first_error - plant(u) - disturbance(j)
        yield u, e
        if law is not None and j < iterations:
            u = law.update(u, e)


def rms(values: Array) -> float:
    """Return the root of the mean square of all entries."""
    return float(np.sqrt(np.mean(np.square(values))))

"""Higher-order ILC, from several past runs: `HigherOrderIlc`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import LearningError
from ilc_rt.given import given
from ilc_rt.laws.python_law import PythonLaw, number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import AnyLaw


class HigherOrderIlc(PythonLaw):
    """Higher order in the iteration: the next input from several past runs, with any law.

    ``u[j+1] = sum_i w_i law(u[j-i], e[j-i])``, i = 0 for the last run

    Parameters
    ----------
    law : Law or object
        Any law without memory: one of this package, or an object with
        ``update(u, e, disturbance)``.
    weights : sequence of float
        Weights of the last run, the one before, ...; they add up to 1. (1.5, -0.5) extrapolates,
        (0.5, 0.5) averages noise.

    Raises
    ------
    LearningError
        If there are no weights or more than 20, or they do not add up to 1.
    TypeError
        If `law` is not a law, or a weight not a number.

    Notes
    -----
    A missing earlier run is replaced by the oldest one. For a law with contraction ``T`` the inputs
    converge if the roots of ``z^n = T (w_0 z^(n-1) + ... + w_(n-1))`` are inside the unit circle
    for every eigenvalue of T.

    References
    ----------
    [bien1989].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc
    >>> from ilc_rt.laws import HigherOrderIlc
    >>> law = HigherOrderIlc(PdIlc(kp=1.0, lead_samples=0), (0.5, 0.5))
    >>> law.update(np.zeros(2), np.ones(2)), law.update(np.ones(2), np.ones(2))
    (array([1., 1.]), array([1.5, 1.5]))
    """

    def __init__(self, law: AnyLaw, weights: Sequence[float] = (1.5, -0.5)) -> None:
        super().__init__(**given(locals()))
        if not callable(getattr(law, "update", None)):
            message = f"law = {law!r}: an object with update(u, e, disturbance=None) is needed"
            raise TypeError(message)
        if not isinstance(weights, (Sequence, np.ndarray)) or isinstance(weights, str):
            message = f"weights = {weights!r}: a list of numbers is needed"
            raise TypeError(message)
        self._weights = [number("weights", weight, -1e3, 1e3) for weight in weights]
        if not 1 <= len(self._weights) <= 20 or abs(sum(self._weights) - 1.0) > 1e-9:
            message = f"weights = {weights!r}: 1 to 20 numbers that add up to 1 are needed"
            raise LearningError(message)
        self._law = law
        self._proposals: list[NDArray[np.float64]] = []

    @property
    def law(self) -> AnyLaw:
        """The inner law."""
        return self._law

    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the next input.

        Parameters
        ----------
        u, e : array_like, shape (n_samples,) or (n_samples, n_channels)
            Input and error of a run.
        disturbance : array_like or None
            Passed on to the inner law.

        Returns
        -------
        ndarray of float64, shape of `u`
            The next input.
        """
        given_u, given_e = np.asarray(u), np.asarray(e)
        told = None if disturbance is None else np.asarray(disturbance)
        proposal = np.asarray(self._law.update(given_u, given_e, told), dtype=np.float64)
        if self._proposals and self._proposals[0].shape != proposal.shape:
            message = f"u has shape {given_u.shape}, but {self._proposals[0].shape} before: reset()"
            raise ValueError(message)
        self._proposals = [proposal, *self._proposals][: len(self._weights)]
        last = len(self._proposals) - 1
        parts = [w * self._proposals[min(i, last)] for i, w in enumerate(self._weights)]
        return np.sum(parts, axis=0)

    def taken_back(self) -> None:
        """Forget the past runs, as the input is another one now."""
        self._proposals = []

    def reset(self) -> None:
        """Forget the past runs, and everything that the inner law learned."""
        self._proposals = []
        reset = getattr(self._law, "reset", None)
        if callable(reset):
            reset()

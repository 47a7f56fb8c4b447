"""Higher-order ILC, from several past runs: `HigherOrderIlc`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt._native import Law
from ilc_rt.given import given
from ilc_rt.laws.python_law import number

if TYPE_CHECKING:
    from typing_extensions import Self

    from ilc_rt.laws.arguments import AnyLaw


class HigherOrderIlc(Law):
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

    def __new__(cls, law: AnyLaw, weights: Sequence[float] = (1.5, -0.5)) -> Self:
        if not isinstance(weights, (Sequence, np.ndarray)) or isinstance(weights, str):
            message = f"weights = {weights!r}: a list of numbers is needed"
            raise TypeError(message)
        weights = [number("weights", weight, -1e3, 1e3) for weight in weights]
        return super().__new__(cls, "higher_order", given(locals()))

    @property
    def law(self) -> Any:  # noqa: ANN401
        """The inner law."""
        return self.parameters["law"]

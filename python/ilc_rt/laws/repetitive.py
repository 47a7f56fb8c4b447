"""Repetitive ILC over the position, in a table: `RepetitiveIlc`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import LearningError
from ilc_rt.given import given
from ilc_rt.laws.basis import NAMED
from ilc_rt.laws.basis_functions import BasisFunctions
from ilc_rt.laws.python_law import number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from ilc_rt._native import StateSpace, TimeVarying
    from ilc_rt.laws.basis import Basis

    Array = NDArray[np.float64]

ENTRIES_MAX = 2000


@dataclass(frozen=True)
class _Entry:
    """An entry of a table, between whose entries the input is interpolated linearly."""

    at: float
    spacing: float
    travel: int

    def __call__(self, reference: Array, dt_s: float) -> Array:
        hat = np.maximum(0.0, 1.0 - np.abs(reference - self.at) / self.spacing)
        if not self.travel:
            return hat
        return hat * 0.5 * (1.0 + self.travel * NAMED["coulomb"](reference, dt_s))


class RepetitiveIlc(BasisFunctions):
    """Repetitive ILC over the position: a table for each axis, which holds on every trajectory.

    ``u = table(r) + Psi(r) theta``, both learned as `BasisFunctions` does

    Parameters
    ----------
    model : StateSpace or TimeVarying
        Discrete model P from the learned input to the measurement, with one input per axis of the
        reference.
    reference : array_like, shape (n_samples,) or (n_samples, n_axes)
        Reference r of the runs that are learned from.
    spacing : float
        Distance of the entries, in the unit of the position: a sixth of the shortest period at
        most.
    by_direction : bool
        A table for each direction of travel, in place of one for both.
    functions : sequence of str or callable
        Functions of the motion, learned beside the table, so that it holds at every speed; as the
        basis of `BasisFunctions`.
    q, s, r : float or array_like
        Weights as those of `BasisFunctions`.
    lead_samples : int or None
        Samples by which the signals are ahead of the reference, 0 to 1000; None for the dead time
        of the model.
    parameters : array_like or None, shape (n_axes, n_functions + n_entries)
        Parameters to begin with; None for zero.
    learn : bool
        Learn; otherwise the parameters stay as they are.
    span : tuple of float or None
        Lowest and highest position of the table; None for those of the reference. Another reference
        must lie within.

    Raises
    ------
    LearningError
        If the spacing is out of range, or as for `BasisFunctions`.
    ValueError, TypeError
        If an argument has the wrong shape or dtype, or a number that is not finite.

    Notes
    -----
    For cogging, the pitch of a screw, an eccentric wheel, of any shape over the position, as long
    as its frequency is well below the bandwidth of the axis. Positions that the reference did not
    pass keep their entry.

    References
    ----------
    [vandewijdeven2010]; [bolder2015].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import discretize, second_order, simulate
    >>> from ilc_rt.laws import RepetitiveIlc
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> slow, fast = 0.05 * np.hanning(2000), 0.05 * np.hanning(1200)
    >>> law = RepetitiveIlc(axis, slow, 0.002, functions=["position", "velocity", "acceleration"])
    >>> cogging = lambda r: 2e-4 * np.sin(2 * np.pi * r / 0.02)
    >>> learned = simulate(axis, law, slow, trials=3, output_disturbance=cogging(slow))
    >>> error = fast - cogging(fast) - axis.simulate(law.input(fast))
    >>> bool(np.abs(error).max() < 0.5 * 2e-4)
    True
    """

    def __init__(
        self,
        model: StateSpace | TimeVarying,
        reference: ArrayLike,
        spacing: float,
        by_direction: bool = False,  # noqa: FBT001 (like every other parameter of a law)
        functions: Sequence[Basis] = ("velocity", "acceleration", "coulomb"),
        q: ArrayLike = 1.0,
        s: ArrayLike = 0.0,
        r: ArrayLike = 0.0,
        lead_samples: int | None = None,
        parameters: ArrayLike | None = None,
        learn: bool = True,  # noqa: FBT001
        span: tuple[float, float] | None = None,
    ) -> None:
        arguments = given(locals())
        spacing = number("spacing", spacing, np.nextafter(0.0, 1.0))
        if not isinstance(by_direction, (bool, np.bool_)):
            message = f"by_direction = {by_direction!r}: True or False is needed"
            raise TypeError(message)
        lowest, highest = _span(reference, span)
        first, last = np.floor(lowest / spacing), np.ceil(highest / spacing)
        if last - first > ENTRIES_MAX:
            message = (
                f"spacing = {spacing}: at most {ENTRIES_MAX} entries over the span are allowed"
            )
            raise LearningError(message)
        self._places: Array = spacing * np.arange(first, last + 1)
        travels = (1, -1) if by_direction else (0,)
        entries = [_Entry(float(at), spacing, way) for way in travels for at in self._places]
        self._n_tables, self._n_functions = len(travels), len(functions)
        basis = [*functions, *entries]
        super().__init__(model, reference, basis, q, s, r, lead_samples, parameters, learn)
        self._arguments = arguments | {"span": (lowest, highest)}

    @property
    def table(self) -> tuple[Array, Array]:
        """Positions of the entries, and their values of shape (n_axes, n_tables, n_entries).

        There is one table, or one forward and one backward.
        """
        values = self._theta()[:, self._n_functions :]
        return self._places.copy(), values.reshape(len(values), self._n_tables, -1)


def _span(reference: ArrayLike, span: tuple[float, float] | None) -> tuple[float, float]:
    if span is None:
        array = np.asarray(reference)
        if array.dtype.kind not in "iuf" or array.size == 0 or not np.isfinite(array).all():
            message = "reference: finite numbers are needed"
            raise ValueError(message)
        return float(array.min()), float(array.max())
    if not isinstance(span, (tuple, list)) or len(span) != 2:
        message = f"span = {span!r}: two numbers are needed"
        raise TypeError(message)
    lowest, highest = (number("span", end, -np.inf) for end in span)
    if highest < lowest:
        message = f"span = {span!r}: the lowest position comes first"
        raise LearningError(message)
    return lowest, highest

"""Laws with a memory of past runs: `RelevanceIlc`, `FlexibleIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import Law
from ilc_rt.given import given
from ilc_rt.laws.relevance_weights import RelevanceWeights

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

    from ilc_rt.laws.arguments import AnyLaw
    from ilc_rt.library import Library


class _Recalled(Law):
    """A law that computes the next input from remembered runs."""

    def __len__(self) -> int:
        """Return the number of runs in memory."""
        return self._figure("n_runs")

    def remember(self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None) -> None:
        """Add an earlier run, or one made elsewhere, to the memory.

        Parameters
        ----------
        u, e : array_like, shape (n_samples,) or (n_samples, n_channels)
            Its input and error.
        disturbance : float or array_like, shape (n_disturbances,)
            Its disturbance; None if none is measured.

        Raises
        ------
        ValueError, TypeError
            As `update` does.
        """
        self._remember(u, e, disturbance)


class RelevanceIlc(_Recalled):
    """DPW-ILC: learning from every past run, weighted by its relevance.

    ``u' = sum_j w_j L(u_j, e_j)``, ``w_j = N_j / sum_k N_k``

    with L the core law and N_j the relevance of run j: large for a run with a small error and a
    disturbance similar to the coming one.

    Parameters
    ----------
    library : Library or None
        Runs of earlier campaigns; matching ones are read once, at the first update: the same number
        of samples, axes and disturbances, and the same cell, program and measurement as the newest
        of that size. None: memory only. The law never writes: `Campaign` and `Library.append` do.
    core : Law or object
        Law that proposes the next input from one run: any law, or any object with
        ``update(u, e, disturbance=None)`` whose result depends on u and e alone.
    weights : RelevanceWeights or tuple (error, error_rate, disturbance)
        Weights of error, error rate and disturbance.
    top : int or None
        Number of the most relevant runs that count; None: all. Exact, and of
        equally relevant runs the older ones.
    dt_s : float or None
        Sample time in seconds, for the error's rate. None: that of the runs in
        the library.
    cell : str or None
        Only runs of the cell of this name.

    Raises
    ------
    LearningError
        If a weight is negative, top is 0 or the sample time is not positive. `update` raises it if
        the number of disturbances changes.
    TypeError
        If core is not a law.

    Notes
    -----
    The disturbance given to `update` is the coming run's: it is measured before that run and used
    to weight the past. The law stores the run under it once its error is known. So the disturbance
    of the first run has to be set by `expect`; a run without one is used for the next input but not
    stored. If omitted, the disturbance is that of the previous run. At most 7 numbers.

    References
    ----------
    [dimarco2016], Eq. (4.2) to (4.14), Appendix C.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, RelevanceIlc
    >>> law = RelevanceIlc(None, PdIlc(kp=1.0, kd=0.0), (1.0, 0.0, 1.0), top=30)
    >>> law.expect(20.0)
    >>> law.update(np.zeros(3), np.array([1.0, 2.0, 4.0]), disturbance=25.0)
    array([2., 4., 4.])
    >>> len(law)
    1
    """

    def __new__(
        cls,
        library: Library | None,
        core: AnyLaw,
        weights: RelevanceWeights | tuple[float, float, ArrayLike],
        top: int | None = None,
        *,
        dt_s: float | None = None,
        cell: str | None = None,
    ) -> Self:
        if not isinstance(weights, RelevanceWeights):
            if not isinstance(weights, (tuple, list)) or len(weights) != 3:
                line = f"weights = {weights!r}: RelevanceWeights or a tuple (error, error_rate, "
                line += "disturbance) is needed"
                raise TypeError(line)
            weights = RelevanceWeights(*weights)
        return super().__new__(cls, "relevance", given(locals()))

    def relevant(
        self, disturbance: ArrayLike | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the runs that count under a disturbance, the most relevant first.

        Parameters
        ----------
        disturbance : float, array_like or None, shape (n_disturbances,)
            The disturbance; None if none is measured.

        Returns
        -------
        runs : ndarray of int64, shape (n_runs,)
            Indices of the runs in memory, from 0.
        weights : ndarray of float64, shape (n_runs,)
            Their weights, which add up to 1.

        Raises
        ------
        ValueError, TypeError
            If it is not a disturbance of this law.
        """
        runs, weights = self._relevant(disturbance)
        return np.array(runs, np.int64), np.array(weights, np.float64)

    def trim(self, keep: int, disturbances: ArrayLike | None = None) -> NDArray[np.int64]:
        """Keep only the runs with the largest weights.

        Parameters
        ----------
        keep : int
            Number of runs to keep.
        disturbances : array_like or None, shape (n, n_disturbances), or (n,) for a single one
            Coming disturbances; None: those of all runs in memory, as if they were repeated.

        Returns
        -------
        ndarray of int64, shape (n_kept,)
            Indices, before the trimming, of the runs kept.

        Raises
        ------
        ValueError, TypeError
            If the disturbances have the wrong shape.

        Notes
        -----
        A run's share is the sum of its weights under each of the disturbances; the largest shares
        are kept. For a single disturbance these are exactly the runs most relevant for it.
        """
        given = None if disturbances is None else np.ravel(disturbances)
        return np.array(self._trim(keep, given), np.int64)


class FlexibleIlc(_Recalled):
    """Flexible ILC: learning with a table of inputs over the disturbance.

    ``u' = (1 - t) L(u_a, e_a) + t L(u_b, e_b)``

    with L the core law, a the last run under the tabulated disturbance nearest to the coming one, b
    that under the nearest one beyond it, and t the interpolation factor from a to b.

    Parameters
    ----------
    library : Library or None
        Runs of earlier campaigns; matching ones are read once, at the first update, as for
        `RelevanceIlc`.
    core : Law or object
        Law that computes the next input from one run; a `NormOptimalIlc` with s = r = 0 inverts the
        model, as in the source.
    tolerance : float
        Distance up to which two disturbances are the same entry of the table.
    cell : str or None
        Only runs of the cell of this name.

    Raises
    ------
    LearningError
        If the tolerance is negative or not finite. `update` raises it if the number
        of disturbances changes.
    TypeError
        If core is not a law.

    Notes
    -----
    The disturbance given to `update` is the coming run's, as for `RelevanceIlc`. Beyond the table
    the nearest entry is used. The law uses two runs only, however large their errors: it serves for
    comparison.

    References
    ----------
    [hoelzle2012], as described in [dimarco2016], Sec. 3.2.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import FlexibleIlc, PdIlc
    >>> law = FlexibleIlc(None, PdIlc(kp=1.0, kd=0.0))
    >>> law.remember(np.zeros(2), np.full(2, 1.0), disturbance=10.0)
    >>> law.remember(np.zeros(2), np.full(2, 3.0), disturbance=20.0)
    >>> law.update(np.zeros(2), np.zeros(2), disturbance=15.0)
    array([2., 2.])
    """

    def __new__(
        cls,
        library: Library | None,
        core: AnyLaw,
        tolerance: float = 0.0,
        *,
        cell: str | None = None,
    ) -> Self:
        return super().__new__(cls, "flexible", given(locals()))

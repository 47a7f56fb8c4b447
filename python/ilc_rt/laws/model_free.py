"""Gradient ILC without a model, by runs backward in time: `ModelFreeIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ilc_rt._native import LearningError
from ilc_rt.given import given
from ilc_rt.laws.python_law import PythonLaw, number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]


class ModelFreeIlc(PythonLaw):
    """Gradient ILC whose adjoint is measured: the plant itself is run with the reversed error.

    ``u' = u + alpha P'e``, ``P'e = R P R e`` with R the reversal of time

    Parameters
    ----------
    gain : float or None
        Step alpha, which must be below ``2 / |P|^2``; None for the best step in each iteration, by
        a third run.
    probe : float
        Size of the probing inputs relative to the error, input units per error unit.

    Raises
    ------
    LearningError
        If a number is out of range.

    Notes
    -----
    One iteration takes two runs, the learning run and the probing run, or three with `gain` None:
    then a run along the gradient gives the step ``alpha = <e, P g> / |P g|^2``. `phase` tells what
    the next run is for. Errors of probing runs may be larger than those of learning runs: use it in
    a simulation or by ask and tell, or let a `Campaign` accept it with `rollback_ratio` large
    enough. For one input and one output, linear and time-invariant: then P is symmetric about
    its antidiagonal, which is why the adjoint can be measured. The difference of two runs
    removes what is the same in both, such as friction at the same velocity or the reference.

    References
    ----------
    [bolder2018].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import discretize, second_order, simulate
    >>> from ilc_rt.laws import ModelFreeIlc
    >>> axis = discretize(second_order(94.0, 0.7), 0.002)
    >>> rms = simulate(axis, ModelFreeIlc(), np.hanning(200), trials=13).figures()["tracking_rms_m"]
    >>> bool((np.diff(rms[::3]) < 0).all())
    True
    """

    def __init__(self, gain: float | None = None, probe: float = 0.1) -> None:
        super().__init__(**given(locals()))
        smallest = np.nextafter(0.0, 1.0)
        self._gain = None if gain is None else number("gain", gain, smallest, 1e12)
        self._probe = number("probe", probe, 1e-9, 1e9)
        self.reset()

    @property
    def phase(self) -> Literal["learning", "probing", "searching"]:
        """Purpose of the next run: its error counts, or it measures the adjoint or the step."""
        return self._phase

    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the input of the next run, for learning, probing or searching.

        Parameters
        ----------
        u, e : array_like, shape (n_samples,) or (n_samples, 1)
            Input and error of the run.
        disturbance : object
            Not used.

        Returns
        -------
        ndarray of float64, shape of `u`
            The next input.

        Raises
        ------
        LearningError
            If there are several channels.
        ValueError, TypeError
            If the shapes differ, or an array holds no finite numbers.
        """
        del disturbance
        given_u, given_e = _channel("u", u), _channel("e", e)
        if given_u.shape != given_e.shape or len(given_u) < 2:
            message = f"u has shape {np.shape(u)}, e {np.shape(e)}; the same one is needed"
            raise ValueError(message)
        if self._phase != "learning" and self._u.shape != given_u.shape:
            message = f"u has {len(given_u)} samples, but {len(self._u)} before: reset()"
            raise ValueError(message)
        return self._next(given_u, given_e).reshape(np.shape(u))

    def taken_back(self) -> None:
        """Begin a new iteration, as the input is another one now."""
        self.reset()

    def reset(self) -> None:
        """Begin a new iteration."""
        self._phase: Literal["learning", "probing", "searching"] = "learning"
        self._u = self._e = self._gradient = np.zeros(0)
        self._step = 0.0

    def _next(self, u: Array, e: Array) -> Array:
        if self._phase == "learning":
            self._u, self._e = u.copy(), e.copy()
            if not e.any():
                return u
            self._phase = "probing"
            return u + self._probe * e[::-1]
        if self._phase == "probing":
            answer = (self._e - e) / self._probe
            self._gradient = answer[::-1].copy()
            if self._gain is not None or not answer.any():
                self._phase = "learning"
                return self._u + (self._gain or 0.0) * self._gradient
            # A cautious step for the search: |P| is at least |P R e| / |e|.
            self._step = float(np.sum(self._e**2) / np.sum(answer**2)) * self._probe
            self._phase = "searching"
            return self._u + self._step * self._gradient
        self._phase = "learning"
        along = (self._e - e) / self._step
        size = float(np.sum(along**2))
        best = float(np.sum(self._e * along)) / size if size > 0.0 else 0.0
        return self._u + best * self._gradient


def _channel(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        message = f"{name} has dtype {array.dtype}; numbers are needed"
        raise TypeError(message)
    if array.ndim > 2 or array.ndim == 0 or (array.ndim == 2 and array.shape[1] != 1):
        message = f"{name} has shape {array.shape}: one input and one output are needed"
        raise LearningError(message)
    if not np.isfinite(array).all():
        message = f"{name}: only finite numbers are allowed"
        raise ValueError(message)
    return array.reshape(-1).astype(np.float64)

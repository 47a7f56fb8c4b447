"""Gradient ILC without a model, by runs backward in time: `ModelFreeIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, cast

from ilc_rt._native import Law
from ilc_rt.given import given

if TYPE_CHECKING:
    from typing_extensions import Self


class ModelFreeIlc(Law):
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
        If a number is out of range, or a run has several channels.

    Notes
    -----
    One iteration takes two runs, the learning run and the probing run, or three with `gain` None:
    then a run along the gradient gives the step ``alpha = <e, P g> / |P g|^2``. `phase` tells what
    the next run is for. Errors of probing runs may be larger than those of learning runs: a
    `Campaign` marks them in its library (`phase` of the figures), and rolls back for none of them.
    For one input and one output, linear and time-invariant: then P is symmetric about its
    antidiagonal, which is why the adjoint can be measured; a cell description may have several
    axes that are not coupled. The difference of two runs removes what is the same in both, such as
    friction at the same velocity or the reference. A run whose input was not the one that the law
    returned is asked for again.

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

    def __new__(cls, gain: float | None = None, probe: float = 0.1) -> Self:
        return super().__new__(cls, "model_free", given(locals()))

    @property
    def gain(self) -> float | None:
        """Step, as given; None for the best one in each iteration."""
        value = self.parameters["gain"]
        return None if value is None else float(value)

    @property
    def probe(self) -> float:
        """Size of the probing inputs relative to the error."""
        return float(self.parameters["probe"])

    @property
    def phase(self) -> Literal["learning", "probing", "searching"]:
        """Purpose of the next run: its error counts, or it measures the adjoint or the step."""
        return cast("Literal['learning', 'probing', 'searching']", self._figure("phase"))

"""Inverse-model ILC for non-minimum phase: `StableInverseIlc`, by stable inversion or ZPETC."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ilc_rt._native import Law
from ilc_rt.given import given

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Self

    from ilc_rt._native import StateSpace
    from ilc_rt.laws.arguments import QFilter


class StableInverseIlc(Law):
    """Inverse-model ILC that also inverts zeros outside the unit circle, by looking ahead.

    ``u' = Q (u + gain L e)``, with ``P = K Bs(z) Bu(z) / A(z)``, Bu having the zeros outside;
    stable inversion: ``L = A / (K Bs Bu)``, 1/Bu run backward in time;
    ZPETC: ``L = A Bu(1/z) / (K Bs Bu(1)^2)``

    Parameters
    ----------
    model : StateSpace
        Discrete model including its dead time, of axes that it does not couple.
    n_samples : int
        Samples of a run.
    gain : float
        Step, above 0 and below 2.
    method : {"stable_inversion", "zpetc"}
        Exact inverse by preactuation, or zero phase error tracking: no phase error, a gain that
        differs from 1 at high frequency, no preactuation beyond the order of Bu.
    zero_radius : float
        Zeros outside this radius count as outside; below 1 for ZPETC alone, so that zeros near -1
        are not cancelled and the input does not ring.
    q_filter : Filter, array_like or None
        Low-pass Q of `ilc_rt.signal`, zero-phase.

    Raises
    ------
    LearningError
        If a zero is on the unit circle, the model responds to no input or couples axes, or a number
        is out of range.
    ModelError, ValueError, TypeError
        If the model is continuous or not a model, its zeros cannot be computed, or the method is
        unknown.

    Notes
    -----
    Each axis separately. The error is held beyond the end of the run, and is zero before it:
    preactuation that would begin before the run is cut off, so let the reference rest at first for
    the settling time of the zeros outside. `ModelInverseIlc` is the law for models without such
    zeros.

    References
    ----------
    [tomizuka1987]; [devasia1996]; [vanzundert2018].

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import from_transfer_function, simulate
    >>> from ilc_rt.laws import StableInverseIlc
    >>> plant = from_transfer_function([1.0, -1.5], [1.0, -1.2, 0.4], 0.01)
    >>> reference = np.where(np.arange(200) < 60, 0.0, 1.0)
    >>> law = StableInverseIlc(plant, 200, gain=1.0)
    >>> result = simulate(plant, law, reference, trials=2)
    >>> result.records[1].tracking_inf_m < 1e-9
    True
    """

    def __new__(
        cls,
        model: StateSpace,
        n_samples: int,
        gain: float = 0.5,
        method: Literal["stable_inversion", "zpetc"] = "stable_inversion",
        zero_radius: float = 1.0,
        q_filter: QFilter = None,
    ) -> Self:
        return super().__new__(cls, "stable_inverse", given(locals()))

    @property
    def zeros_outside(self) -> NDArray[np.complex128]:
        """Zeros that are not cancelled by a causal inverse."""
        given_here = self.parameters
        zeros = np.asarray(given_here["model"].zeros(), dtype=np.complex128)
        return zeros[np.abs(zeros) >= given_here["zero_radius"]]

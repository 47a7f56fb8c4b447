"""Laws without a model, for runs of any size: `PdIlc`, `ErrorFeedforwardIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt._native import Law
from ilc_rt.given import given
from ilc_rt.laws.arguments import renamed

if TYPE_CHECKING:
    from typing_extensions import Self

    from ilc_rt.laws.arguments import QFilter


class PdIlc(Law):
    """PD-type ILC with a low-pass Q-filter.

    ``u'[n] = Q (u[n] + kp e[n + lead] + kd (e[n + lead] - e[n + lead - 1]))``

    Parameters
    ----------
    kp : float
        Proportional gain, input units per error unit.
    kd : float
        Derivative gain: of the error's difference from sample to sample.
    q_filter : Filter, array_like or None
        Low-pass Q of `ilc_rt.signal`, zero-phase unless it is causal; an array holds the taps of a
        symmetric one.
    lead_samples : int
        Lead (look-ahead) of the error, 0 to 1000 samples: 1 for an axis without dead time, 1 more
        for each sample of dead time.

    Raises
    ------
    LearningError
        If a gain is not finite.
    SignalError, TypeError
        If `q_filter` is not a filter.

    Notes
    -----
    Each channel learns separately. Beyond the end of the run the error is held at its last value.

    References
    ----------
    [haas2016], Eq. (4); [dimarco2016], Eq. (3.2).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc
    >>> PdIlc(kp=1.0, kd=0.0).update(np.zeros(3), np.array([1.0, 2.0, 4.0]))
    array([2., 4., 4.])
    """

    @renamed(lead="lead_samples")
    def __new__(
        cls,
        kp: float = 0.5,
        kd: float = 0.0,
        q_filter: QFilter = None,
        lead_samples: int = 1,
    ) -> Self:
        return super().__new__(cls, "pd", given(locals()))


class ErrorFeedforwardIlc(Law):
    """Feed-forward learned from the filtered error.

    ``u'[k] = clamp(u[k] + gain (Q e)[k + lead])``

    Parameters
    ----------
    gain_per_s : float
        Learning gain, input units per error unit: 1/s for velocities from positions.
    filter : Filter, array_like or None
        Low-pass Q of the error; an array holds the taps of a symmetric one.
    lead_samples : int
        Lead (look-ahead) of the error, 0 to 1000 samples: 1 for an axis without dead time, 1 more
        for each sample of dead time.
    input_max : float or None
        Bound of the learned feed-forward.

    Raises
    ------
    LearningError
        If the gain is not finite, or the bound not positive.
    SignalError, TypeError
        If `filter` is not a filter.

    Notes
    -----
    For the parallel structure: `u` is added to the controller's output. Each channel learns
    separately. Beyond the end of the run the error is held.

    References
    ----------
    [filter-based], Eq. (2), with the lead of Eq. (9).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import ErrorFeedforwardIlc
    >>> law = ErrorFeedforwardIlc(0.5, input_max=1.5)
    >>> law.update(np.zeros(3), np.array([1.0, 2.0, 4.0]))
    array([1. , 1.5, 1.5])
    """

    @renamed(gain="gain_per_s", lead="lead_samples", limit="input_max")
    def __new__(
        cls,
        gain_per_s: float = 10.0,
        filter: QFilter = None,
        lead_samples: int = 1,
        input_max: float | None = None,
    ) -> Self:
        return super().__new__(cls, "error_feedforward", given(locals()))

    @property
    def n_limited(self) -> int:
        """Number of saturated values of the last input."""
        return self._figure("n_limited")

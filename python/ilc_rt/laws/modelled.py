"""Model-based laws: `AdjointIlc` (gradient), `ModelInverseIlc`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt._native import Law
from ilc_rt.given import given

if TYPE_CHECKING:
    from typing_extensions import Self

    from ilc_rt.laws.arguments import Model, QFilter


class AdjointIlc(Law):
    """Adjoint (gradient) ILC: the error run backward through the model.

    ``u' = Q (u + gain P' e)``, P the lifted system of the model

    Parameters
    ----------
    model : StateSpace or compatible
        Discrete model from the learned input to the measurement, including the dead time of the
        bus.
    n_samples : int
        Samples of a run.
    gain : float or None
        Step alpha; by default ``1 / |P|^2``, half the limit.
    q_filter : Filter, array_like or None
        Low-pass Q, zero-phase unless it is causal; an array holds the taps of a symmetric one.

    Raises
    ------
    LearningError
        If the gain is not positive, or at least `gain_limit` without a filter; if the model
        responds to no input.
    ModelError, SignalError, TypeError
        If the model is continuous or not a model, or the filter is not a filter or
        too long for the run.

    Notes
    -----
    With an exact model the error falls in every run (monotone convergence) if the gain is less than
    `gain_limit`, which is ``2 / |P|^2``. The norm is estimated to about one part in 1000, on the
    safe side. Of the model-based laws this is the most robust against model errors; it is also the
    slowest where the gain of the model is small.

    References
    ----------
    [barton2010], Ch. 3: the gradient of Eq. (3.13) with S = R = 0.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import AdjointIlc, from_transfer_function
    >>> model = from_transfer_function([2.0], [1.0, 0.0], dt_s=1.0)
    >>> law = AdjointIlc(model, 3)
    >>> law.update(np.zeros(3), np.array([1.0, 2.0, 4.0])).round(9)
    array([1., 2., 0.])
    """

    def __new__(
        cls, model: Model, n_samples: int, gain: float | None = None, q_filter: QFilter = None
    ) -> Self:
        return super().__new__(cls, "adjoint", given(locals()))

    @property
    def gain(self) -> float:
        """Gain of the step."""
        return self._figure("gain")

    @property
    def gain_limit(self) -> float:
        """Gain above which the error grows, ``2 / |P|^2``."""
        return self._figure("gain_limit")


class ModelInverseIlc(Law):
    """Model-inverse ILC.

    ``u' = Q (u + gain P^-1 e)``, each output paired with the first sample at which it responds

    Parameters
    ----------
    model : StateSpace or compatible
        Discrete model from the learned input to the measurement, including the dead time of the
        bus.
    n_samples : int
        Samples of a run.
    gain : float
        Step alpha, above 0 and below 2.
    q_filter : Filter, array_like or None
        Low-pass Q, zero-phase unless it is causal; an array holds the taps of a symmetric one.

    Raises
    ------
    LearningError
        If the model has a zero on or outside the unit circle (non-minimum phase; the message names
        it), no inverse, or the gain is out of range.
    ModelError, SignalError, TypeError
        If the model is continuous or not a model, or the filter is not a filter or
        too long for the run.

    Notes
    -----
    With gain 1, an exact model and no filter the error is zero after one run. The inverse amplifies
    noise where the gain of the model is small: a Q-filter is needed there. Beyond the end of the
    run the error is held.

    References
    ----------
    [barton2010], Eq. (3.13) to (3.15), as the limit S = R = 0.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import ModelInverseIlc, from_transfer_function
    >>> model = from_transfer_function([2.0], [1.0, 0.0], dt_s=1.0)
    >>> law = ModelInverseIlc(model, 3, gain=1.0)
    >>> law.update(np.zeros(3), np.array([1.0, 2.0, 4.0]))
    array([1., 2., 2.])
    """

    def __new__(
        cls, model: Model, n_samples: int, gain: float = 0.5, q_filter: QFilter = None
    ) -> Self:
        return super().__new__(cls, "model_inverse", given(locals()))

    @property
    def gain(self) -> float:
        """Gain of the step."""
        return float(self.parameters["gain"])

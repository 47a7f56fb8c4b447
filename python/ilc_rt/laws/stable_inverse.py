"""Inverse-model ILC for non-minimum phase: `StableInverseIlc`, by stable inversion or ZPETC."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from ilc_rt._native import LearningError, StateSpace, zero_phase
from ilc_rt._native import from_transfer_function as transfer_function
from ilc_rt.given import given
from ilc_rt.laws.python_law import PythonLaw, number, signals, whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import QFilter

    Array = NDArray[np.float64]

# Distance of a zero from the unit circle within which it has no useful inverse.
ON_CIRCLE = 1e-6
TAIL_MAX = 20_000


class StableInverseIlc(PythonLaw):
    """Inverse-model ILC that also inverts zeros outside the unit circle, by looking ahead.

    ``u' = Q (u + gain L e)``, with ``P = K Bs(z) Bu(z) / A(z)``, Bu having the zeros outside;
    stable inversion: ``L = A / (K Bs Bu)``, 1/Bu run backward in time;
    ZPETC: ``L = A Bu(1/z) / (K Bs Bu(1)^2)``

    Parameters
    ----------
    model : StateSpace
        Discrete model with one input and one output, including its dead time.
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
        If a zero is on the unit circle, the model responds to no input or has several channels, or
        a number is out of range.
    ModelError, TypeError
        If the model is not a `StateSpace`, or its zeros cannot be computed.

    Notes
    -----
    The error is held beyond the end of the run, and is zero before it: preactuation that would
    begin before the run is cut off, so let the reference rest at first for the settling time of the
    zeros outside. `ModelInverseIlc` is the law for models without such zeros.

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

    def __init__(
        self,
        model: StateSpace,
        n_samples: int,
        gain: float = 0.5,
        method: Literal["stable_inversion", "zpetc"] = "stable_inversion",
        zero_radius: float = 1.0,
        q_filter: QFilter = None,
    ) -> None:
        super().__init__(**given(locals()))
        if not isinstance(model, StateSpace):
            message = f"model is a {type(model).__name__}; a StateSpace is needed"
            raise TypeError(message)
        if model.dt_s is None or (model.n_inputs, model.n_outputs) != (1, 1):
            message = "model: a discrete-time model with one input and one output is needed"
            raise LearningError(message)
        if method not in {"stable_inversion", "zpetc"}:
            message = f"method = {method!r}: allowed 'stable_inversion' or 'zpetc'"
            raise LearningError(message)
        self._n = whole("n_samples", n_samples, 1, 10_000_000)
        self._gain = number("gain", gain, np.nextafter(0.0, 1.0), np.nextafter(2.0, 0.0))
        radius = number("zero_radius", zero_radius, 0.1, 1.0)
        if radius < 1.0 and method != "zpetc":
            message = f"zero_radius = {zero_radius}: below 1 for method 'zpetc' alone"
            raise LearningError(message)
        self._is_zpetc, self._q_filter, self._dt_s = method == "zpetc", q_filter, model.dt_s
        if q_filter is not None:
            # An unusable filter is refused here, not in the first update.
            zero_phase(q_filter, np.zeros(self._n))
        self._split(model, radius)

    @property
    def zeros_outside(self) -> NDArray[np.complex128]:
        """Zeros that are not cancelled by a causal inverse."""
        return self._outside.copy()

    def update(
        self, u: ArrayLike, e: ArrayLike, disturbance: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """Return the next input.

        Parameters
        ----------
        u, e : array_like, shape (n_samples,) or (n_samples, 1)
            Input and error of a run.
        disturbance : object
            Not used.

        Returns
        -------
        ndarray of float64, shape of `u`
            The next input.

        Raises
        ------
        ValueError, TypeError
            If an array does not suit the law.
        """
        del disturbance
        given_u, given_e = signals(u, e, self._n, 1, 1)
        following = given_u[:, 0] + self._gain * self._inverse(given_e[:, 0])
        if self._q_filter is not None:
            following = zero_phase(self._q_filter, following)
        return following.reshape(np.shape(u))

    def _split(self, model: StateSpace, radius: float) -> None:
        """Factor the model: gain, delay, polynomials of poles and of zeros in- and outside."""
        degree = model.relative_degrees()[0]
        if degree is None:
            message = "model: it responds to no input"
            raise LearningError(message)
        zeros = np.asarray(model.zeros(), dtype=np.complex128)
        on_circle = zeros[np.abs(np.abs(zeros) - 1.0) < ON_CIRCLE]
        if on_circle.size and not (self._is_zpetc and radius < 1.0):
            message = f"model: a zero at {on_circle[0]:.6g} is on the unit circle"
            raise LearningError(message)
        self._outside = zeros[np.abs(zeros) >= radius]
        inside = zeros[np.abs(zeros) < radius]
        self._bu = np.real(np.poly(self._outside)) if self._outside.size else np.ones(1)
        if self._is_zpetc and abs(self._bu.sum()) < ON_CIRCLE:
            message = "model: a zero at 1, where the gain is zero, has no inverse"
            raise LearningError(message)
        bs = np.real(np.poly(inside)) if inside.size else np.ones(1)
        a = np.real(np.poly(np.asarray(model.poles())))
        first = float(model.markov(degree + 1)[degree, 0, 0])
        self._ahead = len(a) - len(bs)
        den = first * np.concatenate((bs, np.zeros(self._ahead)))
        self._causal = transfer_function(num=a, den=den, dt_s=self._dt_s)
        decay = np.log(np.abs(self._outside)) if not self._is_zpetc else np.zeros(0)
        tail = int(np.ceil(36.0 / decay.min())) if decay.size else 0
        self._tail = self._ahead + min(tail, TAIL_MAX)

    def _inverse(self, e: Array) -> Array:
        held = np.concatenate((e, np.full(self._tail, e[-1])))
        order = len(self._bu) - 1
        if self._is_zpetc:
            # Bu(1/z) e is the sum of b_i e[k - (order - i)].
            past = np.concatenate((np.zeros(order), held))
            x = (
                sum(
                    (b * past[i : i + len(held)] for i, b in enumerate(self._bu)),
                    np.zeros(len(held)),
                )
                / float(self._bu.sum()) ** 2
            )
        elif order:
            backward = transfer_function(
                num=np.concatenate(([1.0], np.zeros(order))), den=self._bu[::-1], dt_s=self._dt_s
            )
            x = backward.simulate(held[::-1].copy())[::-1]
        else:
            x = held
        ahead = np.concatenate((x[self._ahead :], np.full(self._ahead, x[-1])))
        # What lies before the run drives the causal part from its start.
        lead_in = np.concatenate((x[: self._ahead], ahead))
        return self._causal.simulate(lead_in)[self._ahead : self._ahead + self._n]

"""Models fitted to frequency responses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt import _native

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt._native import StateSpace

__all__ = [
    "RationalFit",
    "SecondOrderFit",
    "VelocityLoopFit",
    "fit_rational",
    "fit_second_order",
    "fit_velocity_loop",
]


def _frequencies(frequency_hz: ArrayLike) -> NDArray[np.float64]:
    """Return a one-dimensional array of finite frequencies."""
    given = np.zeros(np.shape(frequency_hz))
    measured = {"frequency_hz": frequency_hz, "response": given, "n_averages": 1.0}
    checked = _native.check_response(measured)
    return np.asarray(checked["frequency_hz"], np.float64)


class _Fit:
    """A fitted model with delay."""

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the response of the model, including the delay.

        Parameters
        ----------
        frequency_hz : array_like, shape (n_frequencies,)
            Frequencies in Hz.

        Raises
        ------
        ValueError, TypeError
            If `frequency_hz` has the wrong shape or a number that is not finite.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class SecondOrderFit(_Fit):
    """Fitted second-order model with delay.

    ``G(s) = K w0^2 / (s^2 + 2 delta w0 s + w0^2) exp(-s tau)``, behind a zero-order hold if
    discrete. Known parameters have the deviation 0.

    Attributes
    ----------
    gain : float
        Static gain K.
    natural_frequency_hz : float
        Natural frequency w0 / (2 pi) in Hz.
    damping : float
        Damping ratio delta.
    delay_s : float
        Dead time tau in seconds, beyond that of the hold.
    dt_s : float or None
        Sample time in seconds; None for a continuous model.
    gain_deviation : float
        Standard deviation of the gain.
    natural_frequency_deviation_hz : float
        Standard deviation of the natural frequency in Hz.
    damping_deviation : float
        Standard deviation of the damping ratio.
    delay_deviation_s : float
        Standard deviation of the dead time in seconds.
    residual_rms : float
        Weighted RMS of the relative difference of measurement and model.
    delay_samples : int
        Dead time in whole samples; 0 for a continuous model.
    """

    gain: float
    natural_frequency_hz: float
    damping: float
    delay_s: float
    dt_s: float | None
    gain_deviation: float
    natural_frequency_deviation_hz: float
    damping_deviation: float
    delay_deviation_s: float
    residual_rms: float
    delay_samples: int

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the response of the model, including the delay."""
        return _native.second_order_response(frequency_hz, vars(self))

    def state_space(self) -> StateSpace:
        """Return the model in state space.

        Returns
        -------
        StateSpace
            Discrete with `delay_samples` of delay, or continuous without delay.

        Raises
        ------
        ModelError
            If frequency or damping is invalid.
        """
        return _native.second_order_model(vars(self))


@dataclass(frozen=True)
class VelocityLoopFit(_Fit):
    """Fitted velocity loop with delay, in a position loop of known gain.

    ``G / (1 + kv z^-1 G)`` with G the zero-order hold of
    ``K a / (s (s + a)) exp(-s tau)``. With a known delay the gain is 1.

    Attributes
    ----------
    gain : float
        Static gain K of the velocity loop.
    bandwidth_hz : float
        Bandwidth a / (2 pi) in Hz.
    delay_s : float
        Dead time tau in seconds, beyond that of the hold.
    position_gain_per_s : float
        Gain kv of the position loop in 1/s.
    dt_s : float
        Sample time in seconds.
    gain_deviation : float
        Standard deviation of the gain.
    bandwidth_deviation_hz : float
        Standard deviation of the bandwidth in Hz.
    delay_deviation_s : float
        Standard deviation of the dead time in seconds.
    residual_rms : float
        Weighted RMS of the relative difference of measurement and model.
    delay_samples : int
        Dead time in whole samples.
    """

    gain: float
    bandwidth_hz: float
    delay_s: float
    position_gain_per_s: float
    dt_s: float
    gain_deviation: float
    bandwidth_deviation_hz: float
    delay_deviation_s: float
    residual_rms: float
    delay_samples: int

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the response of the position loop, including the delay."""
        return _native.velocity_loop_response(frequency_hz, vars(self))


@dataclass(frozen=True)
class RationalFit(_Fit):
    """Fitted rational transfer function with a known delay.

    Attributes
    ----------
    model : StateSpace
        Model without the delay.
    delay_s : float
        Known dead time in seconds.
    reflected_poles : int
        Number of poles reflected into the stable region.
    residual_rms : float
        Weighted RMS of the relative difference of measurement and model.
    """

    model: StateSpace
    delay_s: float
    reflected_poles: int
    residual_rms: float

    def response(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the response of the model, including the delay."""
        w = 2.0 * np.pi * _frequencies(frequency_hz)
        response: NDArray[np.complex128] = self.model.frequency_response(w)[:, 0, 0]
        late: NDArray[np.complex128] = response * np.exp(-1j * w * self.delay_s)
        return late


def fit_second_order(
    frequency_hz: ArrayLike,
    response: ArrayLike,
    coherence: ArrayLike | None = None,
    n_averages: float = 2.0,
    dt_s: float | None = None,
    gain: float | None = None,
    delay_s: float | None = None,
) -> SecondOrderFit:
    """Fit a second-order model with delay to a frequency response.

    ``min sum_k w_k |ln(H_k / G(f_k))|^2``, ``w = gamma^2 / (1 - gamma^2)``

    Parameters
    ----------
    frequency_hz : array_like, shape (n_frequencies,)
        Frequencies in Hz, positive and ascending.
    response : array_like of complex, shape (n_frequencies,)
        Measured response.
    coherence : array_like or None, shape (n_frequencies,)
        Coherence as weight of the frequencies; None for equal weights.
    n_averages : float
        Averages behind the response; with one, the coherence is always 1.
    dt_s : float or None
        Sample time in seconds of the hold before the axis; None for a
        continuous model.
    gain, delay_s : float or None
        Known parameters; fitted if None.

    Returns
    -------
    SecondOrderFit
        Stable by construction.

    Raises
    ------
    ModelError
        If the response cannot be fitted.

    References
    ----------
    [pintelon2012], section 9.8.3.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.identify import fit_second_order
    >>> f = np.linspace(1.0, 50.0, 99)
    >>> s = 2j * np.pi * f
    >>> w0 = 2 * np.pi * 12.0
    >>> fit = fit_second_order(f, w0**2 / (s**2 + w0 * s + w0**2) * np.exp(-0.004 * s))
    >>> round(fit.natural_frequency_hz, 6), round(fit.damping, 6), round(fit.delay_s, 6)
    (12.0, 0.5, 0.004)
    """
    return SecondOrderFit(**_native.fit_second_order(locals()))


def fit_velocity_loop(
    frequency_hz: ArrayLike,
    response: ArrayLike,
    position_gain_per_s: float,
    dt_s: float,
    coherence: ArrayLike | None = None,
    n_averages: float = 2.0,
    delay_s: float | None = None,
) -> VelocityLoopFit:
    """Fit a velocity loop in a position loop of known gain.

    ``min sum_k w_k |ln(H_k / T(f_k))|^2`` with ``T = G / (1 + kv z^-1 G)``

    Parameters
    ----------
    frequency_hz : array_like, shape (n_frequencies,)
        Frequencies in Hz, positive and ascending.
    response : array_like of complex, shape (n_frequencies,)
        Measured response from velocity input to position.
    position_gain_per_s : float
        Gain kv of the position loop in 1/s.
    dt_s : float
        Servo cycle in seconds.
    coherence : array_like or None, shape (n_frequencies,)
        Coherence as weight of the frequencies; None for equal weights.
    n_averages : float
        Averages behind the response; with one, the coherence is always 1.
    delay_s : float or None
        Known delay in seconds, with which the gain is 1; both are fitted if
        None.

    Raises
    ------
    ModelError
        If the response cannot be fitted.

    References
    ----------
    [pintelon2012], section 9.8.3.
    """
    return VelocityLoopFit(**_native.fit_velocity_loop(locals()))


def fit_rational(
    frequency_hz: ArrayLike,
    response: ArrayLike,
    n_zeros: int,
    n_poles: int,
    coherence: ArrayLike | None = None,
    n_averages: float = 2.0,
    delay_s: float = 0.0,
    dt_s: float | None = None,
) -> RationalFit:
    """Fit a stable rational transfer function of given degrees to a frequency response.

    ``min sum_k w_k |ln(H_k exp(j w_k tau) / G(f_k))|^2``, started with the rounds of Sanathanan and
    Koerner; unstable poles are reflected.

    Parameters
    ----------
    frequency_hz : array_like, shape (n_frequencies,)
        Frequencies in Hz, positive and ascending.
    response : array_like of complex, shape (n_frequencies,)
        Measured response.
    n_zeros, n_poles : int
        Degrees of numerator and denominator.
    coherence : array_like or None, shape (n_frequencies,)
        Coherence as weight of the frequencies; None for equal weights.
    n_averages : float
        Averages behind the response; with one, the coherence is always 1.
    delay_s : float
        Known delay in seconds, removed first.
    dt_s : float or None
        Sample time in seconds for a discrete model; None for a continuous one.

    Raises
    ------
    ModelError
        If the degrees are out of range or the response cannot be fitted.

    References
    ----------
    [sanathanan1963]; [pintelon2012], section 9.8.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.identify import fit_rational
    >>> f = np.linspace(0.1, 5.0, 50)
    >>> fit = fit_rational(f, 3.0 / (2j * np.pi * f + 4.0), n_zeros=0, n_poles=1)
    >>> round(float(fit.model.poles()[0].real), 6)
    -4.0
    """
    return RationalFit(**_native.fit_rational(locals()))

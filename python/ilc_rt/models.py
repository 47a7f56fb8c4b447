"""Models of axes: from transfer functions, from natural frequency and damping; discretisation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from ilc_rt import _native

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from ilc_rt._native import StateSpace
    from ilc_rt.laws.arguments import Model

__all__ = ["discretize", "from_transfer_function", "second_order"]


def from_transfer_function(num: ArrayLike, den: ArrayLike, dt_s: float | None = None) -> StateSpace:
    """Return the state-space model of a transfer function.

    ``G = (num[0] s^n + ...) / (den[0] s^n + ...)``, with z for s if sampled.

    Parameters
    ----------
    num : array_like, shape (n_num,)
        Numerator, highest power first.
    den : array_like, shape (n_den,)
        Denominator, highest power first.
    dt_s : float or None
        Sample time in seconds; None or 0 for a continuous-time model.

    Returns
    -------
    StateSpace
        Controllable canonical form, one input, one output.

    Raises
    ------
    ModelError
        If the degree of the numerator exceeds that of the denominator, or the denominator is zero.

    Examples
    --------
    >>> from ilc_rt import from_transfer_function
    >>> from_transfer_function([1.0], [1.0, -0.5], 0.001).simulate([1.0, 0.0, 0.0])
    array([0. , 1. , 0.5])
    """
    return _native.from_transfer_function(locals())


def second_order(natural_frequency_rad_s: float, damping: float) -> StateSpace:
    """Return the continuous-time model of a position loop.

    ``G(s) = w0^2 / (s^2 + 2 delta w0 s + w0^2)``

    Parameters
    ----------
    natural_frequency_rad_s : float
        Bandwidth w0 in rad/s.
    damping : float
        Damping factor delta.

    Returns
    -------
    StateSpace
        Continuous-time model; `discretize` converts it to discrete time.

    Raises
    ------
    ModelError
        If the frequency is not positive or the damping is negative.

    References
    ----------
    [haas2016], Eq. (13).

    Examples
    --------
    >>> from ilc_rt import discretize, second_order
    >>> discretize(second_order(157.0, 0.5), 0.002)
    StateSpace(n_states=2, n_inputs=1, n_outputs=1, dt_s=0.002)
    """
    return _native.second_order(locals())


def discretize(model: Model, dt_s: float, method: Literal["zoh", "tustin"] = "zoh") -> StateSpace:
    """Return the discrete-time form of a continuous-time model.

    Parameters
    ----------
    model : StateSpace or compatible
        Continuous-time model.
    dt_s : float
        Sample time in seconds.
    method : {"zoh", "tustin"}
        Zero-order hold (exact for a piecewise constant input) or Tustin's bilinear rule.

    Returns
    -------
    StateSpace
        Discrete-time model.

    Raises
    ------
    ModelError
        If the model is already in discrete time or the sample time is not positive.
    ValueError
        If `method` is unknown.
    TypeError
        If `model` is not a model.

    Examples
    --------
    >>> from ilc_rt import discretize, from_transfer_function
    >>> lag = from_transfer_function([1.0], [1.0, 1.0])
    >>> discretize(lag, 0.1).dt_s
    0.1
    """
    return _native.discretize(locals())

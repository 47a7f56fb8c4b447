"""Controllers as in the loop, tick by tick: PID, cascade, cross-coupled.

Each has the methods of its native base class: `step` for one tick, and `reset` to return to rest.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from ilc_rt import _native
from ilc_rt.given import given

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Cascade", "CrossCoupled", "Pid"]


class Pid(_native.Pid):
    """PID controller with derivative filter, output saturation and anti-windup.

    ``u[k] = kp e[k] + ki dt sum(e[:k]) + kd (de/dt)[k]``, saturated at +-output_max

    Parameters
    ----------
    kp : float
        Proportional gain.
    ki_per_s : float
        Integral gain in 1/s.
    kd_s : float
        Derivative gain in s.
    dt_s : float
        Sample time in s.
    derivative : {"difference", "delayed", "filtered"}
        ``(e[k] - e[k-1]) / dt``, the same delayed by a sample, or ``s / (T s + 1)``, discretised
        with a zero-order hold.
    filter_s : float
        Time constant T of the filtered derivative in s.
    output_max : float or None
        Output limit, symmetric.

    Raises
    ------
    ValueError
        If a number is not finite, or a time or limit is not positive.

    References
    ----------
    [barton2010], Eq. (8.3); [dimarco2016], Sect. 4.1.

    Examples
    --------
    >>> from ilc_rt.control import Pid
    >>> pid = Pid(kp=2.0, kd_s=0.5, dt_s=0.1)
    >>> pid.step(1.0), pid.step(1.0)
    (7.0, 2.0)
    """

    def __new__(
        cls,
        kp: float,
        ki_per_s: float = 0.0,
        kd_s: float = 0.0,
        *,
        dt_s: float,
        derivative: Literal["difference", "delayed", "filtered"] = "difference",
        filter_s: float = 0.01,
        output_max: float | None = None,
    ) -> Self:
        return super().__new__(cls, given(locals()))


class Cascade(_native.Cascade):
    """Cascade of P position control and PI velocity control.

    ``v* = kv (r - y) + f r'``, ``F = kp (v* - y') + kp dt / Tn sum(v* - y') + m r''``

    Parameters
    ----------
    position_gain_per_s : float
        kv in 1/s.
    velocity_gain_n_s_m : float
        kp in N s/m.
    integral_time_s : float or None
        Integral time Tn in s; None switches the integral off.
    dt_s : float
        Sample time in s.
    velocity_feedforward : float
        Velocity feed-forward f: share of the reference velocity.
    acceleration_feedforward_kg : float
        Acceleration feed-forward m: the moving mass.
    velocity_max_m_s, force_max_n : float or None
        Limits.

    Raises
    ------
    ValueError
        If a number is not finite, or a time or limit is not positive.

    References
    ----------
    [haas2016], Sect. 3.

    Examples
    --------
    >>> from ilc_rt.control import Cascade
    >>> Cascade(50.0, 100.0, dt_s=0.001).step(0.001, 0.0, 0.0)
    5.0
    """

    def __new__(
        cls,
        position_gain_per_s: float,
        velocity_gain_n_s_m: float,
        integral_time_s: float | None = None,
        *,
        dt_s: float,
        velocity_feedforward: float = 0.0,
        acceleration_feedforward_kg: float = 0.0,
        velocity_max_m_s: float | None = None,
        force_max_n: float | None = None,
    ) -> Self:
        return super().__new__(cls, given(locals()))


class CrossCoupled(_native.CrossCoupled):
    """Cross-coupled control of two axes.

    ``epsilon = c1 e1 + c2 e2``, ``w = PID(epsilon)``, ``u_i += c_i w``

    Parameters
    ----------
    controller : Pid
        Controller of the contour error; it is copied, at rest.

    References
    ----------
    [koren1991]; [barton2010], Eq. (4.1).

    Examples
    --------
    >>> from ilc_rt.control import CrossCoupled, Pid
    >>> CrossCoupled(Pid(10.0, dt_s=0.001)).step([0.0, 0.5], [0.0, 1.0])
    (array([0., 5.]), 0.5)
    """

    def __new__(
        cls,
        controller: Pid,
    ) -> Self:
        return super().__new__(cls, given(locals()))

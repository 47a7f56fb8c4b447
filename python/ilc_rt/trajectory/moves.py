"""Straight moves: jerk-limited (S-curve), exponential/sigmoid, and modulated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ilc_rt import _native
from ilc_rt.trajectory.sampled import Trajectory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

PLACES = ("start-up", "transition", "end")


def jerk_limited(
    points_m: ArrayLike,
    *,
    feed_m_s: float | ArrayLike,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    setting: str = "complete",
) -> Trajectory:
    """Plan straight moves with jerk-limited (S-curve) axes.

    Seven phases of constant jerk per move. `setting` selects one of the two ways in which machine
    tools join moves. `MovePlan` is the same motion without samples.

    Parameters
    ----------
    points_m : ndarray of float64, shape (n_points,) or (n_points, n_axes)
        Start, and end of each move, in m.
    feed_m_s : float or ndarray of float64, shape (n_points - 1,)
        Speed along each move, in m/s.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^3.
    setting : str
        ``"complete"``: every move is completed, and an oscillation loses frequency. ``"on_time"``:
        the next move starts on time, and an oscillation loses amplitude.

    Returns
    -------
    Trajectory

    Raises
    ------
    TrajectoryError
        If a value is out of range.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    References
    ----------
    [dimarco2016], Chapter 2.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> move = trajectory.jerk_limited(
    ...     [0.0, 2.0], feed_m_s=1.0, dt_s=0.01,
    ...     velocity_max_m_s=1.0, acceleration_max_m_s2=2.0, jerk_max_m_s3=8.0)
    >>> round(float(move.t_s[-1]), 6)
    2.75
    """
    return Trajectory(**_native.jerk_limited(locals()))


def exponential_sigmoid(
    points_m: ArrayLike,
    *,
    feed_m_s: float | ArrayLike,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    amplitude_m: float | ArrayLike | None = None,
    frequency_hz: float | ArrayLike | None = None,
    alpha_max: float | dict[str, float] | None = None,
) -> Trajectory:
    """Plan an exponential/sigmoid (E/S) move.

    ``x = (m t)(1 - exp(-a t^3)) + A sin(w t)(1 - exp(-a t^2))`` at the start, sigmoids where a line
    continues or reverses, the mirror image of a start at the end. The motion is on its programmed
    path and on time shortly after a start. Each alpha is the largest that satisfies every limit.

    Parameters
    ----------
    points_m : ndarray of float64, shape (n_points,) or (n_points, n_axes)
        Start, and end of each leg, in m.
    feed_m_s : float or ndarray of float64, shape (n_points - 1,)
        Speed on each leg, in m/s; a start overshoots it by 79 %.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^3.
    amplitude_m : float or ndarray of float64, shape (n_points - 1,)
        Amplitude of the oscillation along each leg, in m.
    frequency_hz : float or ndarray of float64, shape (n_points - 1,)
        Frequency of the oscillation, in Hz.
    alpha_max : float or dict of float, optional
        Upper bound of alpha, for all places or per place: ``"start-up"``, ``"transition"``,
        ``"end"``. The largest alpha within the limits is not the one with the smallest
        `tracking_index`.

    Returns
    -------
    Trajectory
        With `alphas`.

    Raises
    ------
    TrajectoryError
        If no alpha satisfies the limits, or a value is out of range.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    Notes
    -----
    A start must end before its leg does: ``a T^3`` of at least 45, so that its acceleration reaches
    about ``11 v / T`` on a leg of T seconds.

    References
    ----------
    [dimarco2016], Section 2.1, 2.3.3.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> move = trajectory.exponential_sigmoid(
    ...     [0.0, 0.2, 0.0], feed_m_s=0.1, dt_s=0.001,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=5.0, jerk_max_m_s3=200.0)
    >>> " ".join(place for _, place, _, _ in move.alphas)
    'start-up transition end'
    """
    given = {**locals(), "alpha_max": _by_place(alpha_max)}
    return Trajectory(**_native.exponential_sigmoid(given))


def _by_place(alpha_max: object) -> tuple[float, ...] | None:
    """Return the upper bounds of alpha at start-up, transition and end; None for no bound."""
    if alpha_max is None:
        return None
    if isinstance(alpha_max, (int, float, np.number)):
        return (float(alpha_max),) * len(PLACES)
    if not isinstance(alpha_max, dict):
        message = f"alpha_max = {alpha_max!r}; a number, or a dict of numbers by place, is needed"
        raise TypeError(message)
    for place in alpha_max:
        if place not in PLACES:
            message = f'alpha_max: "{place}"; "start-up", "transition" or "end" is needed'
            raise ValueError(message)
    return tuple(float(alpha_max.get(place, np.inf)) for place in PLACES)


def modulated(
    points_m: ArrayLike,
    *,
    feed_m_s: float,
    amplitude_m: float,
    frequency_hz: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    interpolation: str = "exponential_sigmoid",
) -> Trajectory:
    """Plan a modulated tool path: a feed with an oscillation superimposed along it.

    ``x = v t + A sin(w t)``, as a ramped sinusoid by the E/S interpolator, or by the jerk-limited
    linear interpolator as the six-point sine that a numerical controller receives.

    Parameters
    ----------
    points_m : ndarray of float64, shape (2,) or (2, n_axes)
        Start and end, in m.
    feed_m_s : float
        Feed speed, in m/s.
    amplitude_m : float
        Amplitude, in m.
    frequency_hz : float
        Frequency, in Hz.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^3.
    interpolation : str
        ``"exponential_sigmoid"``, or ``"complete"`` or ``"on_time"`` for the six-point sine with
        one of the two settings.

    Returns
    -------
    Trajectory

    Raises
    ------
    TrajectoryError
        If no alpha satisfies the limits, or a value is out of range.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    References
    ----------
    [dimarco2016], Chapters 1 and 2.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> path = trajectory.modulated(
    ...     [0.0, 0.1], feed_m_s=0.02, amplitude_m=0.001, frequency_hz=2.0, dt_s=0.001,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=5.0, jerk_max_m_s3=200.0)
    >>> round(float(path.t_s[-1]), 6)
    5.0
    """
    return Trajectory(**_native.modulated(locals()))


def sigmoid_pair(
    *,
    velocity_m_s: ArrayLike,
    amplitude_m: ArrayLike,
    omega_rad_s: ArrayLike,
    phase_zero_s: ArrayLike,
    corner_s: float,
    duration_s: float,
    start_alpha: float,
    transition_alpha: float,
    sine_alpha: float,
    sine_offset_s: float,
    dt_s: float,
) -> Trajectory:
    """Sample two legs on one axis, joined by sigmoids, with every alpha given.

    ``x = (x1 a/(a + exp(s c)) + x2 b/(b + exp(-s c))) (1 - exp(-a0 t^2))``

    with c the time from the corner, ``a = |v2/v1|``, ``b = 1/a``, and oscillations on x1 and x2
    that fade before and after the corner.

    Parameters
    ----------
    velocity_m_s : array_like of float64, shape (2,)
        Velocity of each leg, signed, in m/s.
    amplitude_m : array_like of float64, shape (2,)
        Amplitude of each oscillation, in m.
    omega_rad_s : array_like of float64, shape (2,)
        Angular frequency of each oscillation, in rad/s.
    phase_zero_s : array_like of float64, shape (2,)
        Time at which the phase of each oscillation is 0, in s.
    corner_s : float
        Time of the corner between the legs, in s.
    duration_s : float
        Length of the motion, in s; it does not end at rest.
    start_alpha : float
        Alpha of the start, a0 in 1/s^2.
    transition_alpha : float
        Alpha of the sigmoids between the legs, s in 1/s.
    sine_alpha : float
        Alpha of the sigmoids that fade the oscillations, in 1/s.
    sine_offset_s : float
        Distance of their midpoints from the corner, in s.
    dt_s : float
        Sample time in s.

    Returns
    -------
    Trajectory
        `programmed_m` excludes start and transition.

    Raises
    ------
    TrajectoryError
        If a velocity is 0, an alpha or a time is not positive, or a number is not finite.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    Notes
    -----
    No limit is enforced: this is the program of the thesis, for comparison and to reproduce its
    reference. To plan for a machine use `exponential_sigmoid`.

    References
    ----------
    [dimarco2016], Appendix A.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> path = trajectory.sigmoid_pair(
    ...     velocity_m_s=[10.0, -5.0], amplitude_m=[2.0, 1.0], omega_rad_s=[10.0, 20.0],
    ...     phase_zero_s=[0.0, 6.01], corner_s=6.0, duration_s=14.0, start_alpha=5.0,
    ...     transition_alpha=2.0, sine_alpha=3.0, sine_offset_s=1.0, dt_s=0.01)
    >>> path.n_samples
    1401
    """
    return Trajectory(**_native.sigmoid_pair(locals()))

"""Plans of straight moves, evaluated at any time: `MovePlan`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt import _native

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from typing_extensions import Self


_new = _native.MovePlan.__new__


class MovePlan(_native.MovePlan):
    """Straight moves with jerk-limited (S-curve) axes, planned without samples.

    The motion of `jerk_limited`, from a start that may be in motion, evaluated at any time.

    Parameters
    ----------
    points_m : ndarray of float64, shape (n_points,) or (n_points, n_axes)
        Start, and end of each move, in m.
    feed_m_s : float or ndarray of float64, shape (n_points - 1,)
        Speed along each move, in m/s.
    velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^3.
    setting : str
        ``"complete"``: every move is completed. ``"on_time"``: the next move starts on time,
        whatever is left of the one before it.
    start_velocity_m_s : float or ndarray of float64, shape (n_axes,)
        Velocity of each axis at the start, without acceleration, in m/s.

    Raises
    ------
    TrajectoryError
        If a value is out of range.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    Notes
    -----
    A move from rest is a straight line with seven phases of constant jerk. A move that begins in
    motion takes each axis to the target on its own, and all arrive together if possible: each goes
    to a cruising velocity and from it to rest.

    References
    ----------
    [dimarco2016], Chapter 2, for the two settings.

    Examples
    --------
    >>> from ilc_rt.trajectory import MovePlan
    >>> plan = MovePlan(
    ...     [0.0, 2.0], feed_m_s=1.0,
    ...     velocity_max_m_s=1.0, acceleration_max_m_s2=2.0, jerk_max_m_s3=8.0)
    >>> plan.duration_s
    2.75
    >>> position_m, velocity_m_s, acceleration_m_s2 = plan.at([0.0, 0.25, 2.75])
    >>> acceleration_m_s2[:, 0]
    array([0., 2., 0.])
    """

    __slots__ = ()

    def __new__(
        cls,
        points_m: ArrayLike,
        *,
        feed_m_s: float | ArrayLike,
        velocity_max_m_s: float | ArrayLike,
        acceleration_max_m_s2: float | ArrayLike,
        jerk_max_m_s3: float | ArrayLike,
        setting: str = "complete",
        start_velocity_m_s: float | ArrayLike = 0.0,
    ) -> Self:
        return _new(
            cls, points_m, feed_m_s, velocity_max_m_s, acceleration_max_m_s2, jerk_max_m_s3,
            setting, start_velocity_m_s,
        )  # fmt: skip

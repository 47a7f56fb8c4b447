"""Smooth curves: splines and plane shapes, traversed as fast as every axis allows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ilc_rt import _native
from ilc_rt.trajectory.sampled import Trajectory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def spline(
    points_m: ArrayLike,
    *,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    curvature_acceleration_max_m_s2: float = math.inf,
) -> Trajectory:
    """Plan the smooth curve through points.

    A natural cubic spline, traversed at a curvature-limited speed.

    Parameters
    ----------
    points_m : ndarray of float64, shape (n_points, n_axes)
        Points in order, in m.
    feed_m_s : float
        Highest speed along the path, in m/s.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^3.
    curvature_acceleration_max_m_s2 : float
        Highest centripetal acceleration, in m/s^2; by default limited only by the axes.

    Returns
    -------
    Trajectory

    Raises
    ------
    TrajectoryError
        If a value is out of range, or two neighbouring points are equal.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> path = trajectory.spline(
    ...     [[0.0, 0.0], [0.03, 0.02], [0.06, 0.0]], feed_m_s=0.05, dt_s=0.002,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=100.0)
    >>> path.n_axes
    2
    """
    return Trajectory(**_native.spline(locals()))


def butterfly(
    *,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    feed_m_s: float = 0.004,
    curvature_acceleration_max_m_s2: float = math.inf,
    scale_m: float = 0.00185,
    turns: float = 1.0,
    center_m: tuple[float, float] = (0.0, 0.0),
) -> Trajectory:
    """Plan the butterfly contour.

    ``r = exp(cos t) - 2 cos 4t - sin(t/12)^5``, x = scale r sin t,
    y = scale r cos t, with curvature-limited speed.

    Parameters
    ----------
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s^3.
    feed_m_s : float
        Highest speed along the path, in m/s.
    curvature_acceleration_max_m_s2 : float
        Highest centripetal acceleration, in m/s^2; by default limited only by the axes.
    scale_m : float
        Scale, in m.
    turns : float
        Revolutions of t; 12 close the contour.
    center_m : (float, float)
        Centre, in m.

    Returns
    -------
    Trajectory

    Raises
    ------
    TrajectoryError
        If a value is out of range.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> path = trajectory.butterfly(
    ...     dt_s=0.002, velocity_max_m_s=0.1, acceleration_max_m_s2=0.5, jerk_max_m_s3=20.0)
    >>> path.n_axes
    2
    """
    return Trajectory(**_native.butterfly(locals()))


def spiral(
    *,
    pitch_m: float,
    turns: float,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    curvature_acceleration_max_m_s2: float = math.inf,
    center_m: tuple[float, float] = (0.0, 0.0),
) -> Trajectory:
    """Plan a spiral outwards from its centre, anticlockwise.

    ``r = pitch theta / (2 pi)``, with curvature-limited speed.

    Parameters
    ----------
    pitch_m : float
        Pitch: distance between turns, in m.
    turns : float
        Number of turns.
    feed_m_s : float
        Highest speed along the path, in m/s.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s^3.
    curvature_acceleration_max_m_s2 : float
        Highest centripetal acceleration, in m/s^2; by default limited only by the axes.
    center_m : (float, float)
        Centre, in m.

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
    [barton2010], Section 8.1.2.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> path = trajectory.spiral(
    ...     pitch_m=0.004, turns=3.0, feed_m_s=0.02, dt_s=0.002,
    ...     velocity_max_m_s=0.1, acceleration_max_m_s2=0.5, jerk_max_m_s3=20.0)
    >>> bool(abs((path.position_m[-1] ** 2).sum() ** 0.5 - 0.012) < 1e-12)
    True
    """
    return Trajectory(**_native.spiral(locals()))

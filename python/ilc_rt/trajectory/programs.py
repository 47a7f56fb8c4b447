"""Programs of lines and arcs: rasters and G-code part programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt import _native
from ilc_rt.trajectory.sampled import Trajectory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def raster(
    *,
    width_m: float,
    pitch_m: float,
    rows: int,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    start_m: tuple[float, float] = (0.0, 0.0),
    there_and_back: bool = False,
    setting: str = "complete",
) -> Trajectory:
    """Plan a raster: rows in alternating directions, optionally retraced.

    Parameters
    ----------
    width_m : float
        Length of a row along the first axis, in m.
    pitch_m : float
        Row spacing along the second axis, in m.
    rows : int
        Number of rows.
    feed_m_s : float
        Speed, in m/s.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (2,)
        Limit of each axis, in m/s^3.
    start_m : (float, float)
        First corner, in m.
    there_and_back : bool
        True to return to the start along the same path.
    setting : str
        ``"complete"`` or ``"on_time"``, as in `jerk_limited`.

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
    >>> path = trajectory.raster(
    ...     width_m=0.02, pitch_m=0.005, rows=3, feed_m_s=0.05, dt_s=0.002,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=100.0)
    >>> path.position_m[-1].tolist()
    [0.02, 0.01]
    """
    return Trajectory(**_native.raster(locals()))


def gcode(
    text: str | bytes,
    *,
    start_m: ArrayLike,
    feed_m_s: float,
    dt_s: float,
    velocity_max_m_s: float | ArrayLike,
    acceleration_max_m_s2: float | ArrayLike,
    jerk_max_m_s3: float | ArrayLike,
    rapid_m_s: float | None = None,
    blend_s: float | None = None,
    block_delete: bool = False,
) -> Trajectory:
    r"""Plan a G-code part program.

    G0 to G4, G17, G20, G21, G80, G90, G91, M2, M30; arcs by I and J, or R; comments; words that
    request the default. Words have the meaning of LinuxCNC or are rejected.

    Parameters
    ----------
    text : str or bytes
        The program; bytes may have any encoding that extends ASCII.
    start_m : ndarray of float64, shape (n_axes,)
        Start position, in m.
    feed_m_s : float
        Speed until the first F, and of G0 if `rapid_m_s` is not given, in m/s.
    dt_s : float
        Sample time in s.
    velocity_max_m_s : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s.
    acceleration_max_m_s2 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^2.
    jerk_max_m_s3 : float or ndarray of float64, shape (n_axes,)
        Limit of each axis, in m/s^3.
    rapid_m_s : float, optional
        Speed of G0, in m/s.
    blend_s : float, optional
        Window that rounds the corners, in s; without it every move ends at rest.
    block_delete : bool
        True to skip blocks that begin with / (block delete).

    Returns
    -------
    Trajectory
        Its acceleration is the central difference of its velocity.

    Raises
    ------
    TrajectoryError
        If a word is not understood (with its line), or a limit would be exceeded.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> path = trajectory.gcode(
    ...     "G1 X10 F3000\nG3 X0 Y10 I-10 J0", start_m=[0.0, 0.0], feed_m_s=0.05, dt_s=0.002,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=100.0)
    >>> path.position_m[-1].tolist()
    [0.0, 0.01]
    """
    return Trajectory(**_native.gcode(locals()))

"""Sampled motions: `Trajectory` and its tracking index."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt import _native
from ilc_rt._native import TrajectoryError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, repr=False, eq=False)
class Trajectory:
    """A planned motion, sampled.

    It starts and ends at rest, except for `sigmoid_pair`.

    Attributes
    ----------
    dt_s : float
        Sample time in s.
    position_m, velocity_m_s, acceleration_m_s2 : ndarray of float64, shape (n_samples, n_axes)
        Motion in m, m/s and m/s^2.
    programmed_m : ndarray of float64, shape (n_samples, n_axes)
        Positions in m at the same times without acceleration limits.
    alphas : list of tuple
        For an exponential/sigmoid motion: segment, place, the chosen alpha, and the intervals of
        alpha within the limits.
    computing_s : float
        Planning time, in s.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> move = trajectory.jerk_limited(
    ...     [[0.0], [0.1]], feed_m_s=0.2, dt_s=0.001,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0)
    >>> float(move.position_m[-1, 0])
    0.1
    """

    dt_s: float
    position_m: NDArray[np.float64]
    velocity_m_s: NDArray[np.float64]
    acceleration_m_s2: NDArray[np.float64]
    programmed_m: NDArray[np.float64]
    alphas: list[tuple[int, str, float, list[tuple[float, float]]]]
    computing_s: float

    def __post_init__(self) -> None:
        """Check what a caller gave, as the planners do."""
        for name, allowed in (("dt_s", "above 0"), ("computing_s", "of at least 0")):
            value = getattr(self, name)
            is_right = isinstance(value, float) and 0.0 <= value < np.inf
            if not is_right or (name == "dt_s" and value == 0.0):
                message = f"{name} = {value!r}; a finite number {allowed} is needed"
                raise TrajectoryError(message)
        if not isinstance(self.alphas, list):
            message = f"alphas = {self.alphas!r}; a list is needed"
            raise TrajectoryError(message)
        shape = np.shape(self.position_m)
        for name in ("position_m", "velocity_m_s", "acceleration_m_s2", "programmed_m"):
            values = getattr(self, name)
            is_real = isinstance(values, np.ndarray) and values.dtype == np.float64
            if not is_real or values.ndim != 2 or values.shape != shape:
                message = f"{name}: an array of float64, shape (n_samples, n_axes), is needed"
                raise TrajectoryError(message)
            if not np.isfinite(values).all():
                message = f"{name} has a value that is not finite"
                raise TrajectoryError(message)

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.position_m)

    @property
    def n_axes(self) -> int:
        """Number of axes."""
        return int(self.position_m.shape[1])

    @property
    def t_s(self) -> NDArray[np.float64]:
        """Times of the samples in s, shape (n_samples,)."""
        return np.arange(self.n_samples, dtype=np.float64) * self.dt_s

    def __repr__(self) -> str:
        """Return the size and the sample time."""
        return f"Trajectory(n_samples={self.n_samples}, n_axes={self.n_axes}, dt_s={self.dt_s})"


def tracking_index(
    trajectory: Trajectory, k_e: float = 600.0, k_a: float = 1.0
) -> tuple[float, float]:
    """Return the two parts of the index J of an interpolated motion.

    ``J = integral of k_e (y_des - y)^2 + k_a y''^2``, by the trapezoidal rule.

    Parameters
    ----------
    trajectory : Trajectory
        The motion, compared with its `programmed_m`.
    k_e : float
        Weight of the tracking error.
    k_a : float
        Weight of the acceleration.

    Returns
    -------
    (float, float)
        The tracking part and the acceleration part; their sum is J.

    Raises
    ------
    TrajectoryError
        If a weight is negative or not finite.
    TypeError
        If `trajectory` is not a `Trajectory`.

    References
    ----------
    [dimarco2016], Eq. 2.19.

    Examples
    --------
    >>> from ilc_rt import trajectory
    >>> move = trajectory.jerk_limited(
    ...     [0.0, 0.1], feed_m_s=0.1, dt_s=0.001,
    ...     velocity_max_m_s=0.5, acceleration_max_m_s2=2.0, jerk_max_m_s3=50.0)
    >>> tracking, acceleration = trajectory.tracking_index(move)
    >>> tracking > 0.0 and acceleration > 0.0
    True
    """
    if not isinstance(trajectory, Trajectory):
        message = f"trajectory is a {type(trajectory).__name__}; a Trajectory is needed"
        raise TypeError(message)
    return _native.tracking_index({**vars(trajectory), "k_e": k_e, "k_a": k_a})

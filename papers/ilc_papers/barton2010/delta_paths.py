"""The mechanism's home, and the raster and the spiral that its tool follows (section 8.1.2).

The print gives the period of the raster (2 s) but no size. The sizes here are chosen so that both
take about 2 s and stay where the mechanism moves uniformly in every direction.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt import trajectory

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt.kinematics import Delta

#: Sample time, table 8.1.
DT_S = 0.005
#: Angle of all three cranks at home: where a finite difference gives the printed Jacobian (8.2).
HOME_RAD = -0.1901
#: Names of the two references, in the order of the thesis.
PATHS = ("raster", "spiral")

_LIMITS: dict[str, Any] = {
    "dt_s": DT_S,
    "velocity_max_m_s": 0.3,
    "acceleration_max_m_s2": 2.0,
    "jerk_max_m_s3": 60.0,
}


def home_m(delta: Delta) -> NDArray[np.float64]:
    """Return the position of the tool at home, shape (3,)."""
    return delta.forward(np.full(3, HOME_RAD))


def plane_path_m(name: str) -> NDArray[np.float64]:
    """Return a reference in the plane, around (0, 0).

    `raster`: three rows forth and the same way back; `spiral`: from its centre, anticlockwise. In
    m, one position every `DT_S`, from rest to rest, shape (n_samples, 2).
    """
    if name == "raster":
        path = trajectory.raster(
            width_m=0.016, pitch_m=0.006, rows=3, feed_m_s=0.1, there_and_back=True,
            start_m=(-0.008, -0.006), **_LIMITS,
        )  # fmt: skip
    else:
        path = trajectory.spiral(pitch_m=0.005, turns=2.0, feed_m_s=0.062, **_LIMITS)
    return path.position_m


def tool_path_m(delta: Delta, name: str) -> NDArray[np.float64]:
    """Return a reference of the tool in the plane through home, shape (n_samples, 3)."""
    plane_m = plane_path_m(name)
    height_m = np.zeros((len(plane_m), 1))
    return np.hstack([plane_m, height_m]) + home_m(delta)


__all__ = ["DT_S", "HOME_RAD", "PATHS", "home_m", "plane_path_m", "tool_path_m"]

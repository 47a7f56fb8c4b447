"""Mechanisms between the drives and the tool: gantry and delta."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt import _native
from ilc_rt._native import KinematicsError
from ilc_rt.given import given

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Delta", "Gantry", "KinematicsError"]


class Delta(_native.Delta):
    """Delta mechanism: a parallel robot with three legs.

    Cranks at 0, 120 and 240 degrees around a base, each with a rod to the tool, which is above the
    knees: ``|p - k_i| = rod``, ``k_i = Rz(phi_i) (base + crank cos theta_i, 0, crank sin theta_i)``

    Parameters
    ----------
    base_m : float
        Radius of the crank pivots minus the radius of the rod joints on the tool, in m.
    crank_m : float
        Length of a crank in m.
    rod_m : float
        Length of a rod in m.

    Raises
    ------
    KinematicsError
        If the lengths are impossible. The methods raise it for a pose that is out of reach or
        singular, and name pose, leg and sample.

    References
    ----------
    [barton2010], Ch. 7, with the lengths of App. C as defaults.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.kinematics import Delta
    >>> delta = Delta()
    >>> theta_rad = delta.inverse([0.01, 0.0, 0.18])
    >>> bool(np.allclose(delta.forward(theta_rad), [0.01, 0.0, 0.18]))
    True
    """

    def __new__(
        cls,
        base_m: float = 0.037,
        crank_m: float = 0.060,
        rod_m: float = 0.145,
    ) -> Self:
        return super().__new__(cls, given(locals()))


class Gantry(_native.Gantry):
    """Gantry with an orthogonality error between its axes.

    ``x_tool = x + orthogonality_rad y``, ``y_tool = y``

    Parameters
    ----------
    orthogonality_rad : float
        Orthogonality error in rad.

    Raises
    ------
    KinematicsError
        If the angle is not finite.

    References
    ----------
    [haas2016], Sect. 4.

    Examples
    --------
    >>> from ilc_rt.kinematics import Gantry
    >>> Gantry(0.002).forward([0.0, 1.0])
    array([0.002, 1.   ])
    """

    def __new__(
        cls,
        orthogonality_rad: float = 0.0,
    ) -> Self:
        return super().__new__(cls, given(locals()))

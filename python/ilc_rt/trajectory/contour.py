"""Geometry of contours: exact segments, contour errors, coupling gains."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ilc_rt import _native
from ilc_rt._native import ContourError
from ilc_rt.given import given

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray
    from typing_extensions import Self

__all__ = ["Arc", "ContourError", "Line", "contour_error", "coupling_gains", "projection_across"]


class Line(_native.Line):
    """Straight segment of a contour.

    Parameters
    ----------
    from_m, to_m : sequence of 2 or 3 floats
        End points in m.

    Raises
    ------
    ValueError, TypeError
        If a point has the wrong shape, dtype or a number that is not finite.

    Examples
    --------
    >>> from ilc_rt.trajectory import Line, contour_error
    >>> contour_error([Line([0.0, 0.0], [1.0, 0.0])], [[0.5, 0.25]])
    array([0.25])
    """

    def __new__(
        cls,
        from_m: ArrayLike,
        to_m: ArrayLike,
    ) -> Self:
        return super().__new__(cls, given(locals()))


class Arc(_native.Arc):
    """Circular segment of a contour, in any plane.

    Parameters
    ----------
    from_m : sequence of 2 or 3 floats
        Start point in m.
    centre_m : sequence of 2 or 3 floats
        Centre in m.
    sweep_rad : float
        Angle of rotation about the axis in rad; up to a full turn in either direction.
    axis : sequence of 3 floats
        Axis of rotation, perpendicular to the radius.

    Raises
    ------
    ContourError
        If the numbers do not describe an arc.
    ValueError, TypeError
        If a point has the wrong shape, dtype or a number that is not finite.

    Examples
    --------
    >>> from ilc_rt.trajectory import Arc, contour_error
    >>> contour_error([Arc([1.0, 0.0], [0.0, 0.0], 3.14)], [[0.0, 1.5]])
    array([0.5])
    """

    def __new__(
        cls,
        from_m: ArrayLike,
        centre_m: ArrayLike,
        sweep_rad: float,
        axis: ArrayLike | None = None,
    ) -> Self:
        return super().__new__(cls, given(locals()))


def contour_error(
    reference_m: ArrayLike | Sequence[Line | Arc], actual_m: ArrayLike, window: int | None = None
) -> NDArray[np.float64]:
    """Return the distances of measured points from a path.

    Parameters
    ----------
    reference_m : ndarray of float64, shape (n_reference, n_axes), or list of Line and Arc
        The path in m: as samples, joined by straight segments, or as exact segments.
    actual_m : ndarray of float64, shape (n_samples, n_axes)
        Measured points in m.
    window : int or None
        For a sampled path of 1 to 12 axes: search window in samples before and after the same time.
        None, for 2 and 3 axes: the whole path, with a spatial index.

    Returns
    -------
    ndarray of float64, shape (n_samples,)
        Distances in m, exact for the given path.

    Raises
    ------
    ContourError
        If the path is empty.
    ValueError, TypeError
        If an array has the wrong shape, dtype or a number that is not finite.

    References
    ----------
    [barton2010], Sect. 4.1.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.trajectory import contour_error
    >>> contour_error(np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.5, 0.25]]))
    array([0.25])
    """
    return _native.contour_error(locals())


def coupling_gains(reference_m: ArrayLike) -> NDArray[np.float64]:
    """Return the linearised coupling gains of two axes.

    ``epsilon = c1 e1 + c2 e2``, ``c1 = -sin(theta)``, ``c2 = cos(theta)``

    Parameters
    ----------
    reference_m : ndarray of float64, shape (n_samples, 2)
        Reference in m.

    Returns
    -------
    ndarray of float64, shape (n_samples, 2)
        One pair per sample; where the reference is at rest, that of the nearest sample in motion.

    Raises
    ------
    ValueError, TypeError
        If the array has the wrong shape, dtype or a number that is not finite.

    References
    ----------
    [barton2010], Eq. (4.1) to (4.3).

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.trajectory import coupling_gains
    >>> coupling_gains(np.array([[0.0, 0.0], [0.0, 2.0]]))
    array([[-1.,  0.],
           [-1.,  0.]])
    """
    return _native.coupling_gains(reference_m=reference_m)


def projection_across(reference_m: ArrayLike) -> NDArray[np.float64]:
    """Return the projection that removes the component of an error along the path.

    ``epsilon = (I - t t') e`` with t the unit tangent of the reference.

    Parameters
    ----------
    reference_m : ndarray of float64, shape (n_samples, 2) or (n_samples, 3)
        Reference in m.

    Returns
    -------
    ndarray of float64, shape (n_samples, n_axes, n_axes)
        One symmetric matrix per sample.

    Raises
    ------
    ValueError, TypeError
        If the array has the wrong shape, dtype or a number that is not finite.

    References
    ----------
    [barton2010], Eq. (4.2), for two and three axes.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt.trajectory import projection_across
    >>> projection_across(np.array([[0.0, 0.0], [0.0, 2.0]]))[0]
    array([[1., 0.],
           [0., 0.]])
    """
    return _native.projection_across(reference_m=reference_m)

"""Deviation of a run from the programmed path, as a vector at every sample."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WINDOW_SAMPLES = 60


def path_deviation(
    reference_m: Array, measured_m: Array, window_samples: int = WINDOW_SAMPLES
) -> Array:
    """Return the shortest vector from the path to each measured position.

    Lag along the path is not a deviation: only the normal component counts. The nearest point is
    searched among the reference's segments near the same time, so that a path may cross itself.

    All arrays have the shape (n_samples, n_axes), in m; the nearest point is searched
    `window_samples` before and after.

    Examples
    --------
    >>> path = np.column_stack((np.linspace(0.0, 1.0, 5), np.zeros(5)))
    >>> path_deviation(path, path + [0.1, 0.2])[1]
    array([0. , 0.2])
    """
    if reference_m.shape != measured_m.shape or reference_m.ndim != 2:
        message = f"shapes differ: {reference_m.shape} and {measured_m.shape}"
        raise ValueError(message)
    n_samples = len(reference_m)
    if n_samples < 2:
        return measured_m - reference_m
    along = np.diff(reference_m, axis=0)
    squared = np.einsum("ij,ij->i", along, along)
    best = measured_m - reference_m
    best_squared = np.einsum("ij,ij->i", best, best)
    samples = np.arange(n_samples)
    for offset in range(-window_samples, window_samples):
        segment = np.clip(samples + offset, 0, n_samples - 2)
        start, step = reference_m[segment], along[segment]
        toward = np.einsum("ij,ij->i", measured_m - start, step)
        length = squared[segment]
        share = np.divide(toward, length, out=np.zeros(n_samples), where=length > 0)
        vector = measured_m - start - np.clip(share, 0.0, 1.0)[:, None] * step
        distance = np.einsum("ij,ij->i", vector, vector)
        nearer = distance < best_squared
        best[nearer] = vector[nearer]
        best_squared[nearer] = distance[nearer]
    return best


def magnification(largest_m: float, extent_m: float, share: float = 0.12) -> int:
    """Return the round factor that magnifies the largest deviation visibly.

    The largest deviation takes at most `share` of the picture.

    Examples
    --------
    >>> magnification(100e-6, 0.08)
    50
    """
    if largest_m <= 0.0:
        return 1
    wanted = max(1.0, share * extent_m / largest_m)
    decade = int(10 ** np.floor(np.log10(wanted)))
    return max(step * decade for step in (1, 2, 5) if step * decade <= wanted)

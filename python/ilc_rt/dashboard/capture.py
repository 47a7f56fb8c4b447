"""The signals of one run, sample by sample, as batches bring them; imported by `model`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Samples of a run that are kept: 500 s at 1 kHz. What comes later is not captured.
N_SAMPLES_MAX = 500_000
# Share of the samples from which a run can be drawn; the network may drop batches.
COMPLETE = 0.98


@dataclass(slots=True)
class Capture:
    """Signals of a run.

    Attributes
    ----------
    iteration : int
        Number of the run.
    n_axes : int
        Number of axes.
    reference_m, measured_m, input : ndarray of float64, shape (n_samples, n_axes)
        Set points, measurement that is learned from, learned input; NaN where a batch was lost.
    n_samples : int
        Samples so far: the number of the last one, plus 1.
    """

    iteration: int
    n_axes: int
    n_samples: int = 0
    _arrays: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Make room for a second."""
        self._arrays = np.full((1024, 3, self.n_axes), np.nan)

    def put(self, samples: NDArray[np.intp], values: Array) -> None:
        """Store samples by their numbers; `values` has the shape (n, 3, n_axes)."""
        inside = (samples >= 0) & (samples < N_SAMPLES_MAX)
        if not inside.any():
            return
        samples, values = samples[inside], values[inside]
        self.n_samples = max(self.n_samples, int(samples.max()) + 1)
        if self.n_samples > len(self._arrays):
            longer = np.full((2 * self.n_samples, 3, self.n_axes), np.nan)
            longer[: len(self._arrays)] = self._arrays
            self._arrays = longer
        self._arrays[samples] = values

    @property
    def reference_m(self) -> Array:
        """Set points."""
        return self._arrays[: self.n_samples, 0]

    @property
    def measured_m(self) -> Array:
        """Measurement that is learned from."""
        return self._arrays[: self.n_samples, 1]

    @property
    def input(self) -> Array:
        """Learned input."""
        return self._arrays[: self.n_samples, 2]

    def is_complete(self, n_samples: int | None = None) -> bool:
        """Return whether nearly all samples of the run are there, of `n_samples` if known."""
        if self.n_samples < 2:
            return False
        there = int(np.isfinite(self.reference_m).all(axis=1).sum())
        return there >= COMPLETE * max(self.n_samples, n_samples or 0)

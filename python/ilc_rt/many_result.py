"""Result of learning on many plants: the figures of all runs as arrays.

Imported by `ilc_rt.many`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt.trial_record import digest_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class ManyResult:
    """Figures of the runs of many plants, and the signals that were to be kept.

    Attributes
    ----------
    rms : ndarray of float64, shape (n_plants, trials)
        RMS over time of the Euclidean norm of the error, in its unit; infinite from the run on in
        which a plant diverges.
    inf : ndarray of float64, shape (n_plants, trials)
        Largest absolute error.
    seeds : tuple of int or None
        Seed of each plant's noise, with which `ilc_rt.simulate` repeats its runs; None without
        noise.
    last_error : ndarray of float64 or None, shape (n_plants, n_samples[, n_outputs])
        Error of the last run of each plant.
    last_input : ndarray of float64 or None, shape (n_plants, n_samples[, n_inputs])
        Input of the last run of each plant.
    error, input : ndarray of float64 or None, shape (n_plants, trials, n_samples[, n_channels])
        Errors and inputs of all runs.

    Examples
    --------
    >>> import numpy as np
    >>> result = ManyResult(rms=np.array([[1.0, 0.1], [1.0, np.inf]]), inf=np.ones((2, 2)))
    >>> result
    ManyResult(2 plants, 2 trials: last RMS 0.1 to 0.1, 1 diverged)
    >>> result.diverged
    array([False,  True])
    """

    rms: Array
    inf: Array
    seeds: tuple[int, ...] | None = None
    last_error: Array | None = None
    last_input: Array | None = None
    error: Array | None = None
    input: Array | None = None

    def __len__(self) -> int:
        """Return the number of plants."""
        return len(self.rms)

    @property
    def diverged(self) -> NDArray[np.bool_]:
        """True for each plant whose error or input overflowed, shape (n_plants,)."""
        return np.asarray(~np.isfinite(self.rms[:, -1]))

    @property
    def digest(self) -> str:
        """SHA-256 of all figures: equal exactly if they are the same bit by bit."""
        return digest_of(self.rms, self.inf)

    def __repr__(self) -> str:
        """Return the numbers of plants and runs, and the range of the last errors."""
        n_plants, trials = self.rms.shape
        last = self.rms[~self.diverged, -1]
        shown = f"last RMS {last.min():.4g} to {last.max():.4g}, " if len(last) else ""
        n_diverged = n_plants - len(last)
        return f"ManyResult({n_plants} plants, {trials} trials: {shown}{n_diverged} diverged)"

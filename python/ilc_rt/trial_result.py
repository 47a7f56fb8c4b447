"""Result of a simulation or of an experiment: a campaign's result with its signals at hand.

Imported by what makes such results, and by users for `TrialResult.from_library`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt.result import CampaignResult
from ilc_rt.trial_record import digest_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(slots=True)
class TrialResult(CampaignResult):
    """Result of a simulation or an experiment, of the same type as that of a campaign.

    Attributes
    ----------
    seed : int or None
        Seed of the simulation's random numbers; None for an experiment.

    Notes
    -----
    Everything that takes the result of a campaign takes it: pictures, reports, comparisons. Names
    that end in ``_m`` are in the unit of the reference.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, simulate
    >>> result = simulate(lambda u: 0.5 * u, PdIlc(kp=1.0, lead_samples=0), np.ones(3), trials=3)
    >>> result.error[:, 0, 0]
    array([1.  , 0.5 , 0.25])
    """

    seed: int | None = None

    @property
    def input(self) -> NDArray[np.float64]:
        """Inputs of all runs, shape (n_runs, n_samples, n_inputs)."""
        return np.array([record.input for record in self.records])

    @property
    def error(self) -> NDArray[np.float64]:
        """Errors of all runs, shape (n_runs, n_samples, n_outputs)."""
        return np.array([record.error_m for record in self.records])

    @property
    def output(self) -> NDArray[np.float64]:
        """Measured outputs of all runs, shape (n_runs, n_samples, n_outputs)."""
        return np.array([record.encoder_m for record in self.records])

    @property
    def reference(self) -> NDArray[np.float64]:
        """Reference, shape (n_samples, n_outputs); there must be at least one run."""
        return self.records[0].reference_m

    @property
    def digest(self) -> str:
        """SHA-256 of all inputs and errors: equal exactly if all runs are the same bit by bit."""
        return digest_of(self.input, self.error)

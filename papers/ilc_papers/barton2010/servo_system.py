"""The servo axis of section 3.4, for the sections that tune and disturb it.

Only the other modules of this package import it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt import StateSpace, from_transfer_function

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: Gain of the proportional controller, eq. (3.26).
CONTROLLER_GAIN = 0.425
#: Samples of a run: the errors e(1) to e(400).
N_SAMPLES = 400
#: Sample time; the print has none, so one sample is one second.
DT_S = 1.0


@dataclass(frozen=True)
class Servo:
    """The axis with its controller.

    Parameters
    ----------
    plant : StateSpace
        From the learned input u(k) to y(k + 1): P = G / (1 + G C), one sample ahead.
    first_error : ndarray of shape (n_samples,)
        Error e(1) to e(N) of the run without learning: what the feedback leaves.
    reference : ndarray of shape (n_samples + 1,)
        Triangle, y_d(0) to y_d(N).
    """

    plant: StateSpace
    first_error: Array
    reference: Array

    @property
    def n_samples(self) -> int:
        """Samples of a run."""
        return len(self.first_error)


def servo(n_samples: int = N_SAMPLES) -> Servo:
    """Return the axis of eq. (3.25) to (3.27).

    The controller alone follows the triangle (figure 3.3), and the learned input is added to its
    output, P = G / (1 + G C). As in the listings the first sample of the impulse response is
    dropped: u(k) is paired with e(k + 1).

    Fewer than 400 samples shorten the triangle.
    """
    axis = from_transfer_function([1.0, -0.5], np.convolve([1.0, -1.0], [1.0, -0.925]), DT_S)
    controller = gain(CONTROLLER_GAIN, DT_S)
    closed = axis.process_sensitivity(controller)
    ahead = StateSpace(closed.a, closed.b, closed.c @ closed.a, closed.c @ closed.b, DT_S)
    k = np.arange(n_samples + 1)
    reference = np.minimum(2.0 * k / n_samples, 2.0 - 2.0 * k / n_samples)
    first_error = axis.sensitivity(controller).simulate(reference)[1:]
    return Servo(ahead, first_error, reference)


def gain(value: float, dt_s: float) -> StateSpace:
    """Return a gain without states as a model."""
    none = np.zeros((0, 0))
    return StateSpace(none, np.zeros((0, 1)), np.zeros((1, 0)), [[value]], dt_s)

"""The micro-robotic deposition stage of appendix A, two like axes with their controllers.

Sections `raster`, `uncertain`, `bursts` and `dissimilar` import it. The print has no unit of
position; as everything is linear it cancels in every ratio. Here it is the metre.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from ilc_papers.barton2010.runs import Law, rms, runs
from ilc_rt import StateSpace, from_transfer_function, trajectory

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ilc_papers.paper import Figures

    Array = NDArray[np.float64]

#: Sample time, section 5.4.4.
DT_S = 0.001
#: Resonance of the axis, `z^2 - beta_2 z + beta_3`.
RESONANCE = (1.0, -1.764, 0.9562)


def axis_model() -> StateSpace:
    """Return the axis without controller, eq. (5.12) with (A.1)."""
    numerator = _product([1.0, 0.9963], [1.0, -1.768, 0.9567], [1.0, -0.2238, 0.7933])
    denominator = _product([1.0, -0.9972], [1.0, -1.0], RESONANCE, [1.0, -0.1784, 0.7898])
    return from_transfer_function(0.0459 * numerator, denominator, DT_S)


def axis_controller() -> StateSpace:
    """Return the controller, eq. (5.13) with (A.2).

    As printed, with six real roots, it is unstable. It is read as
    `1.5 (z^2 - 1.377 z + 0.9147)(z - 0.776) / ((z^2 - 1.001 z + 0.5182)(z - 0.1691))`.
    """
    numerator = _product([1.0, -1.377, 0.9147], [1.0, -0.776])
    return from_transfer_function(
        1.5 * numerator, _product([1.0, -1.001, 0.5182], [1.0, -0.1691]), DT_S
    )


def printed_controller_pole() -> float:
    """Return the largest pole of (5.13) as it is printed: with `(z - beta_1)`, beta_1 = 1.001."""
    printed = from_transfer_function(
        1.5 * _product([1.0, -1.377], [1.0, -0.9147], [1.0, -0.776]),
        _product([1.0, -1.001], [1.0, -0.5182], [1.0, -0.1691]),
        DT_S,
    )
    return float(np.abs(axis_model().process_sensitivity(printed).poles()).max())


def _product(*factors: list[float] | tuple[float, ...]) -> Array:
    return reduce(np.convolve, factors, np.ones(1))


@dataclass(frozen=True)
class Stage:
    """Two axes and the path that they follow.

    Parameters
    ----------
    plant : StateSpace
        From the learned inputs to the positions, `P = G / (1 + G k)` for each axis.
    reference_m : ndarray of shape (n_samples, 2)
    first_error_m : ndarray of shape (n_samples, 2)
        Error left by the controllers, `1 / (1 + G k)` times the reference.
    """

    plant: StateSpace
    reference_m: Array
    first_error_m: Array

    @property
    def coupling(self) -> Array:
        """C_Q of eq. (4.3) and (5.9), shape (n_samples, 1, 2)."""
        return trajectory.coupling_gains(self.reference_m)[:, np.newaxis, :]

    def contour_m(self, error_m: Array) -> Array:
        """Return the distance of the tool from the path at each sample."""
        return trajectory.contour_error(self.reference_m, self.reference_m - error_m)

    def linearised_m(self, error_m: Array) -> Array:
        """Return the linearised contour error, eq. (4.1)."""
        contour_m: Array = np.sum(self.coupling[:, 0] * error_m, axis=1)
        return contour_m

    def learn(
        self,
        law: Law | None,
        iterations: int,
        plant: Callable[[Array], Array] | None = None,
        disturbance: Callable[[int], Array | float] = lambda _: 0.0,
    ) -> tuple[Figures, list[Array]]:
        """Return the RMS contour and tracking errors of each run, and all errors in m.

        Without a law there is feedback alone; without a plant the model is the true one.
        `disturbance` is that of the positions in m, for the number of a run.
        """
        simulate = self.plant.simulate if plant is None else plant
        history = runs(law, simulate, self.first_error_m, iterations, disturbance)
        errors = [error_m for _, error_m in history]
        return {
            "contour_rms_m": [rms(self.contour_m(error_m)) for error_m in errors],
            "linearised_rms_m": [rms(self.linearised_m(error_m)) for error_m in errors],
            "tracking_rms_m": [
                float(np.sqrt(np.mean(np.sum(error_m**2, axis=1)))) for error_m in errors
            ],
        }, errors


def stage(reference_m: Array) -> Stage:
    """Return both axes, each with the y axis' model: the print has no other."""
    axis, controller = axis_model(), axis_controller()
    one = axis.process_sensitivity(controller)
    left = axis.sensitivity(controller)
    return Stage(one.append(one), reference_m, left.append(left).simulate(reference_m))


def rest_until(reference_m: Array, n_samples: int) -> Array:
    """Return the path with rests at its end, to a number of samples."""
    missing = n_samples - len(reference_m)
    if missing < 0:
        message = f"n_samples = {n_samples}; the path has {len(reference_m)}"
        raise ValueError(message)
    return np.vstack([reference_m, np.repeat(reference_m[-1:], missing, axis=0)])

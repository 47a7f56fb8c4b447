"""The axis of the paper and its motion, common to all cases of this paper.

The position loop is closed by gain, the learned signal is added to the controller's output
(parallel structure), and the encoder is noisy. The other modules of the package import it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt import StateSpace, from_transfer_function
from ilc_rt.control import Pid
from ilc_rt.trajectory import butterfly

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ilc_papers.paper import Figures
    from ilc_rt import Law

    Array = NDArray[np.float64]

DT_S = 0.002
KP = 2.0
GAIN = 0.5
NOISE_M = 3e-7
RUNS = 60
REDUCED_RUNS = 40
_BEFORE_S, _AFTER_S = 0.1, 0.2


def plant() -> StateSpace:
    """Return the axis from controller output to position.

    ``G = 0.00475 z^-1 (1 + z^-1) / ((1 - z^-1) (1 - 0.85 z^-1))``

    References
    ----------
    [filter-ilc], Eq. (3), whose C must read [0.0190, 0, -0.01899].
    """
    return from_transfer_function([0.00475, 0.00475], np.polymul([1, -1], [1, -0.85]), dt_s=DT_S)


def loop() -> StateSpace:
    """Return the plant of the learning: from learned signal to position, ``G / (1 + C G)``."""
    return plant().process_sensitivity(Pid(KP, dt_s=DT_S).model())


@dataclass(frozen=True)
class Motion:
    """The X axis of the butterfly contour, at rest before and after.

    ``r = exp(cos t) - 2 cos 4t - sin(t/12)^5``, 1.85 mm, 4 mm/s, 20 mm/s² across the path.

    References
    ----------
    [filter-ilc], Fig. 4 to 6. Limits of the axis, and the rests, are not printed.
    """

    position_m: Array
    velocity_m_s: Array

    @property
    def n_samples(self) -> int:
        """Samples of a run."""
        return len(self.position_m)


@cache
def motion() -> Motion:
    """Plan the motion; every case has the same one."""
    path = butterfly(
        dt_s=DT_S, feed_m_s=0.004, curvature_acceleration_max_m_s2=0.02, scale_m=0.00185,
        velocity_max_m_s=0.1, acceleration_max_m_s2=1.0, jerk_max_m_s3=100.0,
    )  # fmt: skip
    before, after = round(_BEFORE_S / DT_S), round(_AFTER_S / DT_S)
    position_m = path.position_m[:, 0] - path.position_m[0, 0]
    return Motion(
        np.pad(position_m, (before, after), mode="edge"),
        np.pad(path.velocity_m_s[:, 0], (before, after)),
    )


@dataclass
class Course:
    """Measurement of a series of runs: the errors as the encoder shows them."""

    errors_m: list[Array] = field(default_factory=list)
    inputs: list[Array] = field(default_factory=list)

    @cached_property
    def rmse_m(self) -> list[float]:
        """Root mean square of each run's error."""
        return [float(np.sqrt(np.mean(e**2))) for e in self.errors_m]

    @cached_property
    def max_m(self) -> list[float]:
        """Largest error of each run."""
        return [float(abs(e).max()) for e in self.errors_m]

    def figures(self) -> Figures:
        """Return the two figures that the paper shows of each run."""
        return {"rmse_m": self.rmse_m, "max_m": self.max_m}

    def repeatable_m(self, last: int = 10) -> Array:
        """Return the mean error of the last runs: the level reached under noise."""
        mean: Array = np.mean(self.errors_m[-last:], axis=0)
        return mean


class Bench:
    """Runs the motion repeatedly.

    Parameters
    ----------
    moves : Motion
        The motion.
    seed : int
        Of the encoder's noise.
    noise_m : float
        Standard deviation of the encoder's white noise.
    """

    def __init__(self, moves: Motion, seed: int = 1, noise_m: float = NOISE_M) -> None:
        self.motion = moves
        self._loop = loop()
        self._random = np.random.default_rng(seed)
        self._noise_m = noise_m

    def run(self, learned: Array, added: Array | float = 0.0) -> Array:
        """Return the measured error of one run.

        ``u = w + C e`` with e the reference minus the noisy encoder.

        `added` is another input of the plant: a disturbance, a feed-forward.

        References
        ----------
        [filter-ilc], Eq. (2).
        """
        noise_m = self._noise_m * self._random.standard_normal(self.motion.n_samples)
        followed_m = self.motion.position_m - noise_m
        # Since w, reference and noise enter at one place, one simulation covers them all.
        return followed_m - self._loop.simulate(learned + added + KP * followed_m)

    def learn(
        self,
        law: Law,
        runs: int,
        added: Callable[[int], Array | float] = lambda _: 0.0,
        observe: Callable[[int], None] = lambda _: None,
    ) -> Course:
        """Run the motion and learn after each run.

        The first run is without learning. `added` gives the other input of the plant in each run;
        `observe` receives the number of each run when the law has learned from it.
        """
        course = Course()
        learned = np.zeros(self.motion.n_samples)
        for run in range(runs):
            e = self.run(learned, added(run))
            course.errors_m.append(e)
            course.inputs.append(learned)
            learned = law.update(learned, e)
            observe(run)
        return course

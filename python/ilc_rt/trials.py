"""Trials of learning weights on axes with unmodelled dynamics.

`tuning` uses them to choose the weights. They need only the cell description: no drive moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import tomlkit

from ilc_rt.laws import NormOptimalIlc
from ilc_rt.models import discretize, from_transfer_function

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt._native import Cell, StateSpace

    Array = NDArray[np.float64]

MODE_DAMPING = 0.1
"""Damping of the modes that a trial adds: that of a lightly damped structure."""
MODE_PLACES = (1.0, 1.25, 1.6, 2.2)
"""Frequencies of these modes, relative to the frequency up to which the model is trusted."""
KNOWN_SHARE = 1.3
"""Default of that frequency, relative to the natural frequency of the axis: a position loop is
tuned well below the first mode."""
FRICTION_SHARE = 0.05
"""Friction relative to the largest error of a run without learning."""


@dataclass(frozen=True)
class BelievedAxis:
    """An axis according to its cell, with its part of the program.

    Inputs are counted as the weights of a law count them: a torque by the travel that it holds.

    Attributes
    ----------
    cell : Cell
        The cell description.
    index : int
        Number of the axis in it.
    way : ndarray of float64, shape (n_samples,)
        Set points of a run, from its start; of a long program only the beginning.
    """

    cell: Cell
    index: int
    way: Array

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self.cell.axis_names[self.index]

    @property
    def unit(self) -> Literal["m", "rad"]:
        """Unit of its position."""
        return self.cell.axis_units[self.index]

    @property
    def dt_s(self) -> float:
        """Servo cycle in seconds."""
        return self.cell.cycle_s

    @property
    def natural_frequency_hz(self) -> float:
        """Natural frequency of its position loop, wherever it is closed."""
        return self.cell.natural_frequencies_hz[self.index]

    @property
    def input_bound(self) -> tuple[str, float]:
        """Key and value of the bound of its learned input."""
        return self.cell.input_bounds[self.index]

    @property
    def input_scale(self) -> float:
        """Unit of the weights per unit of that input."""
        return self.cell.input_scales[self.index]

    def perturbed(
        self, frequency: float = 1.0, damping: float = 1.0, delay: int = 0
    ) -> tuple[StateSpace, Array]:
        """Return the model from learned input to position, and the way of a run without learning.

        `frequency` and `damping` are factors of what the model of the axis describes; `delay`
        counts cycles in addition to its own.
        """
        model, way = self.cell.perturbed(self.index, frequency, damping, delay)
        return model, way[: len(self.way)]

    def model(self) -> StateSpace:
        """Return the closed loop from learned input to position."""
        return self.perturbed()[0]

    def first_error(self) -> Array:
        """Return the error of a run without learning, by the model."""
        return self.way - self.perturbed()[1]

    def gain(self) -> float:
        """Return the gain of the model: at rest, or its peak if a steady input has no effect."""
        model = self.model()
        static = abs(float(model.dc_gain()[0, 0]))
        highest = np.pi / self.dt_s
        w_rad_s = np.geomspace(0.01 * min(self.natural_frequency_hz, highest), 0.99 * highest, 200)
        peak = float(np.abs(model.frequency_response(w_rad_s)).max())
        return static if static > 0.1 * peak else peak

    def direction(self) -> Array:
        """Return the direction of motion at each sample; at rest, the last direction."""
        sign = np.sign(np.diff(self.way, prepend=self.way[:1]))
        moved = np.maximum.accumulate(np.where(sign != 0.0, np.arange(len(sign)), 0))
        return sign[moved]

    def mode(self, frequency_hz: float) -> StateSpace:
        """Return the position filtered by a mode between drive and tool."""
        w = 2.0 * np.pi * frequency_hz
        top = [2.0 * MODE_DAMPING * w, w * w]
        return discretize(from_transfer_function(top, [1.0, *top]), self.dt_s, "tustin")


def believed_axes(
    cell: Cell, samples_max: int | None = None
) -> tuple[list[BelievedAxis], dict[str, Any]]:
    """Return the axes of a cell, and its whole description as written.

    `samples_max` limits the part of the program that the axes get.
    """
    written = tomlkit.parse(Path(cell.path).read_text(encoding="utf-8-sig")).unwrap()
    way = cell.reference()[:samples_max] - cell.reference()[0]
    columns = (np.ascontiguousarray(way[:, index]) for index in range(cell.n_axes))
    return [BelievedAxis(cell, index, column) for index, column in enumerate(columns)], written


@dataclass(frozen=True)
class Suspect:
    """A perturbed axis.

    `plant` leads from the learned input to the measured position; `way` is that of a run without
    learning; `what` is how the axis differs from the model, in words.
    """

    what: str
    plant: StateSpace
    way: Array


def suspects(axis: BelievedAxis, uncertainty: float, known_hz: float) -> list[Suspect]:
    """Return perturbed axes, the most demanding first.

    Up to `known_hz` the model is right within `uncertainty`: natural frequency, damping and delay
    vary. Above it dynamics are arbitrary, such as a mode between drive and tool. Friction, which
    takes a constant input against the direction of motion, acts at every frequency.
    """
    model, way = axis.perturbed()
    friction = FRICTION_SHARE * float(np.abs(axis.way - way).max()) / axis.gain()
    stuck = way - model.simulate(friction * axis.direction())
    half = 0.5 * uncertainty
    nyquist_hz = 0.5 / axis.dt_s
    modes = [place * known_hz for place in MODE_PLACES if place * known_hz < 0.9 * nyquist_hz]

    def behind(hz: float, way: Array) -> tuple[StateSpace, Array]:
        return model.series(axis.mode(hz)), axis.mode(hz).simulate(way)

    found = [Suspect(f"friction and a mode at {hz:.3g} Hz", *behind(hz, stuck)) for hz in modes]
    found += [Suspect(f"a mode at {hz:.3g} Hz", *behind(hz, way)) for hz in modes]
    found += [
        Suspect("friction", model, stuck),
        Suspect(
            "slower, less damped, a cycle later", *axis.perturbed(1 - half, 1 - uncertainty, 1)
        ),
        Suspect(
            "faster, more damped, a cycle earlier", *axis.perturbed(1 + half, 1 + uncertainty, -1)
        ),
        Suspect("slower", *axis.perturbed(frequency=1 - half)),
        Suspect("faster", *axis.perturbed(frequency=1 + half)),
        Suspect("a cycle later", *axis.perturbed(delay=1)),
        Suspect("as its model", model, way),
    ]
    return found


@dataclass(frozen=True)
class Weights:
    """Weights of the cost: error, input, change of input, rate of the change."""

    q: float
    s: float
    r: float
    rate: float


@dataclass(frozen=True)
class Trial:
    """Result of learning on a perturbed axis.

    Attributes
    ----------
    axis : str
        Name of the axis.
    what : str
        How the perturbed axis differs from the model.
    rms : ndarray of float64, shape (n_runs + 1,)
        RMS error of each run; the first one is without learning.
    input_peak : float
        Largest learned input of the last run.
    """

    axis: str
    what: str
    rms: Array
    input_peak: float

    @property
    def growth(self) -> float:
        """Largest ratio of a run's error to the smallest one before it."""
        return float((self.rms[1:] / np.minimum.accumulate(self.rms)[:-1]).max())


class Bench:
    """Trials of one axis.

    `noise` is the standard deviation of white measurement noise; `n_runs` counts the runs after the
    first one; the others are as for `suspects`.
    """

    def __init__(
        self, axis: BelievedAxis, uncertainty: float, known_hz: float, noise: float, n_runs: int
    ) -> None:
        self.axis, self.noise = axis, noise
        self.model = axis.model()
        self.suspects = suspects(axis, uncertainty, known_hz)
        # The same noise for all weights, so that they differ by more than chance.
        shape = (n_runs + 1, len(axis.way))
        self._noise = noise * np.random.default_rng(1).standard_normal(shape) if noise else None
        self._n_runs = n_runs

    def try_weights(self, weights: Weights, growth_max: float = np.inf) -> list[Trial] | None:
        """Return a trial of each perturbed axis; None if an error grows more than allowed."""
        n_samples = len(self.axis.way)
        law = NormOptimalIlc(
            self.model, n_samples, q=weights.q, s=weights.s, r=weights.r, rate=weights.rate
        )
        trials = []
        for suspect in self.suspects:
            u, rms = np.zeros(n_samples), np.zeros(self._n_runs + 1)
            for run in range(self._n_runs + 1):
                e = self.axis.way - suspect.way - suspect.plant.simulate(u)
                if self._noise is not None:
                    e = e + self._noise[run]
                rms[run] = np.sqrt(np.mean(e * e))
                if rms[run] > growth_max * rms[: max(run, 1)].min():
                    return None
                if run < self._n_runs:
                    u = law.update(u, e)
            peak = float(np.abs(u).max(initial=0.0)) / self.axis.input_scale
            trials.append(Trial(self.axis.name, suspect.what, rms, peak))
        return trials

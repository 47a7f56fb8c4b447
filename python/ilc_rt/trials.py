"""Trials of learning weights on axes with unmodelled dynamics.

`tuning` uses them to choose the weights. They need only the cell description: no drive moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import tomlkit

from ilc_rt._native import StateSpace
from ilc_rt.laws import NormOptimalIlc
from ilc_rt.models import discretize, from_transfer_function, second_order

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ilc_rt._native import Cell

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

    Attributes
    ----------
    name : str
        Name of the axis.
    unit : {"m", "rad"}
        Unit of its position.
    interface : {"csp", "csv"}
        Its command mode.
    dt_s : float
        Servo cycle in seconds.
    way : ndarray of float64, shape (n_samples,)
        Set points of a run, from its start.
    natural_frequency_hz, damping : float
        Of the position loop; of a csv axis those of loop and drive together.
    delay_samples : int
        Dead time: cycles from a command to its first effect.
    velocity_bandwidth_hz, position_gain_per_s, velocity_feedforward : float
        Loop gain of a csv axis; 0 for a csp axis.
    """

    name: str
    unit: Literal["m", "rad"]
    interface: Literal["csp", "csv"]
    dt_s: float
    way: Array
    natural_frequency_hz: float
    damping: float
    delay_samples: int
    velocity_bandwidth_hz: float = 0.0
    position_gain_per_s: float = 0.0
    velocity_feedforward: float = 0.0

    def model(self, frequency: float = 1.0, damping: float = 1.0, delay: int = 0) -> StateSpace:
        """Return the closed loop from learned input to position.

        `frequency` and `damping` are factors: of natural frequency (csp) or velocity bandwidth
        (csv), and of damping (csp); `delay` counts cycles in addition to `delay_samples`.
        """
        turn, n_delay = 2.0 * np.pi, max(self.delay_samples + delay, 0)
        if self.interface == "csp":
            loop = second_order(
                turn * frequency * self.natural_frequency_hz, damping * self.damping
            )
            return discretize(loop, self.dt_s).delayed(n_delay)
        bandwidth = turn * frequency * self.velocity_bandwidth_hz
        velocity = from_transfer_function([bandwidth], [1.0, bandwidth, 0.0])
        gain = [[self.position_gain_per_s]]
        nothing = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
        # The loop sees a position that is one cycle old.
        controller = StateSpace(*nothing, gain, self.dt_s).delayed(1)
        return discretize(velocity, self.dt_s).delayed(n_delay).feedback(controller)

    def drive(self) -> Array:
        """Return the input of a run without learning, in the unit of the axis input."""
        if self.interface == "csp":
            return self.way
        ahead = np.append(self.way[1:], self.way[-1:])
        velocity = (ahead - self.way) / self.dt_s
        return self.position_gain_per_s * self.way + self.velocity_feedforward * velocity

    def first_error(self) -> Array:
        """Return the error of a run without learning, by the model."""
        return self.way - self.model().simulate(self.drive())

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
    axes = []
    for index, axis in enumerate(written["axis"]):
        model, loop = axis.get("model", {}), axis.get("position_loop", {})
        interface = cell.interfaces[index]
        bandwidth_hz = gain = 0.0
        if interface == "csp":
            natural_hz, damping = model["natural_frequency_hz"], model["damping"]
        else:
            bandwidth_hz, gain = model["velocity_bandwidth_hz"], loop["gain_per_s"]
            natural_hz = float(np.sqrt(gain * bandwidth_hz / (2.0 * np.pi)))
            damping = 0.5 * bandwidth_hz / natural_hz
        axes.append(
            BelievedAxis(
                cell.axis_names[index], cell.axis_units[index], interface, cell.cycle_s,
                np.ascontiguousarray(way[:, index]), float(natural_hz), float(damping),
                int(model.get("delay_samples", 0)), float(bandwidth_hz), float(gain),
                float(loop.get("velocity_feedforward", 0.0)),
            )
        )  # fmt: skip
    return axes, written


@dataclass(frozen=True)
class Suspect:
    """A perturbed axis.

    `plant` leads from the learned input to the measured position; `friction` is the input needed to
    overcome it; `what` is how the axis differs from the model, in words.
    """

    what: str
    plant: StateSpace
    friction: float = 0.0


def suspects(axis: BelievedAxis, uncertainty: float, known_hz: float) -> list[Suspect]:
    """Return perturbed axes, the most demanding first.

    Up to `known_hz` the model is right within `uncertainty`: natural frequency, damping and delay
    vary. Above it dynamics are arbitrary, such as a mode between drive and tool. Friction acts
    at every frequency.
    """
    model = axis.model()
    gain = abs(float(model.dc_gain()[0, 0]))
    friction = FRICTION_SHARE * float(np.abs(axis.first_error()).max()) / gain
    half = 0.5 * uncertainty
    nyquist_hz = 0.5 / axis.dt_s
    modes = [place * known_hz for place in MODE_PLACES if place * known_hz < 0.9 * nyquist_hz]
    found = [
        Suspect(f"friction and a mode at {hz:.3g} Hz", model.series(axis.mode(hz)), friction)
        for hz in modes
    ]
    found += [Suspect(f"a mode at {hz:.3g} Hz", model.series(axis.mode(hz))) for hz in modes]
    found += [
        Suspect("friction", model, friction),
        Suspect("slower, less damped, a cycle later", axis.model(1 - half, 1 - uncertainty, 1)),
        Suspect("faster, more damped, a cycle earlier", axis.model(1 + half, 1 + uncertainty, -1)),
        Suspect("slower", axis.model(frequency=1 - half)),
        Suspect("faster", axis.model(frequency=1 + half)),
        Suspect("a cycle later", axis.model(delay=1)),
        Suspect("as its model", model),
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
        drive, direction = axis.drive(), axis.direction()
        self._drives = [drive - suspect.friction * direction for suspect in self.suspects]
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
        for suspect, drive in zip(self.suspects, self._drives, strict=True):
            u, rms = np.zeros(n_samples), np.zeros(self._n_runs + 1)
            for run in range(self._n_runs + 1):
                e = self.axis.way - suspect.plant.simulate(drive + u)
                if self._noise is not None:
                    e = e + self._noise[run]
                rms[run] = np.sqrt(np.mean(e * e))
                if rms[run] > growth_max * rms[: max(run, 1)].min():
                    return None
                if run < self._n_runs:
                    u = law.update(u, e)
            trials.append(
                Trial(self.axis.name, suspect.what, rms, float(np.abs(u).max(initial=0.0)))
            )
        return trials

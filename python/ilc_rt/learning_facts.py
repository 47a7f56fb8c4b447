"""Facts of a plant that decide which law suits it: dead time, zeros, modes, what is known of it.

Imported by `ilc_rt.recommendation` and by users.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ilc_rt._native import LearningError, StateSpace, TimeVarying

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ilc_rt.laws.arguments import VaryingModel

    Array = NDArray[np.float64]

__all__ = ["LearningFacts", "Mode", "learning_facts"]

# Damping below which a mode counts as lightly damped, and uncertainty from which a model does not
# say in which direction to learn.
LIGHT = 0.2
KNOWN = 0.8
# Gains of the uncertainty from zero to the Nyquist frequency.
GRID = 513
# Places of a mode that are tried within its uncertainty.
MOVES = 41
# Distance from the unit circle that counts as outside of it.
OUTSIDE = 1e-7


@dataclass(frozen=True)
class Mode:
    """A lightly damped pair of poles.

    Attributes
    ----------
    frequency_hz : float
        Natural frequency in Hz.
    damping : float
        Damping factor, below 0.2.
    """

    frequency_hz: float
    damping: float


@dataclass(frozen=True)
class LearningFacts:
    """Facts of a plant that decide which law suits it.

    Attributes
    ----------
    n_inputs, n_outputs : int
        Channels.
    dt_s : float
        Sample time in s.
    varies : bool
        The model varies along the run.
    delay_samples : int or None
        Samples from the input to its first effect, in the fastest channel; None if not known.
    order : int or None
        Poles without those of a dead time; None if not known.
    integrators : int
        Poles at rest: 2 from a force to a position.
    zeros_outside : tuple of complex
        Zeros outside the unit circle, of one input and one output.
    is_non_minimum_phase : bool
        One of them is not merely made by sampling: its real part is positive.
    modes : tuple of Mode
        Lightly damped modes, by frequency.
    known_hz : float or None
        Frequency in Hz from which the model may be wrong by 80 % or more; None if there is none.
    uncertainty : ndarray of float64, shape (513,)
        Bound of the multiplicative uncertainty from zero to the Nyquist frequency. Of a single
        number it is that number, and near a mode the change of the response if the mode moves by
        half of it.
    """

    n_inputs: int
    n_outputs: int
    dt_s: float
    varies: bool
    delay_samples: int | None
    order: int | None
    integrators: int
    zeros_outside: tuple[complex, ...]
    is_non_minimum_phase: bool
    modes: tuple[Mode, ...]
    known_hz: float | None
    uncertainty: Array

    @property
    def is_single(self) -> bool:
        """One input and one output."""
        return (self.n_inputs, self.n_outputs) == (1, 1)

    @property
    def nyquist_hz(self) -> float:
        """Nyquist frequency in Hz."""
        return 0.5 / self.dt_s


def learning_facts(model: VaryingModel, uncertainty: float | ArrayLike = 0.3) -> LearningFacts:
    """Return the facts of a model that decide which law suits it.

    Parameters
    ----------
    model : StateSpace, TimeVarying or compatible
        Discrete model from the learned input to the measurement, including its dead time.
    uncertainty : float or array_like
        Multiplicative model uncertainty, 0.3 for 30 %; an array holds gains at equally spaced
        frequencies from zero to the Nyquist frequency.

    Raises
    ------
    LearningError
        If the model is continuous, has a pole outside the unit circle, responds to no input, or the
        uncertainty is out of range.

    Examples
    --------
    >>> from ilc_rt import discretize, second_order
    >>> found = learning_facts(discretize(second_order(94.0, 0.05), 0.002), 0.2)
    >>> found.delay_samples, [round(mode.frequency_hz, 1) for mode in found.modes]
    (1, [15.0])
    >>> found.known_hz < 15.0
    True
    """
    gains = _gains(uncertainty)
    if isinstance(model, TimeVarying):
        grid = np.interp(np.linspace(0.0, 1.0, GRID), np.linspace(0.0, 1.0, len(gains)), gains)
        return LearningFacts(
            model.n_inputs, model.n_outputs, float(model.dt_s or 1.0), varies=True,
            delay_samples=None, order=None, integrators=0, zeros_outside=(),
            is_non_minimum_phase=False, modes=(), uncertainty=grid,
            known_hz=_known_hz(grid, 0.5 / float(model.dt_s or 1.0)),
        )  # fmt: skip
    own = StateSpace._of(model)
    if own.dt_s is None:
        message = "model is in continuous time: discretize it with the sample time first"
        raise LearningError(message)
    delays = [delay for row in own.delays() for delay in row if delay is not None]
    if not delays:
        message = "model: it responds to no input"
        raise LearningError(message)
    poles = np.linalg.eigvals(own.a).astype(np.complex128) if own.n_states else np.zeros(0)
    unstable = poles[np.abs(poles) > 1.0 + OUTSIDE**0.5]
    if unstable.size:
        message = (
            f"model: a pole at {unstable[0]:.4g} is outside the unit circle; close a loop around "
            "the plant first (`StateSpace.feedback`)"
        )
        raise LearningError(message)
    modes = _modes(own)
    zeros = _zeros_outside(own)
    grid = _over_frequency(gains, modes, 0.5 / own.dt_s)
    return LearningFacts(
        own.n_inputs, own.n_outputs, own.dt_s, varies=False, delay_samples=min(delays),
        order=int((np.abs(poles) > 1e-9).sum()),
        integrators=int((np.abs(poles - 1.0) < 1e-4).sum()),
        zeros_outside=zeros,
        is_non_minimum_phase=any(zero.real > 0.0 for zero in zeros), modes=modes,
        known_hz=_known_hz(grid, 0.5 / own.dt_s), uncertainty=grid,
    )  # fmt: skip


def _gains(uncertainty: float | ArrayLike) -> Array:
    gains = np.atleast_1d(np.asarray(uncertainty, dtype=np.float64))
    if gains.ndim != 1 or not gains.size or not (np.isfinite(gains) & (gains >= 0.0)).all():
        message = f"uncertainty = {uncertainty!r}; gains of 0 or more are needed, as 0.3 for 30 %"
        raise LearningError(message)
    return gains


def _modes(model: StateSpace) -> tuple[Mode, ...]:
    found = [
        Mode(float(hz), float(damping))
        for hz, damping in zip(*model.natural_frequencies(), strict=True)
        # A pole at rest has neither frequency nor damping.
        if damping < LIGHT and hz > 1e-3
    ]
    return tuple(dict.fromkeys(Mode(round(m.frequency_hz, 9), round(m.damping, 9)) for m in found))


def _zeros_outside(model: StateSpace) -> tuple[complex, ...]:
    if (model.n_inputs, model.n_outputs) != (1, 1):
        return ()
    zeros = np.asarray(model.zeros(), dtype=np.complex128)
    # Zeros at infinity that numerics bring back are no zeros of the plant.
    chosen = zeros[(np.abs(zeros) > 1.0 - OUTSIDE) & (np.abs(zeros) < 1e6)]
    return tuple(complex(zero) for zero in chosen)


def _over_frequency(gains: Array, modes: tuple[Mode, ...], nyquist_hz: float) -> Array:
    share = np.linspace(0.0, 1.0, GRID)
    bound = np.interp(share, np.linspace(0.0, 1.0, len(gains)), gains)
    if len(gains) > 1:
        # A bound over frequency was measured, and holds the modes.
        return bound
    # A stiffness that is wrong by w moves the frequency of a mode by half of it.
    moved = 0.5 * min(float(gains[0]), 1.0)
    at = share * nyquist_hz
    for mode in modes:
        with np.errstate(divide="ignore"):
            there = _mode_response(at, mode.frequency_hz, mode.damping)
            change = np.max(
                [
                    np.abs(_mode_response(at, factor * mode.frequency_hz, mode.damping) / there - 1)
                    for factor in np.linspace(1.0 - moved, 1.0 + moved, MOVES)
                ],
                axis=0,
            )
        bound = np.maximum(bound, change)
    return np.minimum(bound, 1e3)


def _mode_response(at_hz: Array, frequency_hz: float, damping: float) -> NDArray[np.complex128]:
    ratio = at_hz / frequency_hz
    below = 1.0 - ratio**2 + 2j * max(damping, 1e-6) * ratio
    response: NDArray[np.complex128] = np.reciprocal(below.astype(np.complex128))
    return response


def _known_hz(bound: Array, nyquist_hz: float) -> float | None:
    wrong = np.flatnonzero(bound >= KNOWN)
    return None if not wrong.size else float(wrong[0] / (len(bound) - 1) * nyquist_hz)

"""Basis functions of feed-forward: signals of the reference that a law weights by parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from ilc_rt._native import LearningError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]
    Basis: TypeAlias = str | Callable[[Array, float], ArrayLike]

__all__ = ["PositionHarmonic", "position_harmonics"]

# Velocity up to which an axis counts as at rest, in its unit per second.
REST_VELOCITY = 1e-3


def _derivative(signal: Array, dt_s: float, order: int) -> Array:
    """Return a derivative by central differences; before and after the run the axis rests."""
    padded = np.concatenate((np.full(order, signal[0]), signal, np.full(order, signal[-1])))
    for _ in range(order):
        padded = (padded[2:] - padded[:-2]) / (2.0 * dt_s)
    return padded


def _coulomb(reference: Array, dt_s: float) -> Array:
    return np.tanh(_derivative(reference, dt_s, 1) / REST_VELOCITY)


NAMED: dict[str, Callable[[Array, float], Array]] = {
    "position": lambda reference, dt_s: reference - reference[0],
    "velocity": lambda reference, dt_s: _derivative(reference, dt_s, 1),
    "acceleration": lambda reference, dt_s: _derivative(reference, dt_s, 2),
    "jerk": lambda reference, dt_s: _derivative(reference, dt_s, 3),
    "snap": lambda reference, dt_s: _derivative(reference, dt_s, 4),
    "coulomb": _coulomb,
    "viscous": lambda reference, dt_s: _derivative(reference, dt_s, 1),
}


@dataclass(frozen=True)
class PositionHarmonic:
    """A harmonic of the position: of cogging, of a ball screw's pitch, of an eccentric wheel.

    ``psi = sin(2 pi order r / pitch)``, or the cosine

    Attributes
    ----------
    pitch : float
        Period in the unit of the position.
    order : int
        Number of the harmonic, from 1.
    is_cosine : bool
        Cosine in place of sine.

    Examples
    --------
    >>> import numpy as np
    >>> PositionHarmonic(0.01)(np.array([0.0, 0.0025, 0.005]), 0.001).round(6).tolist()
    [0.0, 1.0, 0.0]
    """

    pitch: float
    order: int = 1
    is_cosine: bool = False

    def __post_init__(self) -> None:
        """Refuse a pitch or an order out of range."""
        if not isinstance(self.is_cosine, bool):
            message = f"is_cosine = {self.is_cosine!r}; True or False is needed"
            raise TypeError(message)
        _check_harmonic(self.pitch, self.order)

    def __call__(self, reference: Array, dt_s: float) -> Array:
        """Return the signal of a reference."""
        phase = 2.0 * np.pi * self.order * reference / self.pitch
        return np.cos(phase) if self.is_cosine else np.sin(phase)


def _check_harmonic(pitch: object, order: object) -> None:
    if not (isinstance(pitch, (int, float)) and np.isfinite(pitch) and pitch > 0):
        message = f"pitch = {pitch!r}: a finite number above 0 is needed"
        raise LearningError(message)
    if not isinstance(order, int) or not 1 <= order <= 100:
        message = f"order = {order!r}: a whole number from 1 to 100 is needed"
        raise LearningError(message)


def position_harmonics(pitch: float, orders: int = 1) -> tuple[PositionHarmonic, ...]:
    """Return sine and cosine of the first harmonics of a pitch, for learning over the position.

    An error that repeats with the position is learned at one speed and compensated at every other
    one, on every trajectory, as long as its frequency is well below the bandwidth of the axis.

    Parameters
    ----------
    pitch : float
        Period in the unit of the position.
    orders : int
        Number of harmonics, 1 to 100.

    Raises
    ------
    LearningError
        If the pitch is not above 0, or the number out of range.

    Examples
    --------
    >>> len(position_harmonics(0.01, 3))
    6
    """
    _check_harmonic(pitch, orders)
    return tuple(
        PositionHarmonic(float(pitch), order, is_cosine)
        for order in range(1, orders + 1)
        for is_cosine in (False, True)
    )


def named_bases(basis: Sequence[Basis]) -> dict[str, Callable[[Array, float], ArrayLike]]:
    """Return basis functions by name.

    Raises
    ------
    LearningError, TypeError
        If a name is unknown or there twice, or an entry is neither a name nor a function.

    Examples
    --------
    >>> list(named_bases(["velocity", PositionHarmonic(0.01)]))
    ['velocity', 'PositionHarmonic(pitch=0.01, order=1, is_cosine=False)']
    """
    if isinstance(basis, str) or not isinstance(basis, Sequence) or not basis:
        message = f"basis = {basis!r}: a list of names or functions is needed"
        raise TypeError(message)
    found: dict[str, Callable[[Array, float], ArrayLike]] = {}
    function: Callable[[Array, float], ArrayLike]
    for entry in basis:
        if isinstance(entry, str):
            if entry not in NAMED:
                message = f"basis = {entry!r}: allowed {', '.join(NAMED)}, or a function"
                raise LearningError(message)
            name, function = entry, NAMED[entry]
        elif callable(entry):
            name, function = str(getattr(entry, "__name__", repr(entry))), entry
        else:
            message = f"basis = {entry!r}: a name or a function of reference and dt_s is needed"
            raise TypeError(message)
        if name in found or {name, *found} >= {"velocity", "viscous"}:
            message = f"basis: {name} is there twice"
            raise LearningError(message)
        found[name] = function
    return found


def basis_signals(
    bases: dict[str, Callable[[Array, float], ArrayLike]], reference: Array, dt_s: float, lead: int
) -> Array:
    """Return the signals of all functions for every axis, shape (n_axes, n_functions, n_samples).

    Raises
    ------
    ValueError
        If a function returns another shape, or a number that is not finite.
    """
    rows = []
    for axis in reference.T:
        for name, function in bases.items():
            signal = np.asarray(function(axis.copy(), dt_s))
            if signal.shape != axis.shape or signal.dtype.kind not in "iuf":
                message = f"basis {name}: it returned shape {signal.shape}; {axis.shape} is needed"
                raise ValueError(message)
            if not np.isfinite(signal).all():
                message = f"basis {name}: it returned a number that is not finite"
                raise ValueError(message)
            ahead = np.concatenate((signal[lead:], np.full(min(lead, len(signal)), signal[-1])))
            rows.append(ahead.astype(np.float64))
    return np.array(rows).reshape(reference.shape[1], len(bases), len(reference))

"""An axis of a cell that is watched; `ilc_rt.watched` keeps one for each."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Iterable

#: Batches of servo cycles whose largest error is kept.
TRAIL_MAX = 120


def drive_words(axes: Iterable[WatchedAxis]) -> str:
    """Return the states of the drives: one for all, or each with its axes."""
    states: dict[str, list[str]] = {}
    for axis in axes:
        states.setdefault(printable(axis.drive or "unknown"), []).append(printable(axis.name))
    if len(states) == 1:
        return next(iter(states))
    return ", ".join(f"{state} ({', '.join(names)})" for state, names in states.items())


@dataclass(slots=True)
class WatchedAxis:
    """An axis, as its last batch of servo cycles showed it; positions in its own unit.

    Attributes
    ----------
    name, unit : str
        Its name; "m" or "rad".
    reference_m, measured_m, input, error_m : float or None
        Set point, measured position and learned input of the newest cycle, and set point less
        measured position there.
    trail_m : deque of float
        Largest absolute tracking error of each batch within a run, oldest first.
    is_faulty : bool
        True if a fault has named this axis.
    drive : str or None
        State of CiA 402 of its drive, in words.
    """

    name: str
    unit: str = "m"
    reference_m: float | None = None
    measured_m: float | None = None
    input: float | None = None
    error_m: float | None = None
    trail_m: deque[float] = field(default_factory=lambda: deque(maxlen=TRAIL_MAX))
    is_faulty: bool = False
    drive: str | None = None

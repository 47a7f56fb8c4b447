"""A line on what happened to a cell that is watched; `ilc_rt.watched` keeps the newest."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Note:
    """A line on something that happened.

    Attributes
    ----------
    kind : str
        "fault", "warning", "note", or "log" for what is usual and only belongs in a log.
    text : str
        The line, printable.
    at_s : float
        When, by the clock of the cell.
    campaign : int
        Number of the campaign among those that were watched.
    """

    kind: str
    text: str
    at_s: float = 0.0
    campaign: int = 0

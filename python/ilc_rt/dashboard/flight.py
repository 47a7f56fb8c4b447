"""Flight records that controllers leave beside their libraries, for a page that came later."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

from ilc_rt.events import Histogram, parse_histogram
from ilc_rt.lateness import LateCycle, parse_counts, parse_late_cycle

if TYPE_CHECKING:
    from pathlib import Path

FILE_MAX_BYTES = 4 << 20
STAGES = {"wake": "wake-up late", "receive": "receive", "control": "control", "send": "send"}


@dataclass(frozen=True, slots=True)
class FlightRecord:
    """Timing of the last run in real time of a cell.

    Attributes
    ----------
    campaign : str
        Its campaign.
    timing : dict of str to Histogram
        Histograms of the stages of its cycles, by their words.
    n_late : int
        Number of late cycles.
    worst : LateCycle or None
        The worst of them.
    """

    campaign: str
    timing: dict[str, Histogram]
    n_late: int
    worst: LateCycle | None


def read_flight(library: Path, cell: str) -> FlightRecord | None:
    """Return the flight record of a cell beside a library; None if it cannot be read."""
    file = library.with_name(f"{library.stem}.{cell}.late.json")
    try:
        if file.stat().st_size > FILE_MAX_BYTES:
            return None
        data = json.loads(file.read_text(encoding="utf-8"))
        counts = parse_counts(data["late"])
        worst = next(iter(data["worst"]), None)
        return FlightRecord(
            campaign=str(data["campaign"]),
            timing={
                words: parse_histogram(data["stages_us"][stage])
                for stage, words in STAGES.items()
                if stage in data["stages_us"]
            },
            n_late=0 if counts is None else sum(asdict(counts).values()) - counts.missed,
            worst=parse_late_cycle(worst),
        )
    except (AttributeError, KeyError, OSError, RecursionError, TypeError, ValueError):
        # Written by another version, or being written: the next campaign brings another one.
        return None

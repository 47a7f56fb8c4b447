"""State of a cell in words and a level; imported by `model`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ilc_rt.result import UNTIL_STOPPED
from ilc_rt.text import printable
from ilc_rt.wording import state_words

if TYPE_CHECKING:
    from ilc_rt.dashboard.model import CellModel

#: A cell that says nothing for longer is silent; batches come every 0.05 s, progress every 0.1 s.
SILENT_S = 3.0
#: States in which a controller has no loop yet, and says nothing.
WITHOUT_LOOP = frozenset({"bringing_up", "homing"})
ENDS = {"completed": "completed", "interrupted": "stopped", "fault": "stopped by a fault"}
SYMBOLS = {"run": "▶", "idle": "■", "busy": "◆", "silent": "○", "warn": "▲", "fault": "✕"}
"""A sign beside each word, as colour is never the only one."""


@dataclass(frozen=True, slots=True)
class Status:
    """State of a cell: a level of `SYMBOLS`, and words."""

    level: str
    words: str

    @property
    def symbol(self) -> str:
        """Sign of the level."""
        return SYMBOLS[self.level]


def status_of(cell: CellModel, now_s: float) -> Status:
    """Return the state of a cell at a monotonic time."""
    if cell.seen_s is None:
        return Status("silent", "not heard yet")
    if cell.end is not None:
        level = "fault" if cell.end.status == "fault" else "idle"
        return Status(level, ENDS.get(cell.end.status, printable(cell.end.status)))
    quiet_s = now_s - cell.seen_s
    if cell.gone_s is not None or (quiet_s > SILENT_S and cell.state not in WITHOUT_LOOP):
        return Status("silent", f"silent since {quiet_s:.0f} s")
    if cell.fault is not None:
        return Status("fault", "fault")
    if cell.state is None:
        return Status("busy", "controller is there")
    return Status("run" if cell.state == "running" else "busy", state_words(cell.state))


def run_words(cell: CellModel) -> str:
    """Return the number of the run, of how many, and how far it is."""
    index, total = cell.iteration, cell.iterations
    if index is None or cell.end is not None:
        n_runs = len(cell.records)
        return "no run yet" if not n_runs else f"{n_runs} run{'' if n_runs == 1 else 's'}"
    if not total or total == UNTIL_STOPPED:
        of = ""
    elif index >= total:
        return f"all {total} runs"
    else:
        of = f" ({index + 1} of {total})"
    share = "" if cell.progress is None else f", {100.0 * cell.progress:.0f} %"
    return f"run {index}{of}{share}"


def axis_words(cell: CellModel, axis: int, now_s: float) -> Status:
    """Return the state of an axis: that of its cell, or its own fault."""
    if cell.fault is not None and cell.axes[axis].is_faulty:
        return Status("fault", f"fault: {printable(cell.fault.reason)}")
    status = status_of(cell, now_s)
    if status.level == "fault":
        return Status("idle", "stopped with the others")
    return status

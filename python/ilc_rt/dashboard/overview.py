"""The first page: a card for each cell."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING
from urllib.parse import quote

from ilc_rt.dashboard.frame import every, fact, level, page_frame, say, tag, text
from ilc_rt.dashboard.status import run_words
from ilc_rt.quantity import signed
from ilc_rt.text import printable

if TYPE_CHECKING:
    from ilc_rt.dashboard.fleet import Fleet
    from ilc_rt.dashboard.model import CellModel

REFRESH_S = 0.25


def build_overview(fleet: Fleet) -> None:
    """Build the page with a card for each cell; one that appears gets its card."""
    cards: dict[str, _Card] = {}
    with page_frame("/"):
        place = tag("div", "cards")
        nothing = text(
            "No cell is heard yet. Cards appear by themselves as controllers start.", "empty"
        )

    def refresh() -> None:
        with fleet.lock:
            for name, cell in sorted(fleet.cells.items()):
                if name not in cards:
                    with place:
                        cards[name] = _Card(name)
                cards[name].show(cell)
            nothing.set_visibility(not fleet.cells)

    refresh()
    every(REFRESH_S, refresh)


class _Card:
    """A cell in a few figures; one click leads to it."""

    def __init__(self, name: str) -> None:
        self._link = tag("a", "card", href=f"/cell/{quote(name, safe='')}", data_cell=name)
        with self._link:
            with tag("div", "head"):
                text(printable(name), "name")
                self._state = text("", "state", "state")
            with tag("div", "facts"):
                self._run = fact("run", "run")
                self._error = fact("error of the last run", "error")
                self._change = fact("since the first", "change")
            self._line = text("", "quiet", "line")
            with tag("div", "meter"):
                self._meter = tag("div")

    def show(self, cell: CellModel) -> None:
        status = cell.status(time.monotonic())
        say(self._state, f"{status.symbol} {status.words}")
        level(self._link, status.level)
        say(self._run, run_words(cell))
        error, change = error_words(cell)
        say(self._error, error)
        say(self._change, change)
        say(self._line, _line(cell))
        self._meter.style(f"width: {100.0 * (cell.progress or 0.0):.0f}%")


def error_words(cell: CellModel) -> tuple[str, str]:
    """Return the error of the last run, and its change since the first one."""
    comparison, records = cell.comparison, cell.records
    if comparison is None:
        return "-", "-"
    column = comparison.errors(rms=False)[-1 if comparison.by_contour else 0]
    before, after = column.of(records[0]), column.of(records[-1])
    said = column.unit.text(after)
    return said, (signed(before, after) if len(records) > 1 else "") or "-"


def _line(cell: CellModel) -> str:
    """Return what matters most beside the state."""
    if cell.fault is not None:
        return printable(cell.fault.reason)
    decision = cell.decision
    if decision is not None and decision is cell.last:
        why = printable(decision.remark or "the error grew")
        return f"{'learning is off' if decision.learning_off else 'rolled back'}: {why}"
    axes = f"{cell.n_axes} {'axis' if cell.n_axes == 1 else 'axes'}" if cell.n_axes else ""
    return ", ".join(part for part in (axes, cell.law or "") if part)

"""Show a campaign in the terminal while it runs."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from rich.console import Console
from rich.live import Live
from rich.text import Text

from ilc_rt.events import (
    DriftEvent,
    EndEvent,
    IterationEvent,
    JudgedEvent,
    StartEvent,
)
from ilc_rt.table import headings, plain_line, run_cells, runs_table
from ilc_rt.terminal import CellView
from ilc_rt.text import printable
from ilc_rt.watched import WatchedCell
from ilc_rt.wording import WORDS, describe, drift

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import RenderableType
    from typing_extensions import Self

    from ilc_rt.events import Event
    from ilc_rt.result import CampaignResult

__all__ = ["WORDS", "CampaignView", "describe", "drift", "is_live"]

# Number of remarks below the table in a terminal: the newest ones.
REMARKS_SHOWN = 8
DRAWN_PER_SECOND = 10


def is_live(console: Console) -> bool:
    """Return whether a console can be drawn over: a terminal that moves its cursor."""
    return console.is_terminal and not console.is_dumb_terminal


class CampaignView:
    """The view of the monitor while it runs, then the table; plain lines if not a terminal."""

    def __init__(self, console: Console | None = None) -> None:
        # Names may contain brackets and colons: nothing printed is markup.
        self._console = console or Console(highlight=False, markup=False, emoji=False)
        self._live: Live | None = None
        self._cell = WatchedCell("cell")
        self._names: tuple[str, ...] = ()
        # Number of the newest run whose remark was printed.
        self._remarked = -1

    def __enter__(self) -> Self:
        """Start drawing."""
        if is_live(self._console):
            # Drawn on demand, as events arrive ten times a second; nothing else reads the state.
            self._live = Live(
                Text("starting"), console=self._console, auto_refresh=False, transient=True
            )
            self._live.start(refresh=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Stop drawing."""
        if self._live is not None:
            self._live.stop()

    def show(self, event: Event, result: CampaignResult) -> None:
        """Show one event; `result` has handled it already."""
        if isinstance(event, StartEvent):
            self._begin(event, result)
        else:
            self._cell.see(event)
        if isinstance(event, DriftEvent) and self._live is None:
            self._console.print(printable(drift(event)), style="yellow", soft_wrap=True)
        elif isinstance(event, EndEvent):
            self._finish(result)
        elif self._live is not None:
            self._live.update(CellView(self._cell), refresh=True)
        elif isinstance(event, IterationEvent):
            self._print_plain(result)
        elif isinstance(event, JudgedEvent):
            self._print_remarks(result)

    def _begin(self, event: StartEvent, result: CampaignResult) -> None:
        self._console.print(describe(event), soft_wrap=True)
        if event.ctl:
            self._console.print(f"control: {printable(event.ctl)}", soft_wrap=True)
        for note in event.rt.notes if event.rt else ():
            said = f"note: {printable(note)}"
            self._console.print(said, style="yellow", soft_wrap=True)
        self._cell.name = event.cell
        self._cell.see(event)
        # Printed above already, and they stay there.
        self._cell.log.clear()
        self._cell.recall(result.records)

    def _print_plain(self, result: CampaignResult) -> None:
        comparison = result.comparison
        names = headings(comparison)
        # Remarks on the earlier runs of a resumed campaign were shown when they were made.
        if not self._names and len(result.records) > 1:
            self._remarked = result.records[-2].index
        if names != self._names:
            # Once, and again if the errors have outgrown their unit.
            self._names = names
            print(plain_line(names, names))
        print(plain_line(run_cells(comparison, result.records[-1]), names))
        self._print_remarks(result)

    def _print_remarks(self, result: CampaignResult) -> None:
        for index, remark in result.comparison.numbered_remarks():
            if index > self._remarked:
                print(f"     {printable(remark)}")
                self._remarked = index
        sys.stdout.flush()

    def _finish(self, result: CampaignResult) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None
            for part in _table(result):
                self._console.print(part)
            for note in self._cell.notes:
                if note.text.startswith("drift:"):
                    self._console.print(Text(note.text, style="yellow"), soft_wrap=True)


def _table(result: CampaignResult) -> list[RenderableType]:
    """Return the table of runs, with the remarks below it."""
    if not result.records:
        return []
    table = runs_table(result.comparison)
    lines = [Text(line, style="yellow") for line in _remarks(result)[-REMARKS_SHOWN:]]
    return [table, *lines]


def _remarks(result: CampaignResult) -> list[str]:
    return [printable(line) for line in result.comparison.remarks()]

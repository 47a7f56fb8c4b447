"""Show a campaign in the terminal while it runs."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn
from rich.text import Text

from ilc_rt.events import (
    DriftEvent,
    EndEvent,
    FaultEvent,
    IterationEvent,
    JudgedEvent,
    ProgressEvent,
    StartEvent,
    StateEvent,
)
from ilc_rt.result import UNTIL_STOPPED
from ilc_rt.table import headings, plain_line, run_cells, runs_table
from ilc_rt.text import printable

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import RenderableType
    from typing_extensions import Self

    from ilc_rt.events import Event
    from ilc_rt.result import CampaignResult

# Number of remarks below the table in a terminal: the newest ones.
REMARKS_SHOWN = 8
WORDS = {
    "bringing_up": "bringing the drives up",
    "homing": "homing",
    "enabling": "switching the drives on",
    "returning": "returning to the start",
    "settling": "settling at the start",
    "waiting": "waiting for its start",
    "running": "running",
    "paused": "held on the path",
    "stopping": "stopping the axes",
    "stopped": "at rest",
}


def describe(start: StartEvent) -> str:
    """Return one line on the coming campaign and its bus."""
    clock = "real time" if start.mode == "realtime" else "lock-step"
    seconds = start.n_samples * start.cycle_s
    axes = f"{start.n_axes} {'axis' if start.n_axes == 1 else 'axes'}"
    learns = {
        "none": "nothing is learned",
        "frozen": f"frozen input, watched at the {start.measure}",
    }.get(start.law, f"{start.law} learns from {start.measure}")
    return printable(
        f"{start.cell}: {axes}, {seconds:.2f} s a run at {start.cycle_s * 1e3:g} ms, "
        f"{learns}, {start.bus}, {clock}"
    )


def drift(event: DriftEvent) -> str:
    """Return one line on a frozen input that does not fit any more.

    Examples
    --------
    >>> drift(DriftEvent(7, 1.5, "run 3 of campaign c", 2.0))
    'drift: the error of run 7 is 2.00 times that of run 3 of campaign c, 1.5 is allowed'
    """
    times = "beyond" if event.ratio is None else f"{event.ratio:.2f} times"
    line = f"drift: the error of run {event.index} is {times} that of {event.origin}"
    again = (
        f"; learning starts again from its input, in campaign {event.relearned_in}"
        if event.relearned_in
        else ""
    )
    return f"{line}, {event.allowed:g} is allowed{again}"


class CampaignView:
    """A growing table and a progress bar; plain lines if not a terminal."""

    def __init__(self, console: Console | None = None) -> None:
        # Names may contain brackets and colons: nothing printed is markup.
        self._console = console or Console(highlight=False, markup=False, emoji=False)
        self._live: Live | None = None
        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=36),
            TextColumn("{task.percentage:3.0f} %"),
            console=self._console,
        )
        self._task = self._bar.add_task("starting", total=1.0)
        self._runs = 0
        self._names: tuple[str, ...] = ()
        # Number of the newest run whose remark was printed.
        self._remarked = -1

    def __enter__(self) -> Self:
        """Start drawing."""
        if self._console.is_terminal:
            self._live = Live(console=self._console, refresh_per_second=10, transient=True)
            self._live.start()
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
            self._runs = 0 if event.iterations == UNTIL_STOPPED else event.iterations
            self._console.print(describe(event), soft_wrap=True)
            if event.ctl:
                self._console.print(f"control: {printable(event.ctl)}", soft_wrap=True)
            for note in event.rt.notes if event.rt else ():
                said = f"note: {printable(note)}"
                self._console.print(said, style="yellow", soft_wrap=True)
        elif isinstance(event, StateEvent):
            words = WORDS.get(event.state, printable(event.state.replace("_", " ")))
            index = event.iteration
            if index is None or index >= self._runs > 0:
                run = ""  # the return after the last run
            else:
                run = f"run {index}" + (f" ({index + 1} of {self._runs}): " if self._runs else ": ")
            self._bar.reset(self._task, description=run + words)
        elif isinstance(event, ProgressEvent):
            self._bar.update(self._task, completed=event.sample / max(1, event.n_samples))
        elif isinstance(event, DriftEvent):
            self._console.print(printable(drift(event)), style="yellow", soft_wrap=True)
        elif isinstance(event, FaultEvent):
            self._bar.update(self._task, description="fault: stopping the axes")
        elif isinstance(event, EndEvent):
            self._finish(result)
            return
        if self._live is not None:
            self._live.update(Group(*_table(result), self._bar))
        elif isinstance(event, IterationEvent):
            self._print_plain(result)
        elif isinstance(event, JudgedEvent):
            self._print_remarks(result)

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


def _table(result: CampaignResult) -> list[RenderableType]:
    """Return the table of runs, with the remarks below it."""
    if not result.records:
        return []
    table = runs_table(result.comparison)
    lines = [Text(line, style="yellow") for line in _remarks(result)[-REMARKS_SHOWN:]]
    return [table, *lines]


def _remarks(result: CampaignResult) -> list[str]:
    return [printable(line) for line in result.comparison.remarks()]

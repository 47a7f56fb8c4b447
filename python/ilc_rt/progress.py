"""Show a campaign in the terminal while it runs."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn

from ilc_rt.events import (
    EndEvent,
    FaultEvent,
    IterationEvent,
    ProgressEvent,
    StartEvent,
    StateEvent,
)
from ilc_rt.table import HEAD, plain_line, run_cells, runs_table

if TYPE_CHECKING:
    from types import TracebackType

    from typing_extensions import Self

    from ilc_rt.events import Event
    from ilc_rt.result import CampaignResult

WORDS = {
    "bringing_up": "bringing the drives up",
    "enabling": "switching the drives on",
    "returning": "returning to the start",
    "settling": "settling at the start",
    "running": "running",
    "stopping": "stopping the axes",
    "stopped": "at rest",
}


def describe(start: StartEvent) -> str:
    """Return one line that says what is about to run where."""
    clock = "real time" if start.mode == "realtime" else "lock-step"
    seconds = start.n_samples * start.cycle_s
    return (
        f"{start.cell}: {start.n_axes} axes, {seconds:.2f} s a run at {start.cycle_s * 1e3:g} ms, "
        f"{start.law} learns from {start.measure}, {start.bus}, {clock}"
    )


class CampaignView:
    """A growing table and a progress bar; plain lines if not a terminal.

    Parameters
    ----------
    console : Console or None
        Where to; standard output by default.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(highlight=False)
        self._live: Live | None = None
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=36),
            TextColumn("{task.percentage:3.0f} %"),
            console=self._console,
        )
        self._task = self._bar.add_task("starting", total=1.0)
        self._runs = 0
        self._named = False

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
        """Show one event; `result` has taken it in already."""
        if isinstance(event, StartEvent):
            self._runs = event.iterations
            self._console.print(describe(event), soft_wrap=True)
            for note in event.rt.notes if event.rt else ():
                self._console.print(f"note: {note}", style="yellow", soft_wrap=True)
        elif isinstance(event, StateEvent):
            words = WORDS.get(event.state, event.state.replace("_", " "))
            index = event.iteration
            if index is None or index >= self._runs > 0:
                run = ""  # the way home after the last run
            else:
                run = f"run {index}" + (f" ({index + 1} of {self._runs}): " if self._runs else ": ")
            self._bar.reset(self._task, description=run + words)
        elif isinstance(event, ProgressEvent):
            self._bar.update(self._task, completed=event.sample / max(1, event.n_samples))
        elif isinstance(event, FaultEvent):
            self._bar.update(self._task, description="fault: stopping the axes")
        elif isinstance(event, EndEvent):
            self._finish(result)
            return
        if self._live is not None:
            self._live.update(Group(runs_table(result.records), self._bar))
        elif isinstance(event, IterationEvent):
            self._print_plain(result)

    def _print_plain(self, result: CampaignResult) -> None:
        if not self._named:
            self._named = True
            print(plain_line([name for name, _ in HEAD]))
        print(plain_line(run_cells(result.records[-1], result.records[0])))
        sys.stdout.flush()

    def _finish(self, result: CampaignResult) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None
            if result.records:
                self._console.print(runs_table(result.records))

"""`ilc monitor`: follow controllers on the network from a terminal."""

from __future__ import annotations

import json
import sys
import time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.live import Live

from ilc_rt.commands.network import (
    CellName,
    Connect,
    Libraries,
    Router,
    Scouting,
    Timeout,
    described,
    listen,
    remembering,
    whom,
)
from ilc_rt.comparison import Comparison
from ilc_rt.errors import EXIT_FAULT
from ilc_rt.events import (
    EndEvent,
    FaultEvent,
    IterationEvent,
    JudgedEvent,
    LateEvent,
    LatencyEvent,
    ProgressEvent,
    StartEvent,
    StateEvent,
)
from ilc_rt.interruption import ControlledStop
from ilc_rt.lateness import late_sentence
from ilc_rt.progress import is_live
from ilc_rt.quantity import axis_unit
from ilc_rt.record import IterationRecord
from ilc_rt.sources import Memory
from ilc_rt.table import headings, plain_line, run_cells
from ilc_rt.terminal import CellsView
from ilc_rt.text import printable
from ilc_rt.watched import WatchedCell
from ilc_rt.wording import WORDS, describe

if TYPE_CHECKING:
    from ilc_rt import Cell
    from ilc_rt.monitor import Message, Monitor

WARNINGS_MAX = 100
# Any program on the network can publish under any name.
CELLS_MAX = 16
REDRAWN_S = 0.25

Runs = Annotated[
    int | None,
    typer.Option("--iterations", "-n", min=1, help="End after this many runs were seen."),
]
Raw = Annotated[
    bool,
    typer.Option("--events", "--json", help="Print the JSON objects as they come, one per line."),
]
Plain = Annotated[
    bool, typer.Option("--plain", help="Print lines, as into a pipe, instead of a live view.")
]


def monitor(
    cell: CellName = "*",
    connect: Connect = None,
    scouting: Scouting = True,
    router: Router = False,
    library: Libraries = None,
    iterations: Runs = None,
    timeout: Timeout = None,
    plain: Plain = False,
    events: Raw = False,
) -> None:
    """Watch a controller: its state, each run's error, and faults.

    In a terminal a live view: progress and time left, axes, errors, roll-backs, faults, late
    cycles. Into a pipe, or with --plain, one line for each.

    Example: ilc monitor gantry --connect tcp/192.168.1.5:7447
    """
    name, known = described(cell)
    # Names may contain brackets and colons: nothing printed is markup.
    console = Console(highlight=False, markup=False, emoji=False)
    draws = is_live(console) and not plain and not events
    with (
        remembering(library) as memory,
        listen(name, connect, scouting=scouting, router=router) as watching,
    ):
        view: _View | _Screen
        view = _Screen(console, memory, known) if draws else _View(memory, known, events=events)
        if isinstance(view, _Screen):
            view.watch(watching, iterations, timeout)
        else:
            typer.echo(f"watching {whom(name)}; Ctrl-C ends this, not the machine", err=True)
            for message in watching.messages(timeout):
                view.show(message)
                if iterations is not None and view.runs >= iterations:
                    break
    if view.faults:
        raise SystemExit(EXIT_FAULT)


class _Screen:
    """Draws all cells that are heard on a screen of its own, and counts runs and faults."""

    def __init__(self, console: Console, memory: Memory, known: Cell | None) -> None:
        self.runs = 0
        self.faults = 0
        self._console = console
        self._memory = memory
        self._cells: dict[str, WatchedCell] = {}
        if known is not None:
            self._cells[known.name] = WatchedCell(known.name)
            self._cells[known.name].describe(known)

    def watch(self, watching: Monitor, iterations: int | None, timeout_s: float | None) -> None:
        """Draw until enough runs were seen, the time is over, or a signal asks to end.

        The terminal gets its former content back, and the last state below it.
        """
        until = None if timeout_s is None else time.monotonic() + timeout_s
        # What ends the program would otherwise leave the terminal without cursor.
        with ControlledStop(lambda _: None) as stop:
            with Live(
                CellsView(()), console=self._console, screen=True, auto_refresh=False
            ) as live:
                while stop.received is None and (until is None or time.monotonic() < until):
                    live.update(CellsView([*self._cells.values()]), refresh=True)
                    for message in watching.messages(REDRAWN_S):
                        self.show(message)
                        if iterations is not None and self.runs >= iterations:
                            break
                    if iterations is not None and self.runs >= iterations:
                        break
            if self._cells:
                self._console.print(CellsView([*self._cells.values()]))
            stop.raise_received()

    def show(self, message: Message) -> None:
        """Take in a message; of at most so many cells."""
        if message.cell not in self._cells and len(self._cells) >= CELLS_MAX:
            return
        is_new = message.cell not in self._cells
        cell = self._cells.setdefault(message.cell, WatchedCell(message.cell))
        self.runs += not message.is_past and isinstance(message.event, IterationEvent)
        self.faults += not message.is_past and isinstance(message.event, FaultEvent)
        cell.take(message)
        if is_new or cell.lacks(message):
            rows = self._memory.campaign(cell.name, *cell.named_by(message.event))
            cell.remember(rows, "")


class _View:
    """Prints messages as lines, and counts them."""

    def __init__(
        self, memory: Memory | None = None, known: Cell | None = None, *, events: bool
    ) -> None:
        self._memory = memory or Memory()
        self.runs = 0
        self.faults = 0
        self._events = events
        self._present: set[str] = set()
        self._warned: set[tuple[str, str]] = set()
        self._first: dict[str, IterationRecord] = {}
        self._units: dict[str, tuple[str, ...]] = {}
        if known is not None:
            self._units[known.name] = tuple(known.axis_units)

    def show(self, message: Message) -> None:
        event = message.event
        self.runs += not message.is_past and isinstance(event, IterationEvent)
        self.faults += not message.is_past and isinstance(event, FaultEvent)
        if message.warning is not None:
            self._warn(message)
        if self._events:
            kept = {"cell": message.cell, "topic": message.topic, **message.payload}
            typer.echo(json.dumps(kept))
        elif isinstance(event, IterationEvent):
            self._show_run(message.cell, IterationRecord.from_event(event, ""))
        elif isinstance(event, FaultEvent):
            typer.echo(f"{message.cell}: FAULT: {event.reason}")
        elif isinstance(event, LateEvent):
            more = "" if event.count == 1 else f"; {event.count} such cycles since the last line"
            typer.echo(f"{message.cell}: late: {late_sentence(event)}{more}")
        elif isinstance(event, LatencyEvent):
            late = event.wake_late_us
            typer.echo(
                f"{message.cell}: loop woke late by {late.p99:.3g} µs (99 %), "
                f"{late.max:.3g} µs at most"
            )
        elif isinstance(event, JudgedEvent):
            if event.remark:
                typer.echo(f"{message.cell}: run {event.index}: {printable(event.remark)}")
        elif isinstance(event, StartEvent):
            self._units[message.cell] = tuple(map(axis_unit, event.input_units))
            typer.echo(describe(event))
        elif isinstance(event, StateEvent):
            run = "" if event.iteration is None else f" (run {event.iteration})"
            typer.echo(f"{message.cell}: {WORDS.get(event.state, event.state)}{run}")
        elif isinstance(event, ProgressEvent) and message.cell not in self._present:
            # A late subscriber gets the progress of the run, once.
            share = 100.0 * event.sample / max(1, event.n_samples)
            typer.echo(f"{message.cell}: run {event.iteration}, {share:.0f} %")
        elif isinstance(event, EndEvent):
            why = "" if event.status == "completed" or not event.reason else f": {event.reason}"
            typer.echo(f"{message.cell}: {event.status}{why}")
        elif message.topic in {"alive", "gone"}:
            typer.echo(f"{message.cell}: controller {message.topic}")
            self._present.discard(message.cell)
        if message.topic == "state":
            self._present.add(message.cell)
        sys.stdout.flush()

    def _earlier(self, cell: str, record: IterationRecord) -> IterationRecord | None:
        """Return the first run of the campaign that this one was made in, from a library."""
        rows = (
            self._memory.campaign(cell, None, record.digest)
            if record.index and record.digest
            else []
        )
        if not any(row["digest"] == record.digest for row in rows):
            return None
        self._units.setdefault(cell, tuple(map(axis_unit, rows[0]["input_units"])))
        return IterationRecord.from_row(rows[0], "")

    def _warn(self, message: Message) -> None:
        """Report the defect of a message, once for each cell and topic."""
        whose = (message.cell, message.topic)
        if whose not in self._warned and len(self._warned) < WARNINGS_MAX:
            self._warned.add(whose)
            typer.echo(f"{message.cell}: {message.topic}: {message.warning}", err=True)

    def _show_run(self, cell: str, record: IterationRecord) -> None:
        begins = cell not in self._first or record.index == 0
        if begins:
            self._first[cell] = self._earlier(cell, record) or record
        first = self._first[cell]
        comparison = Comparison((first, record), self._units.get(cell, ()))
        names = headings(comparison)
        if begins:
            typer.echo(" " * len(cell) + "  " + plain_line(names, names))
        typer.echo(f"{cell}  {plain_line(run_cells(comparison, record), names)}")
        if record.remark:
            typer.echo(f"{' ' * len(cell)}       {printable(record.remark)}")

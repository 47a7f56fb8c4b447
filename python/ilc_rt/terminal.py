"""Views of watched cells in a terminal of any width; a sign or a word beside every colour.

Imported by the programs that show a campaign: `ilc run`, `ilc demo` and `ilc monitor`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from ilc_rt.quantity import signed, unit_for
from ilc_rt.table import NARROW, runs_table
from ilc_rt.text import printable
from ilc_rt.watched_axis import drive_words
from ilc_rt.wording import describe, state_words

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult

    from ilc_rt.watched import WatchedCell
    from ilc_rt.watched_axis import WatchedAxis
    from ilc_rt.watched_note import Note

BAR_MAX = 50
SPARK_MAX = 40
#: Lines of notes, and of a table of runs that is shortened.
NOTES_SHOWN = 6
RUNS_MIN = 3
NAME_SHOWN = 12
LEVELS, LEVELS_ASCII = "▁▂▃▄▅▆▇█", "_.-=+*#@"
BAR, BAR_ASCII = ("█", "░"), ("#", "-")
STYLES = {"fault": "bold red", "warning": "yellow", "note": "dim"}
SIGNS = {"fault": "FAULT: ", "warning": "! ", "note": "note: "}
AXIS_WORDS = {
    "bringing_up": "starting",
    "homing": "homing",
    "enabling": "enabling",
    "returning": "returning",
    "settling": "settling",
    "waiting": "waiting",
    "running": "following",
    "paused": "held",
    "stopping": "stopping",
    "stopped": "at rest",
}

INPUT_WORDS = {None: "unknown", True: "on", False: "off"}


def spark(values: Sequence[float], width: int, *, ascii_only: bool = False) -> str:
    """Return the newest values as a line of bars on a logarithmic scale.

    Examples
    --------
    >>> spark([1e-3, 1e-4, 1e-5], 10), spark([], 10), spark([1.0, 0.0], 10)
    ('█▅▁', '', '▁▁')
    """
    levels = LEVELS_ASCII if ascii_only else LEVELS
    shown = list(values)[-width:]
    logs = [math.log10(value) for value in shown if value > 0.0]
    low = min(logs, default=0.0)
    span = max(logs, default=0.0) - low
    return "".join(
        levels[round((math.log10(value) - low) / span * (len(levels) - 1))]
        if value > 0.0 and span > 0.0
        else levels[0]
        for value in shown
    )


def bar(share: float, width: int, *, ascii_only: bool = False) -> str:
    """Return a share as a bar with its percentage.

    Examples
    --------
    >>> bar(0.5, 4)
    '██░░  50 %'
    """
    full, empty = BAR_ASCII if ascii_only else BAR
    n_full = math.floor(share * width)
    return f"{full * n_full}{empty * (width - n_full)} {share * 100.0:3.0f} %"


def duration(seconds: float) -> str:
    """Return a duration as minutes and seconds.

    Examples
    --------
    >>> duration(83.2), duration(7384.0)
    ('1:24', '2:03:04')
    """
    whole = math.ceil(seconds)
    minutes, rest = divmod(whole, 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def headline(cell: WatchedCell) -> str:
    """Return what a cell does now, in words: "run 3 (4 of 10): running"."""
    if cell.end is not None:
        return cell.end.status
    if cell.state is None and cell.records:
        return f"run {cell.records[-1].index} is over"
    if cell.state is None:
        return {True: "present", False: "gone", None: "nothing heard yet"}[cell.is_present]
    said = state_words(cell.state)
    if cell.is_present is False:
        return f"gone; the last state was: {said}"
    index, n_runs = cell.iteration, cell.n_runs
    if index is None or (n_runs is not None and index >= n_runs):
        return said  # the return after the last run
    return f"run {index}{f' ({index + 1} of {n_runs})' if n_runs else ''}: {said}"


class CellView:
    """One cell: progress, axes, errors of the runs, loop and notes.

    Parameters
    ----------
    cell : WatchedCell
        What is shown; read at each drawing.
    brief : bool
        Show the heading, the progress, the error and the newest note only.
    height : int or None
        Lines that the table of runs may fill up to; None for those of the terminal.
    """

    def __init__(
        self, cell: WatchedCell, *, brief: bool = False, height: int | None = None
    ) -> None:
        self._cell, self._brief, self._height = cell, brief, height

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw at the width of the terminal."""
        width = options.max_width
        ascii_only = options.ascii_only
        above: list[RenderableType] = [
            *self._heading(width), *self._progress(width, ascii_only=ascii_only),
            *self._notes(self._cell.notes), *self._error(width, ascii_only=ascii_only),
        ]  # fmt: skip
        if not self._brief:
            above += [*self._axes(width, ascii_only=ascii_only), *self._loop()]
        yield from above
        if not self._brief and self._cell.comparison is not None:
            used = sum(len(console.render_lines(part, options)) for part in above)
            # Heading of the table and its rules; a last line of the terminal stays free.
            free = (self._height or console.size.height) - used - 6
            yield runs_table(self._cell.comparison, newest=max(RUNS_MIN, free), width=width)

    def _heading(self, width: int) -> Iterable[RenderableType]:
        cell = self._cell
        line = Text()
        line.append(printable(cell.name), style="bold")
        line.append("  ")
        line.append(headline(cell), style="bold red" if cell.n_faults else "")
        left_s = cell.left_s
        if left_s is not None:
            line.append(f", {duration(left_s)} left")
        yield line
        if cell.start is not None and width >= NARROW and not self._brief:
            told = describe(cell.start).partition(": ")[2]
            yield Text(told, style="dim", no_wrap=True, overflow="ellipsis")

    def _progress(self, width: int, *, ascii_only: bool) -> Iterable[RenderableType]:
        cell = self._cell
        length = min(BAR_MAX, width - 16)
        if cell.end is None and cell.state is not None and length > 0:
            yield Text(
                f"run       {bar(cell.progress or 0.0, length, ascii_only=ascii_only)}"[:width]
            )
        if cell.done is not None and length > 0:
            yield Text(f"campaign  {bar(cell.done, length, ascii_only=ascii_only)}"[:width])

    def _error(self, width: int, *, ascii_only: bool) -> Iterable[RenderableType]:
        comparison = self._cell.comparison
        if comparison is None:
            return
        first, last = comparison.first, comparison.learned[-1]
        errors = [comparison.compared(record) for record in comparison.learned]
        unit = unit_for(self._base(), max(errors))
        what = "contour" if comparison.by_contour else "tracking"
        course = " to ".join(
            unit.number(error) for error in (errors if len(errors) < 3 else (errors[0], errors[-1]))
        )
        change = signed(comparison.compared(first), comparison.compared(last))
        said = f"{course} {unit.symbol}" + (f" ({change})" if change and first is not last else "")
        drawn = spark(errors, min(SPARK_MAX, max(8, width - 10)), ascii_only=ascii_only)
        yield Text.assemble(
            "error     ", (drawn, "cyan"), f"  {what}, log" if width >= NARROW else ""
        )
        yield Text(f"          {said}")

    def _axes(self, width: int, *, ascii_only: bool) -> Iterable[RenderableType]:
        cell = self._cell
        if not cell.axes:
            return
        wide = width >= NARROW
        is_live = any(axis.trail_m or axis.error_m is not None for axis in cell.axes)
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
        for heading in ("axis", "state"):
            table.add_column(heading, no_wrap=True)
        if wide:
            table.add_column("set point", justify="right", no_wrap=True)
        table.add_column("error now" if is_live else "", justify="right", no_wrap=True)
        if wide:
            table.add_column("max last run", justify="right", no_wrap=True)
            table.add_column("error over time, log" if is_live else "", no_wrap=True)
        last = cell.records[-1].axes_tracking_inf_m if cell.records else ()
        for index, axis in enumerate(cell.axes):
            now = "" if axis.error_m is None else _quantity(axis.unit, abs(axis.error_m))
            cells = [printable(axis.name, NAME_SHOWN), self._state_of(axis)]
            if wide:
                cells.append(_quantity(axis.unit, axis.reference_m))
            cells.append(now)
            if wide:
                cells.append(_quantity(axis.unit, last[index] if index < len(last) else None))
                cells.append(spark(axis.trail_m, min(24, width - 56), ascii_only=ascii_only))
            table.add_row(*map(Text, cells), style="red" if axis.is_faulty else "")
        yield table

    def _state_of(self, axis: WatchedAxis) -> str:
        if axis.is_faulty:
            return "FAULT"
        if self._cell.end is not None:
            return "at rest"
        if axis.reference_m is not None and axis.error_m is None:
            return "not measured"
        return AXIS_WORDS.get(self._cell.state or "", "")

    def _loop(self) -> Iterable[RenderableType]:
        cell = self._cell
        parts = []
        if cell.records:
            overruns = sum(record.overruns for record in cell.records)
            parts.append(f"{overruns} overrun{'' if overruns == 1 else 's'}")
            missing = sum(record.missing_samples for record in cell.records)
            parts += [f"{missing} samples missing"] if missing else []
        parts += [f"{cell.n_late} late cycles"] if cell.n_late else []
        if cell.latency is not None:
            late = cell.latency.wake_late_us
            parts.append(f"woke late by {late.p99:.3g} µs (99 %), {late.max:.3g} µs at most")
        if parts:
            yield Text(f"loop      {', '.join(parts)}")
        if any(axis.drive for axis in cell.axes):
            yield Text(f"drives    {drive_words(cell.axes)}")
        if cell.inputs:
            told = (f"{printable(one.name)} {INPUT_WORDS[one.on]}" for one in cell.inputs)
            yield Text(f"inputs    {', '.join(told)}")

    def _notes(self, notes: Iterable[Note]) -> Iterable[RenderableType]:
        faults = [note for note in notes if note.kind == "fault"][-NOTES_SHOWN:]
        others = [note for note in notes if note.kind != "fault"][-NOTES_SHOWN:]
        # A fault is not pushed out by what follows it.
        for note in (faults or others)[-1:] if self._brief else (*faults, *others):
            yield Text(f"{SIGNS[note.kind]}{note.text}", style=STYLES[note.kind])

    def _base(self) -> str:
        cell = self._cell
        return "rad" if cell.units and set(cell.units) == {"rad"} else "m"


class CellsView:
    """All cells that are heard: one in full, several briefly below each other."""

    def __init__(self, cells: Sequence[WatchedCell], *, height: int | None = None) -> None:
        self._cells, self._height = cells, height

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw at the width of the terminal."""
        if not self._cells:
            yield Text("waiting for a controller; Ctrl-C ends this, not the machine")
        for place, cell in enumerate(self._cells):
            if place:
                yield Rule(characters="-" if options.ascii_only else "─", style="dim")
            yield CellView(cell, brief=len(self._cells) > 1, height=self._height)


def _quantity(base: str, value: float | None) -> str:
    return "" if value is None else unit_for(base, value).text(value)

"""The page of one cell: what it does, its errors, its live signals, its timing."""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING, Any

import numpy as np
from nicegui import ui

from ilc_rt.comparison import note
from ilc_rt.dashboard import charts
from ilc_rt.dashboard.cell_tables import AxisTable, Log, Timing
from ilc_rt.dashboard.frame import (
    call,
    chart,
    draw,
    every,
    fact,
    level,
    page_frame,
    panel,
    say,
    tag,
    text,
)
from ilc_rt.dashboard.model import SIGNALS
from ilc_rt.dashboard.overview import error_words
from ilc_rt.dashboard.status import run_words
from ilc_rt.terminal import duration
from ilc_rt.text import printable

if TYPE_CHECKING:
    from nicegui import Client

    from ilc_rt.dashboard.archive import Archive
    from ilc_rt.dashboard.capture import Capture
    from ilc_rt.dashboard.fleet import Fleet
    from ilc_rt.dashboard.model import CellModel

#: 20 updates a second of the signals; texts are read by people.
LIVE_S = 0.05
REFRESH_S = 0.2
LIVE = {
    "error": "Tracking error, live",
    "reference": "Set points, live",
    "input": "Learned input, live",
}


def build_cell(fleet: Fleet, archive: Archive, name: str) -> None:
    """Build the page of a cell."""
    with page_frame(f"/cell/{name}", printable(name, 64)):
        if name not in fleet.cells:
            with tag("h1", "unseen"):
                text(printable(name))
            with tag("p", "empty"):
                text(f"No cell {printable(name)} is watched; this page waits for it.")
            ui.timer(1.0, lambda: _reload_if(name in fleet.cells))
            return
        view = CellView(fleet, archive, fleet.cells[name], ui.context.client)
    every(LIVE_S, view.push)
    every(REFRESH_S, view.refresh)


class CellView:
    """A cell in one browser."""

    def __init__(self, fleet: Fleet, archive: Archive, cell: CellModel, client: Client) -> None:
        self._fleet, self._archive, self._cell, self._client = fleet, archive, cell, client
        self._epoch = self._mark = -1
        self._live_frame: tuple[Any, ...] = ()
        self._version = self._runs_version = -1
        self._drawn: object = None
        self._factor = 0
        self._head()
        with tag("div", "grid"):
            self._build()

    def push(self) -> bool:
        """Send the newest points of the signals, and return if there were any."""
        cell = self._cell
        with self._fleet.lock:
            window, epoch = cell.window, cell.epoch
            if window is None:
                return False
            if epoch != self._epoch:
                self._epoch, self._mark = epoch, 0
            first, low, high = window.since(self._mark)
            if not len(low):
                return False
            self._mark = first + len(low)
            parts = self._parts(*window.since(0)[1:])
            seconds = window.span * (cell.cycle_s or 0.0)
        call(
            self._client,
            "live",
            {
                "epoch": epoch, "first": first, "seconds": seconds, "length": window.n_buckets,
                "low": _rows(low), "high": _rows(high), "charts": parts,
            },
        )  # fmt: skip
        return True

    async def refresh(self) -> None:
        """Show texts and tables again, and the charts if their data has changed."""
        with self._fleet.lock:
            cell = self._cell
            now_s = time.monotonic()
            self._show_head(now_s)
            self._axes.show(cell, now_s)
            self._draw_live_frames()
            if cell.version == self._version:
                return
            self._version = cell.version
            self._log.show(cell)
            self._timing.show(cell, self._client)
            if cell.runs_version != self._runs_version:
                self._runs_version = cell.runs_version
                draw(self._client, "runs", charts.runs(cell))
            last = cell.last
            stored = last.index if last is not None else None
            captured = cell.last_run
        await self._draw_run(captured, stored)

    def _parts(self, low: np.ndarray, high: np.ndarray) -> dict[str, Any]:
        """Return where each chart finds its columns, and in which units it shows them."""
        cell = self._cell
        n = cell.n_axes
        with np.errstate(invalid="ignore"):
            largest = np.fmax(np.abs(low), np.abs(high))
            largest = np.fmax.reduce(largest, axis=0, initial=0.0).tolist()
        parts = {}
        for number, what in enumerate(SIGNALS):
            units = charts.live_units(cell, what, largest[number * n : (number + 1) * n])
            parts[f"live-{what}"] = {
                "from": number * n,
                "scales": [unit.scale for unit in units],
                "units": [unit.symbol for unit in units],
            }
        return parts

    def _draw_live_frames(self) -> None:
        cell = self._cell
        described = (cell.axis_names, cell.units, cell.input_units)
        if described != self._live_frame:
            self._live_frame = described
            for what in SIGNALS:
                draw(self._client, f"live-{what}", charts.live(cell, what))

    async def _draw_run(self, captured: Capture | None, index: int | None) -> None:
        """Draw contour and inputs of the last run: as it was heard, else from a library."""
        cell = self._cell
        wanted = (captured, index, self._factor)
        if wanted == self._drawn:
            return
        self._drawn = wanted
        shown = captured
        if captured is None or (index is not None and captured.iteration < index):
            shown = (
                await asyncio.to_thread(self._archive.capture, cell.name, cell.campaign) or captured
            )
        option, factor = await asyncio.to_thread(charts.contour, cell, shown, self._factor)
        inputs = await asyncio.to_thread(charts.inputs, cell, shown)
        if wanted != self._drawn:
            # A later run was drawn meanwhile.
            return
        draw(self._client, "contour", option)
        draw(self._client, "inputs", inputs)
        whose = "" if shown is None else f"run {shown.iteration}"
        say(
            self._contour_run,
            f"{whose}, deviation {charts.TIMES} {factor}" if option["series"] else whose,
        )
        say(self._inputs_run, whose)

    def _head(self) -> None:
        with tag("section", "panel full", aria_label="State") as self._panel:
            self._panel.style("margin-bottom: 12px")
            with tag("div", "head"):
                with tag("h1"):
                    text(printable(self._cell.name))
                self._state = text("", "state", "state")
                # A screen reader hears what has changed, not every second of a silence.
                self._spoken = text("", "unseen", "spoken")
                self._spoken.props["role"] = "status"
                self._task = text("", "quiet end", "task")
            with tag("div", "facts"):
                self._run = fact("run", "run")
                self._left = fact("time left", "left")
                self._error = fact("error of the last run", "error")
                self._change = fact("since the first", "change")
                self._learning = fact("learning", "learning")
                self._overruns = fact("overruns", "overruns")
                self._late = fact("late cycles", "late")
                self._inputs = fact("inputs", "inputs")
            with tag("div", "meter"):
                self._meter = tag("div")
        self._alarm = text("", "alarm level-fault", "alarm")
        self._alarm.props["role"] = "alert"
        self._alarm.set_visibility(False)

    def _build(self) -> None:
        with panel("Error of each run", "wide"):
            chart("runs", "Tracking and contour error of each run, on a logarithmic scale", "tall")
        with panel("Contour of the last run") as head:
            self._contour_run = text("", "quiet", "contour-run")
            with head:
                self._magnifier()
            chart("contour", "Programmed path and made path with its deviation magnified", "tall")
        for what, title in LIVE.items():
            with panel(title):
                chart(f"live-{what}", f"{title}: every axis over the last ten seconds")
        with panel("Axes", "wide"):
            self._axes = AxisTable()
        with panel("Log"):
            self._log = Log()
        with panel("Learned input of the last run", "half"):
            self._inputs_run = text("", "quiet")
            chart("inputs", "Learned input of each axis over the time of the last run")
        with panel("Timing of the loop", "half"):
            self._timing = Timing()

    def _magnifier(self) -> None:
        with tag("div", "controls end"):
            with tag("label"):
                text("deviation")
            select = tag("select", aria_label="Magnification of the deviation")
            with select:
                for factor in charts.FACTORS:
                    with tag("option", value=str(factor)):
                        text(f"{charts.TIMES} {factor}" if factor else "suitable")

            def choose(event: Any) -> None:  # noqa: ANN401 (of NiceGUI)
                chosen = str(event.args)
                self._factor = int(chosen) if chosen.isdecimal() else 0
                self._version = -1

            select.on("change", choose, js_handler="(e) => emit(e.target.value)")

    def _show_head(self, now_s: float) -> None:
        cell = self._cell
        status = cell.status(now_s)
        say(self._state, f"{status.symbol} {status.words}")
        say(self._spoken, status.words.partition(" since ")[0])
        level(self._panel, status.level)
        say(self._task, _task(cell))
        say(self._run, run_words(cell))
        left_s = cell.left_s
        say(self._left, "-" if left_s is None else duration(left_s))
        error, change = error_words(cell)
        say(self._error, error)
        say(self._change, change)
        say(self._learning, _learning(cell))
        say(self._overruns, str(cell.overruns))
        say(self._late, str(cell.n_late))
        say(self._inputs, ", ".join(map(_input, cell.inputs)) or "none")
        self._meter.style(f"width: {100.0 * (cell.progress or 0.0):.0f}%")
        fault = "" if cell.fault is None else f"✕ Fault: {printable(cell.fault.reason)}"
        decision = cell.decision
        if not fault and decision is not None and decision is cell.last:
            fault = f"▲ {note(decision)}: {printable(decision.remark or 'the error grew')}"
        level(self._alarm, "fault" if cell.fault is not None else "warn")
        say(self._alarm, fault)
        self._alarm.set_visibility(bool(fault))


def _reload_if(is_there: bool) -> None:  # noqa: FBT001
    if is_there:
        ui.navigate.reload()


def _task(cell: CellModel) -> str:
    start = cell.start
    parts = [cell.law or "", f"measured at the {cell.measure}" if cell.measure else ""]
    if cell.cycle_s:
        parts.append(f"{cell.cycle_s * 1e3:g} ms cycle")
    if start is not None:
        parts += [start.bus, "real time" if start.mode == "realtime" else "lock-step"]
    parts.append(f"campaign {cell.campaign}" if cell.campaign else "")
    return printable(", ".join(part for part in parts if part))


def _learning(cell: CellModel) -> str:
    last = cell.last
    if cell.law in {"none", "frozen"}:
        return {"none": "nothing is learned", "frozen": "frozen input"}[cell.law]
    if last is None:
        return "-"
    if last.learning_off:
        return "learning is off"
    n_back = sum(run.rolled_back for run in cell.records)
    return "on" if not n_back else f"on, {n_back} rolled back"


def _input(state: Any) -> str:  # noqa: ANN401 (InputState)
    return f"{printable(state.name)} {({True: 'on', False: 'off'}).get(state.on, 'unknown')}"


def _rows(values: np.ndarray) -> list[list[float | None]]:
    return [
        [None if value != value else value for value in row]
        for row in np.round(values, 10).tolist()
    ]

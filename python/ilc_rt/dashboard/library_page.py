"""The page of the libraries: runs of all campaigns, compared on one cursor; notes."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from nicegui import ui

from ilc_rt.comparison import note
from ilc_rt.dashboard import charts
from ilc_rt.dashboard.archive import distance, relevance
from ilc_rt.dashboard.frame import chart, draw, page_frame, panel, say, tag, text
from ilc_rt.dashboard.notes import name_of, read_notes, write_note
from ilc_rt.errors import BadInputError
from ilc_rt.quantity import axis_unit, unit_for
from ilc_rt.record import IterationRecord
from ilc_rt.text import printable

if TYPE_CHECKING:
    from nicegui import Client
    from nicegui.element import Element

    from ilc_rt.dashboard.archive import Archive
    from ilc_rt.dashboard.model import Fleet

    Key = tuple[int, int]

SHOWN_MAX = 300
CHOSEN_MAX = 8
REFRESH_S = 2.0
COLUMNS = (
    "", "run", "campaign", "cell", "law", "max tracking", "max contour", "distance", "relevance",
    "outcome", "note",
)  # fmt: skip
TEXTS = ("campaign", "cell", "law", "outcome", "note")
SIGNALS = {"error": "Tracking error", "command": "Set point", "input": "Learned input"}


def build_library(fleet: Fleet, archive: Archive, *, with_notes: bool) -> None:
    """Build the page of the libraries."""
    with page_frame("/library"):
        if not archive.paths:
            with tag("p", "empty"):
                text("No library is given: ilc dashboard --library FILE shows its runs here.")
            return
        view = LibraryView(fleet, archive, ui.context.client, with_notes=with_notes)
    ui.timer(0.0, view.refresh, once=True)
    ui.timer(REFRESH_S, view.refresh)


class LibraryView:
    """The libraries in one browser: its filter and its chosen runs."""

    def __init__(self, fleet: Fleet, archive: Archive, client: Client, *, with_notes: bool) -> None:
        self._fleet, self._archive, self._client = fleet, archive, client
        self._with_notes = with_notes
        self._filter = ""
        self._axis = 0
        self._chosen: dict[Key, None] = {}
        self._rows: list[dict[str, Any]] = []
        self._notes: dict[int, dict[str, str]] = {}
        self._state: object = None
        with tag("div", "grid"):
            self._build()

    async def refresh(self) -> None:
        """Read the libraries again, and show the runs if they have changed."""
        try:
            rows = await asyncio.to_thread(self._archive.rows)
            self._notes = {n: read_notes(path) for n, path in enumerate(self._archive.paths)}
        except BadInputError as error:
            say(self._told, f"▲ {printable(error)}")
            return
        with self._fleet.lock:
            now = {name: cell.last.index for name, cell in self._fleet.cells.items() if cell.last}
        state = (len(rows), rows[-1:] and rows[-1]["digest"], now, self._notes, self._filter)
        if state != self._state:
            self._state = state
            self._rows = rows
            self._show()

    def _build(self) -> None:
        with panel("Runs", "full") as head:
            with head, tag("div", "controls end"):
                search = tag(
                    "input", type="search", placeholder="cell, campaign, law, note",
                    aria_label="Show only runs with this text",
                )  # fmt: skip
                search.on(
                    "input", self._search, js_handler="(e) => emit(e.target.value)", throttle=0.3
                )
            self._told = text("", "quiet", "told")
            with tag("div", "runs-table", tabindex="0"), tag("table", "plain-table"):
                with tag("thead"), tag("tr"):
                    for column in COLUMNS:
                        kind = "text" if column in TEXTS else ""
                        with tag("th", kind, scope="col"):
                            text(column or "compare")
                self._body = tag("tbody")
        with panel("Comparison", "full") as head:
            self._which = text("Choose runs above: they are laid over each other here.", "quiet")
            with head, tag("div", "controls end"):
                with tag("label"):
                    text("axis")
                self._axes = tag("select", aria_label="Axis that is compared")
                self._axes.on("change", self._choose_axis, js_handler="(e) => emit(e.target.value)")
            for what, title in SIGNALS.items():
                chart(f"compare-{what}", f"{title} of the chosen runs over a common time")
        with panel("Note", "full"):
            self._note_of = text("Choose one run to read or write its note.", "quiet")
            self._note = tag(
                "textarea", "note", aria_label="Note on the chosen run", maxlength=2000
            )
            self._note.set_visibility(False)
            if self._with_notes:
                self._note.on("change", self._write, js_handler="(e) => emit(e.target.value)")
            else:
                self._note.props["readonly"] = True

    def _show(self) -> None:
        wanted = [row for row in self._rows if self._matches(row)]
        newest = self._rows[-1] if self._rows else {}
        shares = dict(
            zip(map(_key, wanted), relevance(wanted, newest), strict=True) if wanted else ()
        )
        shown = wanted[-SHOWN_MAX:][::-1]
        told = f"{len(wanted)} of {len(self._rows)} runs"
        told += f", the newest {SHOWN_MAX} shown" if len(wanted) > SHOWN_MAX else ""
        say(self._told, told if self._rows else "The library has no runs yet.")
        self._body.clear()
        with self._body:
            for row in shown:
                self._line(row, newest, shares[_key(row)])

    def _line(self, row: dict[str, Any], newest: dict[str, Any], share: float) -> None:
        key = _key(row)
        record = IterationRecord.from_row(row, "")
        base = axis_unit(str(row["input_units"][0])) if row["input_units"] else "m"
        away = distance(row, newest)
        cells = (
            str(row["index"]), str(row["campaign"]), str(row["cell"]), str(row["law"]),
            unit_for(base, row["tracking_inf_m"]).text(row["tracking_inf_m"]),
            unit_for("m", row["contour_inf_m"]).text(row["contour_inf_m"]),
            "-" if away is None else f"{away:.3g}",
            f"{100.0 * share:.2g} %",
            note(record), self._note_on(row),
        )  # fmt: skip
        with tag("tr", aria_selected="true" if key in self._chosen else "false") as line:
            with tag("td"):
                box = tag("input", type="checkbox")
                box.props["aria-label"] = f"Compare run {row['index']} of {row['campaign']}"
                box.props["data-run"] = f"{key[0]}-{key[1]}"
                box.props["checked"] = key in self._chosen
                box.on(
                    "change",
                    lambda event, key=key, line=line: self._choose(key, line, bool(event.args)),
                    js_handler="(e) => emit(e.target.checked)",
                )
            for column, cell in zip(COLUMNS[1:], cells, strict=True):
                with tag("td", "text" if column in TEXTS else ""):
                    text(printable(cell, 60))

    async def _choose(self, key: Key, line: Element, chosen: bool) -> None:  # noqa: FBT001
        if chosen:
            self._chosen[key] = None
            while len(self._chosen) > CHOSEN_MAX:
                del self._chosen[next(iter(self._chosen))]
        else:
            self._chosen.pop(key, None)
        line.props["aria-selected"] = "true" if chosen else "false"
        self._show_note()
        await self._compare()

    async def _compare(self) -> None:
        try:
            runs = await asyncio.to_thread(self._archive.aligned, list(self._chosen), self._axis)
        except BadInputError as error:
            say(self._which, f"▲ {printable(error)}")
            return
        names = list(dict.fromkeys(name for one in runs for name in one.row["axis_names"]))
        self._axis = min(self._axis, max(0, len(names) - 1))
        self._axes.clear()
        with self._axes:
            for number, name in enumerate(names):
                with tag("option", value=str(number), selected=number == self._axis):
                    text(printable(name, 40))
        say(
            self._which,
            f"{len(runs)} of at most {CHOSEN_MAX} runs; one cursor for all charts, the wheel zooms"
            if runs
            else "Choose runs above: they are laid over each other here.",
        )
        for what in SIGNALS:
            draw(self._client, f"compare-{what}", charts.compared(runs, what, self._axis))

    async def _choose_axis(self, event: Any) -> None:  # noqa: ANN401 (of NiceGUI)
        chosen = str(event.args)
        self._axis = int(chosen) if chosen.isdecimal() else 0
        await self._compare()

    async def _search(self, event: Any) -> None:  # noqa: ANN401
        self._filter = str(event.args).strip().lower()[:100]
        await self.refresh()

    def _matches(self, row: dict[str, Any]) -> bool:
        where = f"{row['cell']} {row['campaign']} {row['law']} {self._note_on(row)}".lower()
        return all(word in where for word in self._filter.split())

    def _note_on(self, row: dict[str, Any]) -> str:
        return self._notes.get(row["library"], {}).get(name_of(row), "")

    def _one(self) -> dict[str, Any] | None:
        """Return the run whose note is shown: the one that was chosen last."""
        key = next(reversed(self._chosen), None)
        return next((row for row in self._rows if _key(row) == key), None)

    def _show_note(self) -> None:
        row = self._one()
        self._note.set_visibility(row is not None)
        if row is None:
            say(self._note_of, "Choose one run to read or write its note.")
            return
        where = "" if self._with_notes else "; notes are written on the computer of the dashboard"
        say(self._note_of, f"Run {row['index']} of campaign {row['campaign']}{where}")
        self._note.props["value"] = self._note_on(row)

    async def _write(self, event: Any) -> None:  # noqa: ANN401
        row = self._one()
        if row is None or not self._with_notes:
            return
        try:
            await asyncio.to_thread(
                write_note, self._archive.paths[row["library"]], name_of(row), str(event.args)
            )
        except BadInputError as error:
            say(self._note_of, f"▲ {printable(error)}")
            return
        say(self._note_of, f"Run {row['index']} of campaign {row['campaign']}: note kept")
        await self.refresh()


def _key(row: dict[str, Any]) -> Key:
    return int(row["library"]), int(row["id"])

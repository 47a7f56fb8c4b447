"""The page of the libraries: runs of all campaigns, compared on one cursor; notes."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from nicegui import ui

from ilc_rt.dashboard import charts
from ilc_rt.dashboard.archive import distance, relevance
from ilc_rt.dashboard.frame import chart, draw, every, page_frame, panel, say, tag, text
from ilc_rt.dashboard.library_table import RunLine, key_of, runs_table
from ilc_rt.dashboard.notes import name_of, read_notes, write_note
from ilc_rt.errors import BadInputError
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from nicegui import Client

    from ilc_rt.dashboard.archive import Archive
    from ilc_rt.dashboard.fleet import Fleet
    from ilc_rt.dashboard.library_table import Key

SHOWN_MAX = 300
CHOSEN_MAX = 8
REFRESH_S = 2.0
NOTHING_CHOSEN = "Choose runs above: they are laid over each other here."
HINT = "one cursor for all charts; wheel or two fingers zoom"
SIGNALS = {"error": "Tracking error", "command": "Set point", "input": "Learned input"}


def build_library(fleet: Fleet, archive: Archive, *, with_notes: bool) -> None:
    """Build the page of the libraries."""
    with page_frame("/library"):
        if not archive.sources:
            with tag("p", "empty"):
                text(
                    "No library is given: ilc dashboard --library FILE shows its runs here."
                    " FILE may be postgresql://USER@HOST/NAME."
                )
            return
        view = LibraryView(fleet, archive, ui.context.client, with_notes=with_notes)
    ui.timer(0.0, view.refresh, once=True)
    every(REFRESH_S, view.refresh)


class LibraryView:
    """The libraries in one browser: its filter and its chosen runs."""

    def __init__(self, fleet: Fleet, archive: Archive, client: Client, *, with_notes: bool) -> None:
        self._fleet, self._archive, self._client = fleet, archive, client
        self._with_notes = with_notes
        self._filter = ""
        self._axis = 0
        self._chosen: dict[Key, None] = {}
        self._n_comparisons = 0
        self._rows: list[dict[str, Any]] = []
        self._notes: dict[int, dict[str, str]] = {}
        self._state: object = None
        self._lines: dict[Key, RunLine] = {}
        with tag("div", "grid"):
            self._build()

    async def refresh(self) -> None:
        """Read the libraries again, and show the runs if they have changed."""
        try:
            rows = await asyncio.to_thread(self._archive.rows)
            self._notes = {
                number: read_notes(one.path)
                for number, one in enumerate(self._archive.sources)
                if one.path is not None
            }
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
            await self._forget_deleted()

    async def _forget_deleted(self) -> None:
        """Choose no longer what was deleted meanwhile, as by `ilc library trim`."""
        there = {key_of(row) for row in self._rows}
        gone = [key for key in self._chosen if key not in there]
        if not gone:
            return
        for key in gone:
            del self._chosen[key]
        self._show_note()
        n_gone = f"{len(gone)} chosen run{'' if len(gone) == 1 else 's'}"
        await self._compare([f"{n_gone} deleted meanwhile"])

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
            self._told = text("The libraries are being read …", "quiet", "told")
            self._told.props["role"] = "status"
            self._body = runs_table()
        with panel("Comparison", "full") as head:
            self._which = text(NOTHING_CHOSEN, "quiet", "compared")
            with head, tag("div", "controls end"):
                with tag("label"):
                    text("axis")
                self._axes = tag("select", aria_label="Axis that is compared")
                self._axes.on("change", self._choose_axis, js_handler="(e) => emit(e.target.value)")
            for what, title in SIGNALS.items():
                with tag("h3", "quiet"):
                    text(title)
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
        """Show the wanted runs, newest first; lines that are there stay: no click is lost."""
        wanted = sorted((row for row in self._rows if self._matches(row)), key=_made)
        newest = max(self._rows, key=_made, default={})
        shares = relevance(wanted, newest)
        told = f"{len(wanted)} of {len(self._rows)} runs"
        told += f", the newest {SHOWN_MAX} shown" if len(wanted) > SHOWN_MAX else ""
        say(self._told, told if self._rows else "The library has no runs yet.")
        shown = {key_of(row): (row, share) for row, share in zip(wanted, shares, strict=True)}
        shown = dict(list(shown.items())[-SHOWN_MAX:])
        for key in [key for key in self._lines if key not in shown]:
            self._lines.pop(key).line.delete()
        for place, (key, (row, share)) in enumerate(reversed(shown.items())):
            if key not in self._lines:
                with self._body:
                    self._lines[key] = RunLine(row, self._choose, key, chosen=key in self._chosen)
                self._lines[key].line.move(self._body, target_index=place)
            self._lines[key].show(distance(row, newest), share, self._note_on(row))

    async def _choose(self, key: Key, *, chosen: bool) -> None:
        before = list(self._chosen)
        self._chosen.pop(key, None)
        if chosen:
            self._chosen[key] = None
            while len(self._chosen) > CHOSEN_MAX:
                del self._chosen[next(iter(self._chosen))]
        for changed in {*before, key}:
            if changed in self._lines:
                self._lines[changed].mark(chosen=changed in self._chosen)
        self._show_note()
        await self._compare()

    async def _compare(self, said: Sequence[str] = ()) -> None:
        """Draw the chosen runs that can be read, and tell the others after `said`."""
        self._n_comparisons += 1
        number = self._n_comparisons
        keys, lost = await asyncio.to_thread(self._readable)
        runs = await asyncio.to_thread(self._archive.aligned, keys, self._axis)
        if number != self._n_comparisons:
            # Another run was chosen meanwhile: what is read last need not be what was chosen last.
            return
        names = list(dict.fromkeys(name for one in runs for name in one.row["axis_names"]))
        self._axis = min(self._axis, max(0, len(names) - 1))
        self._axes.clear()
        with self._axes:
            for number, name in enumerate(names):
                with tag("option", value=str(number), selected=number == self._axis):
                    text(printable(name, 40))
        warnings = [f"▲ {printable(one)}. " for one in (*said, *lost)]
        count = f"{len(runs)} of at most {CHOSEN_MAX} runs; {HINT}"
        say(self._which, "".join(warnings) + (count if runs else NOTHING_CHOSEN))
        for what in SIGNALS:
            draw(self._client, f"compare-{what}", charts.compared(runs, what, self._axis))

    def _readable(self) -> tuple[list[Key], list[str]]:
        """Return the chosen runs that can be read, and why the others cannot."""
        whys = {key: self._archive.why_not(key) for key in list(self._chosen)}
        return [key for key, why in whys.items() if why is None], [*filter(None, whys.values())]

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

    def _notes_path(self, row: dict[str, Any]) -> Path | None:
        return self._archive.sources[int(row["library"])].path

    def _note_on(self, row: dict[str, Any]) -> str:
        return self._notes.get(row["library"], {}).get(name_of(row), "")

    def _one(self) -> dict[str, Any] | None:
        """Return the run whose note is shown: the one that was chosen last."""
        key = next(reversed(self._chosen), None)
        return next((row for row in self._rows if key_of(row) == key), None)

    def _show_note(self) -> None:
        row = self._one()
        self._note.set_visibility(row is not None)
        if row is None:
            say(self._note_of, "Choose one run to read or write its note.")
            return
        where = "" if self._with_notes else "; notes are written on the computer of the dashboard"
        if self._notes_path(row) is None:
            where = "; notes belong to library files, and this run is read from a database"
            self._note.set_visibility(False)
        say(self._note_of, f"Run {row['index']} of campaign {row['campaign']}{where}")
        self._note.props["value"] = self._note_on(row)

    async def _write(self, event: Any) -> None:  # noqa: ANN401
        row = self._one()
        path = None if row is None else self._notes_path(row)
        if row is None or path is None or not self._with_notes:
            return
        try:
            await asyncio.to_thread(write_note, path, name_of(row), str(event.args))
        except BadInputError as error:
            say(self._note_of, f"▲ {printable(error)}")
            return
        say(self._note_of, f"Run {row['index']} of campaign {row['campaign']}: note kept")
        await self.refresh()


def _made(row: dict[str, Any]) -> tuple[str, int]:
    return str(row["created_utc"]), int(row["id"])

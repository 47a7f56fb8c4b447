"""Tables of the page of a cell: axes, log, timing."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from ilc_rt.dashboard import charts
from ilc_rt.dashboard.frame import chart, draw, level, say, tag, text
from ilc_rt.dashboard.status import SYMBOLS, axis_words
from ilc_rt.lateness import late_sentence
from ilc_rt.quantity import digits, unit_for
from ilc_rt.text import printable

if TYPE_CHECKING:
    from nicegui import Client, ui

    from ilc_rt.dashboard.model import CellModel

COLUMNS = (
    "axis", "state", "drive", "set point", "position", "error", "learned input",
    "max error of the run", "RMS error of the run",
)  # fmt: skip
#: Columns of words; the others have numbers.
WORDS = {"state", "drive"}
SIGNS = {"info": "·", "warn": SYMBOLS["warn"], "fault": SYMBOLS["fault"]}
#: Levels of the kinds of notes.
LEVELS = {"fault": "fault", "warning": "warn", "note": "info", "log": "info"}
LOG_SHOWN = 40


class AxisTable:
    """State and figures of each axis."""

    def __init__(self) -> None:
        place = tag("div", "scroll", tabindex="0", role="region", aria_label="Figures of the axes")
        with place, tag("table", "plain-table"):
            with tag("thead"), tag("tr"):
                for column in COLUMNS:
                    with tag("th", "text" if column in WORDS else "", scope="col"):
                        text(column)
            self._body = tag("tbody")
        self._names: tuple[str, ...] = ()
        self._rows: list[list[ui.label]] = []

    def show(self, cell: CellModel, now_s: float) -> None:
        """Show the present figures."""
        if cell.axis_names != self._names:
            self._make(cell.axis_names)
        last = cell.last
        for axis, row in enumerate(self._rows):
            status = axis_words(cell, axis, now_s)
            say(row[1], f"{status.symbol} {status.words}")
            level(row[1], status.level)
            base = cell.units[axis]
            now = cell.axes[axis]
            say(row[2], printable(now.drive or "-"))
            for column, value in ((3, now.reference_m), (4, now.measured_m)):
                say(row[column], _steady(value, base))
            say(row[5], _small(now.error_m, base))
            say(row[6], _small(now.input, cell.input_units[axis]))
            for column, name in ((7, "axes_tracking_inf_m"), (8, "axes_tracking_rms_m")):
                figures = getattr(last, name, ())
                value = figures[axis] if axis < len(figures) else None
                say(row[column], unit_for(base, value).text(value))

    def _make(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._body.clear()
        self._rows = []
        with self._body:
            for name in names:
                with tag("tr", data_axis=name):
                    labels = []
                    for column in COLUMNS:
                        with tag("td", "text" if column in WORDS else ""):
                            classes = "level-mark" if column == "state" else ""
                            labels.append(text("-", classes, column.replace(" ", "-")))
                    labels[0].set_text(name)
                    self._rows.append(labels)


class Log:
    """Events of a cell, newest first."""

    def __init__(self) -> None:
        self._list = tag("ul", "log", aria_label="Events, newest first", tabindex="0")
        self._shown: object = None

    def show(self, cell: CellModel) -> None:
        """Show the newest notes, if there are new ones."""
        notes = list(cell.log)[-LOG_SHOWN:][::-1]
        if notes == self._shown:
            return
        self._shown = notes
        self._list.clear()
        with self._list:
            if not notes:
                with tag("li"):
                    text("")
                    text("")
                    text("nothing yet", "quiet")
            for note in notes:
                shown = LEVELS[note.kind]
                with tag("li"):
                    text(time.strftime("%H:%M:%S", time.localtime(note.at_s)), "quiet")
                    text(SIGNS[shown], f"level-mark level-{shown}")
                    text(note.text)


class Timing:
    """Timing of the loop, and the worst cycle with its cause."""

    def __init__(self) -> None:
        self._words = text("", "", "timing")
        self._place = chart("timing", "Histograms of wake-up and execution time", "low")
        self._cause = text("", "", "cause")
        self._late = chart("late-cycle", "Stages of the worst cycle beside usual ones", "low")

    def show(self, cell: CellModel, client: Client) -> None:
        """Show what the loop has reported."""
        if not cell.timing:
            say(self._words, "Times of the loop come at the end of a campaign in real time.")
        else:
            parts = [
                f"{name} {digits(one.p50)} µs (median), {digits(one.p99)} (99 %), "
                f"{digits(one.max)} at most"
                for name, one in cell.timing.items()
            ]
            say(self._words, "; ".join(parts))
            draw(client, "timing", charts.timing(cell))
        self._place.set_visibility(bool(cell.timing))
        say(
            self._cause,
            "No cycle was late."
            if cell.late is None
            else f"Worst cycle ({cell.late.tick}): {late_sentence(cell.late)}",
        )
        self._late.set_visibility(cell.late is not None)
        if cell.late is not None:
            draw(client, "late-cycle", charts.late_cycle(cell))


def _steady(value: float | None, base: str) -> str:
    """Return a position in a unit that does not change as it moves."""
    if value is None:
        return "-"
    return f"{_plain(1e3 * value, 3)} m{base}" if base in {"m", "rad"} else f"{value:.4g} {base}"


def _small(value: float | None, base: str) -> str:
    """Return an error or an input in millionths, which change in size as they move."""
    if value is None:
        return "-"
    is_motion = base.startswith(("m", "r"))
    return f"{_plain(1e6 * value, 1)} µ{base}" if is_motion else f"{value:.4g} {base}"


def _plain(value: float, digits: int) -> str:
    """Return a number with fixed digits; zero has no sign.

    Examples
    --------
    >>> _plain(-0.04, 1), _plain(-0.05001, 1), _plain(2.0, 3)
    ('0.0', '-0.1', '2.000')
    """
    return f"{round(value, digits) + 0.0:.{digits}f}"

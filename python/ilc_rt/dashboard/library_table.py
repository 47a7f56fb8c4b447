"""Table of the stored runs on the page of the libraries, one line per run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ilc_rt.comparison import note
from ilc_rt.dashboard.frame import say, tag, text
from ilc_rt.quantity import axis_unit, unit_for
from ilc_rt.record import IterationRecord
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Mapping

    from nicegui.element import Element

    Key = tuple[int, int]

#: In the order in which they are wanted: a phone shows the first ones.
COLUMNS = (
    "campaign", "run", "max tracking", "max contour", "outcome", "cell", "law", "distance",
    "relevance", "note", "made (UTC)",
)  # fmt: skip
TEXTS = ("campaign", "cell", "law", "outcome", "note", "made (UTC)")
MEANINGS = {
    "distance": "Distance to the newest run in the measured disturbances",
    "relevance": "Share of the run in what a law that weighs earlier runs would take",
}
NOTE_SHOWN = 60


def key_of(row: Mapping[str, Any]) -> Key:
    """Return the number of the library of a run, and its key there."""
    return int(row["library"]), int(row["id"])


def runs_table() -> Element:
    """Build the table without lines, and return its body."""
    place = tag("div", "runs-table", tabindex="0", role="region", aria_label="Stored runs")
    with place, tag("table", "plain-table"):
        with tag("thead"), tag("tr"):
            for column in ("compare", *COLUMNS):
                kind = "text" if column in TEXTS else ""
                with tag("th", kind, scope="col") as head:
                    text(column)
                if column in MEANINGS:
                    head.props["title"] = MEANINGS[column]
        return tag("tbody")


class RunLine:
    """One run: a box that chooses it, its provenance and its figures."""

    def __init__(
        self,
        row: Mapping[str, Any],
        choose: Callable[..., Awaitable[None]],
        key: Key,
        *,
        chosen: bool,
    ) -> None:
        with tag("tr") as self.line:
            with tag("td"):
                self._box = tag("input", type="checkbox", data_run=f"{key[0]}-{key[1]}")
                self._box.props["aria-label"] = f"Compare run {row['index']} of {row['campaign']}"
                self._box.on(
                    "change",
                    lambda event: choose(key, chosen=bool(event.args)),
                    js_handler="(e) => emit(e.target.checked)",
                )
            cells = _cells(row)
            self._labels = {}
            for column in COLUMNS:
                with tag("td", "text" if column in TEXTS else ""):
                    self._labels[column] = text(printable(cells.get(column, ""), NOTE_SHOWN))
        self.mark(chosen=chosen)

    def show(self, away: float | None, share: float, written: str) -> None:
        """Show what changes: distance and relevance to the newest run, and the note."""
        say(self._labels["distance"], "-" if away is None else f"{away:.3g}")
        say(self._labels["relevance"], f"{100.0 * share:.1f} %" if share >= 1e-3 else "< 0.1 %")
        say(self._labels["note"], printable(written, NOTE_SHOWN))

    def mark(self, *, chosen: bool) -> None:
        """Show whether the run is chosen."""
        self._box.props["checked"] = chosen
        self.line.props["aria-selected"] = "true" if chosen else "false"


def _cells(row: Mapping[str, Any]) -> dict[str, str]:
    base = axis_unit(str(row["input_units"][0])) if row["input_units"] else "m"
    return {
        "campaign": str(row["campaign"]),
        "run": str(row["index"]),
        "cell": str(row["cell"]),
        "law": str(row["law"]),
        "max tracking": unit_for(base, row["tracking_inf_m"]).text(row["tracking_inf_m"]),
        "max contour": unit_for("m", row["contour_inf_m"]).text(row["contour_inf_m"]),
        "outcome": note(IterationRecord.from_row(row, "")),
        "made (UTC)": str(row["created_utc"])[:19].replace("T", " "),
    }

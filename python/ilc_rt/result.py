"""A campaign as a whole: what ran where, its runs, and what came of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ilc_rt._native import Library
from ilc_rt.errors import BadInputError
from ilc_rt.events import (
    EndEvent,
    Event,
    FaultEvent,
    IterationEvent,
    LatencyEvent,
    StartEvent,
)
from ilc_rt.record import IterationRecord

REPORT_NAME = "ilc-report.html"
# The best run is worth a word if it is this much better than the last.
BEST_SHARE = 0.9


@dataclass(slots=True)
class CampaignResult:
    """What a campaign did, collected from its events or from the library.

    Attributes
    ----------
    records : list of IterationRecord
        The runs in their order.
    start : StartEvent or None
        What ran where; None for a campaign read from a library.
    latency : LatencyEvent or None
        Times of the servo loop; None in lock-step.

    Examples
    --------
    >>> result = CampaignResult(library="ilc-library.db")
    >>> result.status
    'running'
    """

    library: str
    cell: str = ""
    campaign: str = ""
    law: str = ""
    measure: str = ""
    n_samples: int = 0
    n_axes: int = 0
    cycle_s: float = 0.0
    axis_names: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    created_utc: str = ""
    records: list[IterationRecord] = field(default_factory=list)
    start: StartEvent | None = None
    latency: LatencyEvent | None = None
    status: str = "running"
    reason: str | None = None

    @classmethod
    def from_library(cls, library: str | Path, campaign: str | None = None) -> CampaignResult:
        """Collect a campaign from the library; the latest if none is named.

        Parameters
        ----------
        library : path
            Library file.
        campaign : str or None
            Identifier of the campaign, or the beginning of it.

        Raises
        ------
        BadInputError
            If there is no such library or campaign.
        """
        rows = library_rows(library)
        names = list(dict.fromkeys(str(row["campaign"]) for row in rows))
        if not names:
            message = f"{library}: the library is empty"
            raise BadInputError(message)
        wanted = [name for name in names if campaign is None or name.startswith(campaign)]
        if not wanted:
            message = f"{library}: no campaign {campaign!r}; there is {', '.join(names[-8:])}"
            raise BadInputError(message)
        if campaign is not None and campaign not in wanted and len(wanted) > 1:
            message = f"{library}: campaign {campaign!r} is ambiguous: {', '.join(wanted[:8])}"
            raise BadInputError(message)
        chosen = campaign if campaign in wanted else wanted[-1]
        own = sorted((r for r in rows if r["campaign"] == chosen), key=lambda r: int(r["index"]))
        last = own[-1]
        return cls(
            library=str(library),
            cell=str(last["cell"]),
            campaign=str(chosen),
            law=str(last["law"]),
            measure=str(last["measure"]),
            n_samples=int(last["n_samples"]),
            n_axes=int(last["n_axes"]),
            cycle_s=float(last["cycle_s"]),
            axis_names=axis_names(last),
            input_units=tuple(last.get("input_units") or ()),
            created_utc=str(last.get("created_utc", "")),
            records=[IterationRecord.from_row(row, str(library)) for row in own],
            status="completed",
        )

    def follow(self, event: Event) -> None:
        """Take in one event of the campaign that runs now."""
        if isinstance(event, StartEvent):
            self.start = event
            self.cell, self.campaign = event.cell, event.campaign
            self.law, self.measure = event.law, event.measure
            self.n_samples, self.n_axes = event.n_samples, event.n_axes
            self.cycle_s, self.axis_names = event.cycle_s, event.axis_names
            self.input_units = event.input_units
            if event.first_index > 0 and not self.records:
                self._recall_earlier_runs(event.first_index)
        elif isinstance(event, IterationEvent):
            self.records.append(IterationRecord.from_event(event, self.library))
        elif isinstance(event, LatencyEvent):
            self.latency = event
        elif isinstance(event, FaultEvent):
            self.reason = event.reason
        elif isinstance(event, EndEvent):
            self.status = event.status
            self.reason = event.reason or self.reason

    @property
    def unkept(self) -> bool:
        """Whether the campaign was stopped as a run could not be kept."""
        return self.status == "fault" and (self.reason or "").startswith("library ")

    @property
    def mode(self) -> str:
        """``"realtime"``, ``"lockstep"``, or ``""`` if not known."""
        return self.start.mode if self.start else ""

    @property
    def bus(self) -> str:
        """Address of the bus, or ``""`` if not known."""
        return self.start.bus if self.start else ""

    def input_unit(self, axis: int) -> str:
        """Return the unit of an axis' learned input: m, m/s, rad or rad/s."""
        return self.input_units[axis] if axis < len(self.input_units) else "m"

    def axis_unit(self, axis: int) -> str:
        """Return what an axis is measured in: m or rad."""
        return self.input_unit(axis).removesuffix("/s")

    def sentence(self) -> str:
        """Say in one plain sentence what was learned.

        Examples
        --------
        >>> CampaignResult(library="x.db").sentence()
        'No run was completed.'
        """
        if not self.records:
            return "No run was completed."
        by_contour = all(record.contour_inf_m for record in self.records)
        what = "Contour error" if by_contour else "Tracking error"
        errors_m = [
            (by_contour and record.contour_inf_m) or record.tracking_inf_m
            for record in self.records
        ]
        before, after = errors_m[0], errors_m[-1]
        if len(errors_m) == 1:
            return f"{what} {micrometres(before)} µm at most in 1 run."
        change = reduction(before, after)
        said = f"{change:.1f} % less" if change >= 0 else f"{-change:.1f} % more"
        best = min(errors_m)
        index = self.records[errors_m.index(best)].index
        aside = f"; best {micrometres(best)} µm in run {index}" if best < BEST_SHARE * after else ""
        return (
            f"{what} from {micrometres(before)} µm to {micrometres(after)} µm "
            f"({said}) within {len(errors_m)} runs{aside}."
        )

    def to_json(self) -> dict[str, Any]:
        """Return the content of the file of ``--json``."""
        start = self.start
        return {
            "cell": self.cell,
            "campaign": self.campaign,
            "law": self.law,
            "measure": self.measure,
            "bus": self.bus or None,
            "mode": self.mode or None,
            "cycle_s": self.cycle_s,
            "n_samples": self.n_samples,
            "n_axes": self.n_axes,
            "axis_names": list(self.axis_names),
            "library": self.library,
            "status": self.status,
            "reason": self.reason,
            "iterations": [record.figures() for record in self.records],
            "latency": asdict(self.latency) if self.latency else None,
            "rt": asdict(start.rt) if start and start.rt else None,
        }

    def write_json(self, path: str | Path) -> None:
        """Write the figures to a file.

        Raises
        ------
        BadInputError
            If the file cannot be written.
        """
        text = json.dumps(self.to_json(), indent=2) + "\n"
        write_text(path, text)

    def _recall_earlier_runs(self, first_index: int) -> None:
        if not Path(self.library).is_file():
            return
        own = [row for row in Library(self.library).list() if row["campaign"] == self.campaign]
        own.sort(key=lambda row: int(row["index"]))
        self.records.extend(
            IterationRecord.from_row(row, self.library)
            for row in own
            if int(row["index"]) < first_index
        )


def axis_names(row: dict[str, Any]) -> tuple[str, ...]:
    """Return the names of the axes of a row, ``axis 1`` ... if it has none."""
    names = row.get("axis_names")
    if names:
        return tuple(str(name) for name in names)
    return tuple(f"axis {number + 1}" for number in range(int(row["n_axes"])))


def library_rows(library: str | Path, cell: str | None = None) -> list[dict[str, Any]]:
    """Return the rows of a library that must exist.

    Raises
    ------
    BadInputError
        If the file is missing or is not a library.
    """
    path = Path(library)
    if not path.exists():
        message = f"{library}: no such library"
        raise BadInputError(message)
    if path.is_file() and path.stat().st_size == 0:
        message = f"{library}: an empty file, and no library yet"
        raise BadInputError(message)
    try:
        return list(Library(str(library)).list(cell))
    except (ValueError, OSError, RuntimeError) as error:
        message = str(error) if str(library) in str(error) else f"{library}: {error}"
        raise BadInputError(message) from error


def micrometres(length_m: float | None) -> str:
    """Return a length in micrometres with three significant digits.

    Examples
    --------
    >>> micrometres(1.23456e-3), micrometres(4.5678e-6), micrometres(None)
    ('1235', '4.57', '-')
    """
    if length_m is None:
        return "-"
    value = length_m * 1e6
    if abs(value) >= 100:
        return f"{value:.0f}"
    return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}"


def reduction(before: float, after: float) -> float:
    """Return by how many percent `after` is below `before`.

    Examples
    --------
    >>> reduction(200.0, 50.0)
    75.0
    """
    return 100.0 * (1.0 - after / before) if before > 0 else 0.0


def report_file(path: str | Path) -> Path:
    """Return the file of a report: the path itself, or one in it if it is a folder.

    Examples
    --------
    >>> report_file("runs/today.html").as_posix(), report_file("runs").as_posix()
    ('runs/today.html', 'runs/ilc-report.html')
    """
    target = Path(path)
    return target / REPORT_NAME if target.is_dir() or not target.suffix else target


def require_writable(path: str | Path, option: str) -> None:
    """Refuse a file that cannot be written, before anything has been done for it.

    What is missing of the way to it is made and taken away again.

    Raises
    ------
    BadInputError
        With option, file and reason.
    """
    target = Path(path)
    try:
        if target.exists() and not target.is_file() and not target.is_dir():
            return  # a device or a pipe: to open it now would be to use it
        is_new = not target.exists()
        missing = [folder for folder in target.parents if not folder.exists()]
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("ab"):
                pass
            if is_new:
                target.unlink()
        finally:
            for folder in missing:
                if folder.is_dir():
                    folder.rmdir()
    except OSError as error:
        message = f"{option} {path}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error


def write_text(path: str | Path, text: str) -> None:
    """Write a file, with an error that a person understands.

    Raises
    ------
    BadInputError
        If it cannot be written.
    """
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        message = f"{path}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error

"""Result of a campaign: its setup, its runs and its outcome."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from ilc_rt.comparison import Comparison
from ilc_rt.errors import BadInputError
from ilc_rt.events import (
    EndEvent,
    Event,
    FaultEvent,
    IterationEvent,
    JudgedEvent,
    LatencyEvent,
    StartEvent,
)
from ilc_rt.quantity import axis_unit, digits
from ilc_rt.read_only import ReadOnlyLibrary
from ilc_rt.record import IterationRecord
from ilc_rt.result_views import Views

# Path that stands for standard output.
STANDARD_OUTPUT = Path("-")


#: Number of runs of a campaign that runs until it is stopped.
UNTIL_STOPPED = 2**32 - 1
#: Runs of such a campaign that its result keeps.
ENDLESS_RECORDS = 200


@dataclass(slots=True)
class CampaignResult(Views):
    """Result of a campaign, collected from its events or from the library.

    Attributes
    ----------
    records : list of IterationRecord
        The runs in order; of a campaign that runs until it is stopped the first and the newest 199.
    start : StartEvent or None
        Setup; None for a campaign read from a library.
    latency : LatencyEvent or None
        Timing of the servo loop; None in lock-step.

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
    fault: FaultEvent | None = None

    @classmethod
    def from_library(cls, library: str | Path, campaign: str | None = None) -> CampaignResult:
        """Collect a campaign from the library; the latest one by default.

        Parameters
        ----------
        library : path
            Library file.
        campaign : str or None
            Identifier of the campaign, or a prefix of it.

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
        """Add an event of the running campaign."""
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
            if self._is_endless and len(self.records) > ENDLESS_RECORDS:
                # The first one is what the others are compared with.
                del self.records[1]
        elif isinstance(event, JudgedEvent):
            self._judge(event)
        elif isinstance(event, LatencyEvent):
            self.latency = event
        elif isinstance(event, FaultEvent):
            self.reason, self.fault = event.reason, event
        elif isinstance(event, EndEvent):
            self.status = event.status
            self.reason = event.reason or self.reason

    @property
    def _is_endless(self) -> bool:
        return self.start is not None and self.start.iterations == UNTIL_STOPPED

    @property
    def unkept(self) -> bool:
        """True if the campaign was stopped because a run could not be stored."""
        return self.fault is not None and self.fault.kind == "library"

    @property
    def mode(self) -> str:
        """``"realtime"``, ``"lockstep"``, or ``""`` if unknown."""
        return self.start.mode if self.start else ""

    @property
    def bus(self) -> str:
        """Address of the bus, or ``""`` if unknown."""
        return self.start.bus if self.start else ""

    def input_unit(self, axis: int) -> str:
        """Return the unit of the learned input of an axis: m, m/s, N, rad, rad/s or N m."""
        return self.input_units[axis] if axis < len(self.input_units) else "m"

    def axis_unit(self, axis: int) -> str:
        """Return the unit of the position of an axis: m or rad."""
        return axis_unit(self.input_unit(axis))

    @property
    def axis_units(self) -> tuple[str, ...]:
        """Unit of the position of each axis: m or rad."""
        return tuple(self.axis_unit(axis) for axis in range(self.n_axes))

    @property
    def comparison(self) -> Comparison:
        """Figures of the runs; there must be at least one run."""
        return Comparison(self.records, self.axis_units)

    def sentence(self) -> str:
        """Return a plain sentence on what was learned.

        Examples
        --------
        >>> CampaignResult(library="x.db").sentence()
        'No run was completed.'
        """
        if not self.records:
            return "No run was completed."
        return self.comparison.sentence()

    def to_json(self) -> dict[str, Any]:
        """Return the content of the file written by ``--json``."""
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
            "axis_units": list(self.axis_units),
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
        write_text(path, json_text(self.to_json()))

    def forget_unkept(self) -> None:
        """Forget the runs that are not in the library any more."""
        kept = {int(row["id"]) for row in library_rows(self.library)}
        self.records = [record for record in self.records if record.id in kept]

    def _judge(self, event: JudgedEvent) -> None:
        for place, record in enumerate(self.records):
            if record.id == event.id:
                self.records[place] = replace(
                    record, rolled_back=event.rolled_back, learning_off=event.learning_off,
                    remark=event.remark,
                )  # fmt: skip

    def _recall_earlier_runs(self, first_index: int) -> None:
        if not Path(self.library).is_file():
            return
        stored = ReadOnlyLibrary(self.library).list()
        own = [row for row in stored if row["campaign"] == self.campaign]
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
    """Return the rows of an existing library.

    Raises
    ------
    BadInputError
        If the file is missing or is not a library.
    """
    try:
        return list(existing(library).list(cell))
    except (ValueError, OSError, RuntimeError) as error:
        raise BadInputError(str(error)) from error


def existing(library: str | Path) -> ReadOnlyLibrary:
    """Return an existing library, to be read only.

    Raises
    ------
    BadInputError
        If the file is missing or is not a library.
    """
    try:
        return ReadOnlyLibrary(library)
    except (ValueError, OSError, RuntimeError) as error:
        raise BadInputError(str(error)) from error


def micrometres(length_m: float | None) -> str:
    """Return a length in micrometres with three significant digits.

    Examples
    --------
    >>> micrometres(1.23456e-3), micrometres(4.5678e-6), micrometres(None)
    ('1235', '4.57', '-')
    """
    return "-" if length_m is None else digits(length_m * 1e6)


def json_text(content: object) -> str:
    r"""Return the text of a JSON file, with null for non-finite numbers.

    Examples
    --------
    >>> json_text({"error_m": float("nan")})
    '{\n  "error_m": null\n}\n'
    """
    text = json.dumps(_finite(content), indent=2, allow_nan=False)
    # The other control characters, and all non-ASCII characters, are already escaped.
    return text.replace("\x7f", "\\u007f") + "\n"


def _finite(content: object) -> object:
    if isinstance(content, dict):
        return {key: _finite(value) for key, value in content.items()}
    if isinstance(content, (list, tuple)):
        return [_finite(value) for value in content]
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content


def write_text(path: str | Path, text: str) -> None:
    """Write a file; a failure raises an error with a readable message.

    Raises
    ------
    BadInputError
        If the file cannot be written.

    Notes
    -----
    The path ``-`` stands for standard output.
    """
    if Path(path) == STANDARD_OUTPUT:
        # Other output may be redirected, but this is the stream of the process.
        out = sys.__stdout__ or sys.stdout
        out.write(text)
        out.flush()
        return
    try:
        Path(path).write_text(text, encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        message = f"{path}: cannot be written: {reason}"
        raise BadInputError(message) from error

"""State of a cell that is watched: events in, state out, nothing drawn.

Imported by the views in the terminal. The input may come from a network and is bounded.
"""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ilc_rt.comparison import Comparison, remark_on
from ilc_rt.events import (
    DriftEvent,
    EndEvent,
    FaultEvent,
    InputsEvent,
    IterationEvent,
    JudgedEvent,
    LateEvent,
    LatencyEvent,
    ProgressEvent,
    StartEvent,
    StateEvent,
)
from ilc_rt.lateness import late_sentence
from ilc_rt.quantity import axis_unit
from ilc_rt.record import IterationRecord
from ilc_rt.result import UNTIL_STOPPED
from ilc_rt.text import printable
from ilc_rt.wording import drift

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from ilc_rt.events import Event

#: What is kept of a cell at most: of runs, of notes, and of the batches of an error over time.
RUNS_MAX = 2000
NOTES_MAX = 50
TRAIL_MAX = 120
AXES_MAX = 64
#: Elapsed time from which the time left can be told.
TOLD_AFTER_S = 1.0


@dataclass(frozen=True, slots=True)
class Note:
    """A line on something that happened; `kind` is "fault", "warning" or "note"."""

    kind: str
    text: str


@dataclass(slots=True)
class WatchedAxis:
    """An axis, as its last batch of servo cycles showed it; positions in its own unit.

    Attributes
    ----------
    name, unit : str
        Its name; "m" or "rad".
    reference_m, error_m : float or None
        Set point of the newest cycle, and set point less measured position there.
    trail_m : deque of float
        Largest absolute tracking error of each batch within a run, oldest first.
    is_faulty : bool
        True if a fault has named this axis.
    """

    name: str
    unit: str = "m"
    reference_m: float | None = None
    error_m: float | None = None
    trail_m: deque[float] = field(default_factory=lambda: deque(maxlen=TRAIL_MAX))
    is_faulty: bool = False


class WatchedCell:
    """State of a cell, from its events and its batches of servo cycles.

    Parameters
    ----------
    name : str
        Name of the cell.
    clock : callable
        Returns the time in seconds; only differences count.

    Attributes
    ----------
    start : StartEvent or None
        What is constant in the campaign; None for a reader who came later.
    state : str or None
        Newest state, as in a `StateEvent`.
    iteration : int or None
        Number of the present run, None between runs of no number.
    share : float
        Share of the present run that is done, 0 to 1.
    records : list of IterationRecord
        Finished runs, oldest first.
    axes : list of WatchedAxis
        One per axis, as far as known.
    notes : deque of Note
        Faults, refusals, roll-backs, late cycles and drift in words, oldest first.
    latency : LatencyEvent or None
        Timing of the loop, at the end of a campaign.
    n_late, n_faults : int
        Number of servo cycles that were reported late, and of faults.
    end : EndEvent or None
        End of the campaign.
    is_present : bool or None
        False when the controller has gone; None if not known.
    """

    def __init__(self, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.name = name
        self.is_present: bool | None = None
        self._clock = clock
        self._reset()

    def _reset(self) -> None:
        self.start: StartEvent | None = None
        self.state: str | None = None
        self.iteration: int | None = None
        self.share = 0.0
        self.records: list[IterationRecord] = []
        self.units: tuple[str, ...] = ()
        self.axes: list[WatchedAxis] = []
        self.inputs = ""
        self.notes: deque[Note] = deque(maxlen=NOTES_MAX)
        self.latency: LatencyEvent | None = None
        self.n_late = 0
        self.n_faults = 0
        self.end: EndEvent | None = None
        # Where and when the campaign was first seen running: (share of it, time).
        self._seen: tuple[float, float] | None = None

    def see(self, event: Event) -> None:
        """Take in one event."""
        if isinstance(event, StartEvent):
            self._begin(event)
        elif isinstance(event, StateEvent):
            if self.end is not None:
                self._reset()  # the next campaign
            self.state, self.iteration = event.state, event.iteration
            if event.state != "paused":
                self.share = 0.0
        elif isinstance(event, ProgressEvent):
            self.state = "running" if self.state is None else self.state
            self.iteration = event.iteration
            self.share = min(1.0, max(0.0, event.sample / max(1, event.n_samples)))
        elif isinstance(event, IterationEvent):
            self._keep(IterationRecord.from_event(event, ""))
        elif isinstance(event, JudgedEvent):
            self._judge(event)
        elif isinstance(event, EndEvent):
            self.end = event
            if event.status != "completed" and event.reason and not self._is_known(event.reason):
                self.note("warning", f"{event.status}: {event.reason}")
        else:
            self._see_rare(event)
        self._measure_time()

    def _see_rare(self, event: Event) -> None:
        if isinstance(event, FaultEvent):
            self.n_faults += 1
            self.note("fault", event.reason)
            for axis in self.axes:
                axis.is_faulty |= axis.name == event.axis
        elif isinstance(event, InputsEvent):
            words = {None: "unknown", True: "on", False: "off"}
            self.inputs = ", ".join(f"{printable(i.name)} {words[i.on]}" for i in event.inputs)
        elif isinstance(event, DriftEvent):
            self.note("warning", drift(event))
        elif isinstance(event, LateEvent):
            self.n_late += event.count
            self.note("warning", f"late: {late_sentence(event)}")
        elif isinstance(event, LatencyEvent):
            self.latency = event

    def see_servo(self, batch: dict[str, Any]) -> None:
        """Take in a batch of servo cycles, as published; what is malformed is left out."""
        reference, measured = batch.get("reference_m"), batch.get("encoder_m")
        tool = batch.get("tool_m")
        if self.start is not None and self.start.measure != "encoder" and _has_numbers(tool):
            measured = tool
        if not isinstance(reference, list) or not isinstance(measured, list):
            return
        largest: dict[int, float] = {}
        for wanted, found in zip(reference, measured, strict=False):
            if not isinstance(wanted, list) or not isinstance(found, list):
                return
            for index, pair in enumerate(zip(wanted, found, strict=False)):
                if index >= AXES_MAX:
                    break
                axis = self._axis(index)
                axis.reference_m, actual = map(_number, pair)
                axis.error_m = None
                if axis.reference_m is not None and actual is not None:
                    axis.error_m = axis.reference_m - actual
                    largest[index] = max(largest.get(index, 0.0), abs(axis.error_m))
        if self.state == "running":
            for index, error_m in largest.items():
                self.axes[index].trail_m.append(error_m)

    def see_presence(self, *, is_present: bool) -> None:
        """Take in that the controller has appeared or gone."""
        self.is_present = is_present
        if not is_present and self.end is None and self.state is not None:
            self.note("warning", "the controller has gone without an end of its campaign")

    def note(self, kind: str, text: str) -> None:
        """Keep a line, unless the one before is the same."""
        line = Note(kind, printable(text))
        if not self.notes or self.notes[-1] != line:
            self.notes.append(line)

    @property
    def comparison(self) -> Comparison | None:
        """Errors of the runs, if one has finished."""
        return Comparison(self.records, self.units) if self.records else None

    @property
    def n_runs(self) -> int | None:
        """Number of runs of the campaign; None if unknown, or until stopped."""
        if self.start is None or self.start.iterations == UNTIL_STOPPED:
            return None
        return self.start.iterations

    @property
    def done(self) -> float | None:
        """Share of the campaign that is done, 0 to 1; None if unknown."""
        if self.n_runs is None or self.start is None:
            return None
        first = self.start.first_index
        finished = self.records[-1].index + 1 if self.records else first
        begun = finished if self.iteration is None else max(finished, self.iteration + self.share)
        return min(1.0, max(0.0, (begun - first) / max(1, self.n_runs - first)))

    @property
    def left_s(self) -> float | None:
        """Time left of the campaign in seconds, at the speed so far; None if unknown."""
        if self._seen is None or self.done is None or self.end is not None:
            return None
        share, since_s = self._seen
        elapsed_s = self._clock() - since_s
        if elapsed_s < TOLD_AFTER_S or self.done <= share:
            return None
        return elapsed_s * (1.0 - self.done) / (self.done - share)

    def recall(self, records: Iterable[IterationRecord]) -> None:
        """Take over the earlier runs of a campaign that goes on."""
        self.records[:0] = list(records)

    def _begin(self, start: StartEvent) -> None:
        self.start = start
        self.is_present = True
        self.units = tuple(map(axis_unit, start.input_units))
        self.records, self.axes, self._seen = [], [], None
        for index in range(min(len(start.axis_names), AXES_MAX)):
            self._axis(index)
        for line in start.rt.notes if start.rt else ():
            self.note("note", line)

    def _axis(self, index: int) -> WatchedAxis:
        names: Sequence[str] = self.start.axis_names if self.start else ()
        while len(self.axes) <= index:
            k = len(self.axes)
            name = names[k] if k < len(names) else str(k)
            self.axes.append(WatchedAxis(name, self.units[k] if k < len(self.units) else "m"))
        return self.axes[index]

    def _keep(self, record: IterationRecord) -> None:
        if self.records and record.index <= self.records[-1].index:
            # Another campaign, whose start was missed.
            self.records.clear()
        self.records.append(record)
        if len(self.records) > RUNS_MAX:
            # The first one is what all others are compared with.
            del self.records[1]
        self._remark(record)

    def _judge(self, event: JudgedEvent) -> None:
        for place, record in enumerate(self.records):
            if record.index == event.index:
                self.records[place] = replace(
                    record, rolled_back=event.rolled_back, learning_off=event.learning_off,
                    remark=event.remark,
                )  # fmt: skip
                self._remark(self.records[place])

    def _remark(self, record: IterationRecord) -> None:
        said = remark_on(record)
        if said:
            self.note("warning", f"run {record.index}: {said}")

    def _is_known(self, reason: str) -> bool:
        return any(note.text == printable(reason) for note in self.notes)

    def _measure_time(self) -> None:
        if self._seen is None and self.state == "running" and self.done is not None:
            self._seen = self.done, self._clock()


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if abs(value) < 1e12 and math.isfinite(value) else None


def _has_numbers(rows: object) -> bool:
    return (
        isinstance(rows, list)
        and bool(rows)
        and isinstance(rows[-1], list)
        and any(_number(value) is not None for value in rows[-1])
    )

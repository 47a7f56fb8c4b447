"""State of a cell that is watched: messages and events in, state out, nothing drawn.

The one interpretation of what a controller publishes: the views in the terminal and the page of a
cell read it. The input may come from a network and is bounded. What a late joiner has not heard is
taken from a cell description (`describe`) or from rows of a library (`remember`).
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ilc_rt.comparison import Comparison, remark_on
from ilc_rt.events import (
    DriftEvent,
    DrivesEvent,
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
from ilc_rt.misfit import AXES_MAX
from ilc_rt.quantity import axis_unit
from ilc_rt.record import IterationRecord
from ilc_rt.result import UNTIL_STOPPED
from ilc_rt.text import printable
from ilc_rt.watched_axis import WatchedAxis
from ilc_rt.watched_note import Note
from ilc_rt.wording import drift

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from ilc_rt import Cell
    from ilc_rt.cycles import Cycles
    from ilc_rt.events import Event, InputState
    from ilc_rt.lateness import LateCycle
    from ilc_rt.monitor import Message

#: What is kept of a cell at most: of runs, of notes.
RUNS_MAX = 5000
NOTES_MAX = 100
NAME_MAX = 40
#: Elapsed time from which the time left can be told.
TOLD_AFTER_S = 1.0


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
    axis_names, units, input_units : tuple of str
        Axes, units of their positions and of their learned inputs, as far as known.
    cycle_s, n_samples, measure, law : float, int, str, str or None
        What the start, a description or a library says of the cell.
    campaign : str or None
        The campaign, if it is known.
    iterations : int or None
        Number of its runs; `UNTIL_STOPPED` for one without an end.
    start : StartEvent or None
        What is constant in the campaign; None for a reader who came later.
    state : str or None
        Newest state, as in a `StateEvent`.
    iteration : int or None
        Number of the present run, None between runs of no number.
    progress : float or None
        Share of the present run that is done, 0 to 1; None between runs.
    records : list of IterationRecord
        Finished runs, oldest first.
    runs_version : int
        Changes with the runs.
    axes : list of WatchedAxis
        One per axis, as far as known.
    inputs : tuple of InputState
        Inputs of the machine.
    log : deque of Note
        What happened in words, oldest first.
    latency : LatencyEvent or None
        Timing of the loop, at the end of a campaign.
    late : LateCycle or None
        The newest late cycle, or the worst one at the end.
    n_late, n_faults : int
        Number of servo cycles that were reported late, and of faults, in this campaign.
    fault : FaultEvent or None
        The newest fault, until the drives are switched on again.
    end : EndEvent or None
        End of the campaign.
    is_present : bool or None
        False when the controller has gone; None if not known.
    """

    def __init__(self, name: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.name = name
        self.is_present: bool | None = None
        self._clock = clock
        self.axis_names: tuple[str, ...] = ()
        self.units: tuple[str, ...] = ()
        self.input_units: tuple[str, ...] = ()
        self.axes: list[WatchedAxis] = []
        self.cycle_s: float | None = None
        self.n_samples: int | None = None
        self.measure: str | None = None
        self.law: str | None = None
        self.state: str | None = None
        self.iteration: int | None = None
        self.inputs: tuple[InputState, ...] = ()
        self.log: deque[Note] = deque(maxlen=NOTES_MAX)
        self.runs_version = self._number = 0
        self._leave_campaign()

    def _leave_campaign(self) -> None:
        """Forget what is of one campaign only; another one has begun, or may have."""
        self.start: StartEvent | None = None
        self.campaign: str | None = None
        self._is_remembered = False
        self.iterations: int | None = None
        self.progress: float | None = None
        self.records: list[IterationRecord] = []
        self.latency: LatencyEvent | None = None
        self.late: LateCycle | None = None
        self.n_late = self.n_faults = 0
        self.end: EndEvent | None = None
        self.fault: FaultEvent | None
        self._no_fault()
        self.runs_version += 1
        self._number += 1
        # Where and when the campaign was first seen running: (share of it, time).
        self._seen: tuple[float, float] | None = None

    def take(self, message: Message) -> None:
        """Take in a message of the monitor."""
        if message.topic in {"alive", "gone"}:
            self.see_presence(is_present=message.topic == "alive")
        elif message.topic == "servo":
            self.see_servo(message.payload)
        else:
            if message.warning is not None:
                self.note("warning", f"{message.topic}: {message.warning}")
            if message.event is not None:
                self.see(message.event)

    def see(self, event: Event) -> None:
        """Take in one event."""
        if isinstance(event, StartEvent):
            self._begin(event)
        elif isinstance(event, StateEvent):
            self._change(event)
        elif isinstance(event, ProgressEvent):
            self.state = "running" if self.state is None else self.state
            self.iteration, self.n_samples = event.iteration, event.n_samples
            self.progress = min(1.0, max(0.0, event.sample / max(1, event.n_samples)))
        elif isinstance(event, IterationEvent):
            self._belong_to(event.campaign)
            self._keep(IterationRecord.from_event(event, ""))
        elif isinstance(event, JudgedEvent):
            self._judge(event)
        elif isinstance(event, EndEvent):
            self._finish(event)
        else:
            self._see_rare(event)
        if self._seen is None and self.state == "running" and self.done is not None:
            self._seen = self.done, self._clock()

    def _belong_to(self, campaign: str | None) -> None:
        """Take in which campaign a run is of; one whose start was missed is another one, too."""
        if campaign is None or campaign == self.campaign:
            return
        if self.campaign is not None:
            self._leave_campaign()
        self.campaign = campaign

    def _see_rare(self, event: Event) -> None:
        if isinstance(event, FaultEvent):
            self.fault, self.late = event, event.late or self.late
            self.n_faults += 1
            self.note("fault", event.reason)
            for axis in self.axes:
                axis.is_faulty |= axis.name == event.axis
        elif isinstance(event, InputsEvent):
            self.inputs = event.inputs
        elif isinstance(event, DrivesEvent):
            states = {one.axis: one.state for one in event.drives}
            for axis in self.axes:
                axis.drive = states.get(axis.name)
        elif isinstance(event, DriftEvent):
            self.note("warning", drift(event))
        elif isinstance(event, LateEvent):
            self.late, self.n_late = event, self.n_late + max(1, event.count)
            self.note("warning", f"late: {late_sentence(event)}")
        elif isinstance(event, LatencyEvent):
            self.latency, self.late = event, event.worst or self.late

    def see_servo(self, batch: dict[str, Any]) -> Cycles | None:
        """Take in a batch of servo cycles, as published, and return it; None if it is malformed."""
        # Only here: a program that hears no cycles starts without NumPy.
        from ilc_rt.cycles import read_cycles

        cycles = read_cycles(batch, len(self.axis_names), self.measure)
        if cycles is None:
            return None
        if not self.axis_names:
            names = tuple(map(str, range(cycles.n_axes)))
            self._know_axes(names, ("m",) * len(names), ("m",) * len(names))
        for axis, newest, largest_m in zip(
            self.axes, cycles.newest(), cycles.largest_errors_m(), strict=True
        ):
            axis.reference_m, axis.measured_m, axis.input, axis.error_m = newest
            if self.state == "running" and largest_m is not None:
                axis.trail_m.append(largest_m)
        return cycles

    def see_presence(self, *, is_present: bool) -> None:
        """Take in that the controller has appeared or gone."""
        if is_present and self.is_present is False:
            self.note("log", "the controller is back")
            self._leave_campaign()
        self.is_present = is_present
        if not is_present and self.end is None:
            self.note("warning", "the controller has gone without an end of its campaign")

    def describe(self, cell: Cell) -> None:
        """Take what a cell description says, for a controller whose start was not heard."""
        if self.start is None:
            self._know_axes(tuple(cell.axis_names), tuple(cell.axis_units), ())
            self.cycle_s, self.n_samples = cell.cycle_s, cell.n_samples
            self.measure, self.law = cell.measure, cell.law

    def remember(self, rows: Iterable[Mapping[str, Any]], library: str) -> None:
        """Take the runs of this campaign from rows of a library; those that were heard stay.

        Of a campaign whose start was not heard, axes, units, cycle and law are those of its newest
        row. A cell that now makes an earlier run than the library has makes another campaign: its
        axes are the same, its runs are not.
        """
        rows = list(rows)
        if not rows:
            return
        newest = rows[-1]
        if self.start is None:
            input_units = tuple(map(str, newest["input_units"]))
            self._know_axes(
                tuple(newest["axis_names"]), tuple(map(axis_unit, input_units)), input_units
            )
            self.cycle_s, self.n_samples = float(newest["cycle_s"]), int(newest["n_samples"])
            self.measure, self.law = str(newest["measure"]), str(newest["law"])
            if self.iteration is not None and self.iteration < int(newest["index"]):
                return
            self.campaign = str(newest["campaign"])
            self._is_remembered = True
        self.recall(IterationRecord.from_row(row, library) for row in rows)

    def lacks(self, message: Message) -> bool:
        """Return whether a library may have what was not heard before this message."""
        if message.topic == "alive" or isinstance(message.event, StartEvent):
            return True
        is_unknown = self.start is None and not self._is_remembered
        return isinstance(message.event, IterationEvent) and is_unknown

    def named_by(self, event: Event | None) -> tuple[str | None, str | None]:
        """Return the campaign, if it is known, and the digest of the run of an event."""
        sure = self.campaign if self.start is not None else None
        if isinstance(event, IterationEvent):
            return event.campaign or sure, event.digest
        return sure, None

    def recall(self, records: Iterable[IterationRecord]) -> None:
        """Take over the earlier runs of a campaign that goes on; those that were heard stay."""
        known = {record.index: record for record in records}
        known |= {record.index: record for record in self.records}
        self.records = [known[index] for index in sorted(known)]
        self._bound()

    def note(self, kind: str, text: str) -> None:
        """Keep a line, unless the one before is the same."""
        line = Note(kind, printable(text), self._clock(), self._number)
        # A stranger that repeats itself takes no more than its line.
        if not self.log or (self.log[-1].kind, self.log[-1].text) != (kind, line.text):
            self.log.append(line)

    @property
    def notes(self) -> list[Note]:
        """Faults, refusals, roll-backs, late cycles and drift of this campaign, oldest first."""
        return [n for n in self.log if n.campaign == self._number and n.kind != "log"]

    @property
    def n_axes(self) -> int:
        """Number of axes; 0 before it is known."""
        return len(self.axis_names)

    @property
    def last(self) -> IterationRecord | None:
        """The newest run."""
        return self.records[-1] if self.records else None

    @property
    def comparison(self) -> Comparison | None:
        """Errors of the runs, if one has finished."""
        return Comparison(self.records, self.units) if self.records else None

    @property
    def overruns(self) -> int:
        """Servo cycles of all runs that began at least a cycle late."""
        return sum(record.overruns for record in self.records)

    @property
    def decision(self) -> IterationRecord | None:
        """The newest run after which learning was off or a better input was restored."""
        found = (r for r in reversed(self.records) if r.learning_off or r.rolled_back)
        return next(found, None)

    @property
    def n_runs(self) -> int | None:
        """Number of runs of the campaign; None if unknown, or until stopped."""
        return None if self.iterations == UNTIL_STOPPED else self.iterations

    @property
    def done(self) -> float | None:
        """Share of the campaign that is done, 0 to 1; None if unknown."""
        if self.n_runs is None or self.start is None:
            return None
        first = self.start.first_index
        finished = self.records[-1].index + 1 if self.records else first
        begun = max(finished, (self.iteration or 0) + (self.progress or 0.0))
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

    def _begin(self, start: StartEvent) -> None:
        earlier = self.records if start.campaign == self.campaign else []
        self._leave_campaign()
        self.records = earlier
        self.start, self.is_present = start, True
        input_units = start.input_units or ("m",) * len(start.axis_names)
        self._know_axes(start.axis_names, tuple(map(axis_unit, input_units)), input_units)
        self.cycle_s, self.n_samples = start.cycle_s, start.n_samples
        self.measure, self.law = start.measure, start.law
        self.campaign, self.iterations = start.campaign, start.iterations
        self.state = self.iteration = None
        self.note("log", f"campaign {start.campaign} begins")
        for line in start.rt.notes if start.rt else ():
            self.note("note", line)

    def _change(self, event: StateEvent) -> None:
        if self.end is not None:
            # The next campaign, whose start was missed.
            self._leave_campaign()
        last = self.last
        if self.start is None and last is not None and _is_before(event, last):
            # The runs of a library were those of another campaign.
            self._leave_campaign()
        self.state, self.iteration = event.state, event.iteration
        if event.state != "paused":
            self.progress = None
        if event.state in {"enabling", "bringing_up"}:
            self._no_fault()

    def _finish(self, end: EndEvent) -> None:
        self.end, self.progress = end, None
        is_new = bool(end.reason) and not any(n.text == printable(end.reason) for n in self.log)
        if end.status != "completed" and is_new:
            self.note("warning", f"{end.status}: {end.reason}")
        else:
            runs = f"{end.iterations} run{'' if end.iterations == 1 else 's'}"
            self.note("log", f"{end.status} after {runs}")

    def _no_fault(self) -> None:
        self.fault = None
        for axis in self.axes:
            axis.is_faulty = False

    def _know_axes(
        self, names: Sequence[str], units: Sequence[str], input_units: Sequence[str]
    ) -> None:
        self.axis_names = tuple(printable(name, NAME_MAX) for name in names[:AXES_MAX])
        units = (*units, *("m",) * len(self.axis_names))[: len(self.axis_names)]
        self.units = units
        self.input_units = (*input_units, *units[len(input_units) :])[: len(units)]
        self.axes = [WatchedAxis(*axis) for axis in zip(self.axis_names, units, strict=True)]

    def _keep(self, record: IterationRecord) -> None:
        last = self.last
        if last is not None and record.index <= last.index:
            # A library has a run just before its event. First runs of several campaigns may be the
            # same: only the newest one tells that this is the campaign of the library.
            if record.digest and (last.index, last.digest) == (record.index, record.digest):
                self.records.pop()
            else:
                # Another campaign, whose start was missed.
                self._leave_campaign()
        self.records.append(record)
        self._bound()
        self._remark(record.index, remark_on(record))

    def _judge(self, event: JudgedEvent) -> None:
        said = event.remark
        for place, record in enumerate(self.records):
            if record.index == event.index:
                judged = replace(
                    record, rolled_back=event.rolled_back, learning_off=event.learning_off,
                    remark=event.remark,
                )  # fmt: skip
                self.records[place] = judged
                self.runs_version += 1
                said = remark_on(judged)
        self._remark(event.index, said)

    def _remark(self, index: int, said: str | None) -> None:
        if said:
            self.note("warning", f"run {index}: {said}")

    def _bound(self) -> None:
        """Keep the first run, with which all others are compared, and the newest ones."""
        self.runs_version += 1
        if len(self.records) > RUNS_MAX:
            del self.records[1 : len(self.records) - RUNS_MAX + 1]


def _is_before(event: StateEvent, run: IterationRecord) -> bool:
    """Return whether a cell is in an earlier run than this one."""
    return event.iteration is not None and event.iteration < run.index

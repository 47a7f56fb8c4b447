"""State of a cell that is watched, fed with the messages of the monitor.

Pure: it knows neither network nor page, and time is an argument. Imported by the
fleet of all cells and by the page.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.dashboard.capture import Capture
from ilc_rt.dashboard.cycles import AXES_MAX, read_cycles
from ilc_rt.dashboard.status import Status, status_of
from ilc_rt.dashboard.window import N_BUCKETS, WINDOW_S, Window
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
from ilc_rt.progress import drift
from ilc_rt.quantity import axis_unit
from ilc_rt.record import IterationRecord
from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from numpy.typing import NDArray

    from ilc_rt import Cell
    from ilc_rt.dashboard.flight import FlightRecord
    from ilc_rt.events import Histogram, InputState
    from ilc_rt.lateness import LateCycle
    from ilc_rt.monitor import Message

    Array = NDArray[np.float64]

RUNS_MAX = 5_000
NOTICES_MAX = 100
#: Duration of a batch, by which a late joiner knows the cycle.
BATCH_S = 0.05
#: Signals of the window, one column per axis each.
SIGNALS = ("error", "reference", "input")


@dataclass(frozen=True, slots=True)
class Notice:
    """A line of the log of a cell; `level` is "info", "warn" or "fault"."""

    at_s: float
    level: str
    text: str


class CellModel:
    """Everything that is known of one cell.

    Parameters
    ----------
    name : str
        Its name.

    Attributes
    ----------
    axis_names, units, input_units : tuple of str
        Axes, units of their positions and of their learned inputs.
    runs : dict of int to IterationRecord
        Runs of the campaign by number, oldest first.
    notices : deque of Notice
        What happened, newest last.
    window : Window or None
        Newest seconds of the signals `SIGNALS`.
    epoch : int
        Counts the windows: a page that holds an older one begins again.
    last_run : Capture or None
        Signals of the newest run that was heard to its end.
    version, runs_version : int
        Change with everything but the window, the state and the progress; with the runs.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.axis_names: tuple[str, ...] = ()
        self.units: tuple[str, ...] = ()
        self.input_units: tuple[str, ...] = ()
        self.cycle_s: float | None = None
        self.n_samples: int | None = None
        self.measure: str | None = None
        self.law: str | None = None
        self.campaign: str | None = None
        self.iterations: int | None = None
        self.start: StartEvent | None = None
        self.state: str | None = None
        self.iteration: int | None = None
        self.progress: float | None = None
        self.inputs: tuple[InputState, ...] = ()
        self.runs: dict[int, IterationRecord] = {}
        self.fault: FaultEvent | None = None
        self.end: EndEvent | None = None
        self.timing: dict[str, Histogram] = {}
        self.late: LateCycle | None = None
        self.n_late = 0
        self.notices: deque[Notice] = deque(maxlen=NOTICES_MAX)
        self.window: Window | None = None
        self.epoch = 0
        self.last_run: Capture | None = None
        self.now: Array | None = None
        self.version = self.runs_version = 0
        self.is_alive = False
        self.seen_s: float | None = None
        self.gone_s: float | None = None
        self._next = 0
        self._capture: Capture | None = None

    def describe(self, cell: Cell) -> None:
        """Take what a cell description says, for a controller whose start was not heard."""
        if self.start is None:
            self.axis_names, self.units = tuple(cell.axis_names), tuple(cell.axis_units)
            self.cycle_s, self.n_samples = cell.cycle_s, cell.n_samples
            self.measure, self.law = cell.measure, cell.law
            self.version += 1

    def remember(self, rows: Iterable[Mapping[str, Any]], library: str) -> None:
        """Take the runs of this campaign from rows of a library; those that were heard stay."""
        rows = list(rows)
        if not rows:
            return
        newest = rows[-1]
        if self.start is None:
            self.axis_names = tuple(map(printable, newest["axis_names"]))
            self.input_units = tuple(map(str, newest["input_units"]))
            self.units = tuple(map(axis_unit, self.input_units))
            self.cycle_s, self.n_samples = float(newest["cycle_s"]), int(newest["n_samples"])
            self.measure, self.law = str(newest["measure"]), str(newest["law"])
            self.campaign = str(newest["campaign"])
        known = {int(row["index"]): IterationRecord.from_row(row, library) for row in rows}
        self.runs = dict(sorted({**known, **self.runs}.items())[-RUNS_MAX:])
        self.runs_version += 1
        self.version += 1

    def remember_flight(self, record: FlightRecord) -> None:
        """Take the timing of the last run in real time, if this campaign has not told its own."""
        if not self.timing and self.start is None:
            self.timing, self.late, self.n_late = record.timing, record.worst, record.n_late
            self.version += 1

    def apply(self, message: Message, now_s: float, clock_s: float) -> None:
        """Follow a message; `now_s` is monotonic, `clock_s` the time in seconds since 1970."""
        if message.topic == "gone":
            self._leave(now_s, clock_s)
            return
        if message.topic == "alive":
            self._appear(clock_s)
        self.seen_s, self.gone_s = now_s, None
        if message.topic == "alive":
            self.version += 1
            return
        if message.topic == "servo":
            self._cycles(message.payload)
            return
        if message.warning is not None:
            self._say(clock_s, "warn", message.warning)
        self._event(message.event, clock_s)
        if not isinstance(message.event, (ProgressEvent, StateEvent)):
            self.version += 1

    def status(self, now_s: float) -> Status:
        """Return the state in words, with its level."""
        return status_of(self, now_s)

    @property
    def n_axes(self) -> int:
        """Number of axes; 0 before it is known."""
        return len(self.axis_names)

    @property
    def last(self) -> IterationRecord | None:
        """The newest run."""
        return next(reversed(self.runs.values()), None)

    @property
    def overruns(self) -> int:
        """Servo cycles of all runs that began at least a cycle late."""
        return sum(run.overruns for run in self.runs.values())

    @property
    def decision(self) -> IterationRecord | None:
        """The newest run after which learning was off or a better input was restored."""
        found = (r for r in reversed(self.runs.values()) if r.learning_off or r.rolled_back)
        return next(found, None)

    def _appear(self, clock_s: float) -> None:
        if not self.is_alive and self.gone_s is not None:
            self._say(clock_s, "info", "the controller is back")
            self._forget()
        self.is_alive = True

    def _forget(self) -> None:
        """Forget what is of one campaign only; another one has begun, or may have."""
        self.start = self.campaign = self.iterations = None

    def _leave(self, now_s: float, clock_s: float) -> None:
        self.is_alive, self.gone_s = False, now_s
        if self.end is None:
            self._say(clock_s, "warn", "the controller is gone without an end")
        self.version += 1

    def _say(self, clock_s: float, level: str, text: str) -> None:
        notice = Notice(clock_s, level, printable(text))
        # A stranger that repeats itself takes no more than its line.
        if not self.notices or self.notices[-1].text != notice.text:
            self.notices.append(notice)

    def _event(self, event: object, clock_s: float) -> None:
        if isinstance(event, StartEvent):
            self._begin(event, clock_s)
        elif isinstance(event, StateEvent):
            self.state, self.iteration = event.state, event.iteration
            self.progress = None
            # A state after the end is that of the next campaign, whose start was missed.
            self.end = None
            if event.state in {"enabling", "bringing_up"}:
                self.fault = None
        elif isinstance(event, ProgressEvent):
            self.iteration, self.state = event.iteration, self.state or "running"
            self.n_samples = event.n_samples
            self.progress = event.sample / max(1, event.n_samples)
        elif isinstance(event, IterationEvent):
            self._run(event, clock_s)
        elif isinstance(event, JudgedEvent):
            self._judge(event, clock_s)
        elif isinstance(event, FaultEvent):
            self.fault, self.late = event, event.late or self.late
            self._say(clock_s, "fault", event.reason)
        elif isinstance(event, EndEvent):
            self.end = event
            why = f": {event.reason}" if event.reason and event.status != "completed" else ""
            level = "fault" if event.status == "fault" else "info"
            self._say(clock_s, level, f"{event.status} after {event.iterations} runs{why}")
        else:
            self._aside(event, clock_s)

    def _aside(self, event: object, clock_s: float) -> None:
        if isinstance(event, InputsEvent):
            self.inputs = event.inputs
        elif isinstance(event, DriftEvent):
            self._say(clock_s, "warn", drift(event))
        elif isinstance(event, LateEvent):
            self.late, self.n_late = event, self.n_late + max(1, event.count)
            self._say(clock_s, "warn", f"late: {late_sentence(event)}")
        elif isinstance(event, LatencyEvent):
            self.timing = {
                "wake-up late": event.wake_late_us,
                "execution": event.execution_us,
            }
            self.late = event.worst or self.late

    def _begin(self, event: StartEvent, clock_s: float) -> None:
        if event.campaign != self.campaign:
            self.runs.clear()
            self.runs_version += 1
        self.start = event
        self.axis_names = tuple(printable(name, 40) for name in event.axis_names[:AXES_MAX])
        self.input_units = event.input_units[:AXES_MAX] or ("m",) * len(self.axis_names)
        self.units = tuple(map(axis_unit, self.input_units))
        self.cycle_s, self.n_samples = event.cycle_s, event.n_samples
        self.measure, self.law, self.campaign = event.measure, event.law, event.campaign
        self.iterations = event.iterations
        self.state = self.iteration = self.progress = None
        self.fault = self.end = self.late = self.window = None
        self.timing = {}
        self._capture = self.last_run = None
        self.n_late = 0
        self._say(clock_s, "info", f"campaign {event.campaign} begins")

    def _run(self, event: IterationEvent, clock_s: float) -> None:
        newest = self.last
        if newest is not None and event.index <= newest.index and event.digest != newest.digest:
            # Another campaign, whose start was missed.
            self.runs.clear()
            self._forget()
        self.runs[event.index] = IterationRecord.from_event(event, "")
        self.runs_version += 1
        while len(self.runs) > RUNS_MAX:
            del self.runs[next(iter(self.runs))]
        self._end_capture()
        if event.remark:
            self._say(clock_s, "warn", f"run {event.index}: {event.remark}")

    def _judge(self, event: JudgedEvent, clock_s: float) -> None:
        record = self.runs.get(event.index)
        if record is not None:
            values = record.figures() | {
                "rolled_back": event.rolled_back,
                "learning_off": event.learning_off,
                "remark": event.remark,
            }
            self.runs[event.index] = IterationRecord(library="", **values)
            self.runs_version += 1
        if event.remark:
            self._say(clock_s, "warn", f"run {event.index}: {event.remark}")

    def _cycles(self, batch: dict[str, Any]) -> None:
        """Take a batch of servo cycles; a malformed one is left out."""
        cycles = read_cycles(batch, self.n_axes, self.measure)
        if cycles is None:
            return
        n_cycles, n_axes = cycles.reference_m.shape
        if not self.axis_names:
            self.axis_names = tuple(map(str, range(n_axes)))
            self.units = self.input_units = ("m",) * n_axes
            self.version += 1
        self.cycle_s = self.cycle_s or BATCH_S / n_cycles
        n_signals = len(SIGNALS) * n_axes
        window = self.window
        if window is None or cycles.first < self._next or window.n_signals != n_signals:
            span = round(WINDOW_S / N_BUCKETS / self.cycle_s)
            window, self.epoch = Window(n_signals, span), self.epoch + 1
            self.window = window
        self._next = cycles.first + n_cycles
        error = cycles.error_m
        window.extend(cycles.first, np.hstack((error, cycles.reference_m, cycles.input)))
        values = np.stack((cycles.reference_m, cycles.measured_m, cycles.input), axis=1)
        self.now = np.vstack((values[-1], error[-1:]))
        for iteration, found in cycles.samples().items():
            self._captured(iteration, n_axes).put(found[:, 1], values[found[:, 0]])

    def _captured(self, iteration: int, n_axes: int) -> Capture:
        """Return the capture of a run; the last samples may come after the end of the run."""
        last = self.last_run
        if self._capture is None and last is not None and last.iteration == iteration:
            return last
        if self._capture is None or self._capture.iteration != iteration:
            self._end_capture()
            self._capture = Capture(iteration, n_axes)
        return self._capture

    def _end_capture(self) -> None:
        if self._capture is not None and self._capture.is_complete(self.n_samples):
            self.last_run = self._capture
            self._capture = None
            self.version += 1

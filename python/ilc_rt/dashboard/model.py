"""A watched cell as its page shows it: with its live signals and its last run.

What messages mean is said in `ilc_rt.watched`; here are added the newest seconds of the signals,
the signals of the last run, and numbers that tell a page what has changed. Pure: it knows neither
network nor page, and time is an argument. Imported by the fleet of all cells and by the page.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ilc_rt.dashboard.capture import Capture
from ilc_rt.dashboard.status import Status, status_of
from ilc_rt.dashboard.window import N_BUCKETS, WINDOW_S, Window
from ilc_rt.events import IterationEvent, ProgressEvent, StartEvent, StateEvent
from ilc_rt.watched import WatchedCell

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from ilc_rt import Cell
    from ilc_rt.cycles import Cycles
    from ilc_rt.dashboard.flight import FlightRecord
    from ilc_rt.events import Event, Histogram
    from ilc_rt.monitor import Message

#: Duration of a batch, by which a late joiner knows the cycle.
BATCH_S = 0.05
#: Signals of the window, one column per axis each.
SIGNALS = ("error", "reference", "input")


class CellModel(WatchedCell):
    """Everything that is known of one cell.

    Parameters
    ----------
    name : str
        Its name.

    Attributes
    ----------
    window : Window or None
        Newest seconds of the signals `SIGNALS`.
    epoch : int
        Counts the windows: a page that holds an older one begins again.
    last_run : Capture or None
        Signals of the newest run that was heard to its end.
    version : int
        Changes with everything but the window, the state and the progress.
    seen_s, gone_s : float or None
        Monotonic time of the newest message; since when the controller is gone.

    Notes
    -----
    The other attributes are those of `ilc_rt.watched.WatchedCell`.
    """

    def __init__(self, name: str) -> None:
        self._clock_s = 0.0
        super().__init__(name, lambda: self._clock_s)
        self.window: Window | None = None
        self.epoch = 0
        self.last_run: Capture | None = None
        self.version = 0
        self.seen_s: float | None = None
        self.gone_s: float | None = None
        self._flight: FlightRecord | None = None
        self._next = 0
        self._capture: Capture | None = None

    def apply(self, message: Message, now_s: float, clock_s: float) -> None:
        """Follow a message; `now_s` is monotonic, `clock_s` the time in seconds since 1970."""
        self._clock_s = clock_s
        if message.topic == "gone":
            self.gone_s = now_s
        else:
            self.seen_s, self.gone_s = now_s, None
        self.take(message)
        if message.topic != "servo" and not isinstance(message.event, (ProgressEvent, StateEvent)):
            self.version += 1

    def see(self, event: Event) -> None:
        """Take in one event; a start ends the signals of the campaign before."""
        super().see(event)
        if isinstance(event, StartEvent):
            self.window = self._capture = self.last_run = self._flight = None
        elif isinstance(event, IterationEvent):
            self._end_capture()

    def see_servo(self, batch: dict[str, Any]) -> Cycles | None:
        """Take in a batch of servo cycles: into the window, and into the run they belong to."""
        n_before = self.n_axes
        cycles = super().see_servo(batch)
        if cycles is not None:
            self.version += self.n_axes != n_before
            self._extend(cycles)
        return cycles

    def describe(self, cell: Cell) -> None:
        """Take what a cell description says, for a controller whose start was not heard."""
        super().describe(cell)
        self.version += 1

    def remember(self, rows: Iterable[Mapping[str, Any]], library: str) -> None:
        """Take the runs of this campaign from rows of a library; those that were heard stay."""
        super().remember(rows, library)
        self.version += 1

    def remember_flight(self, record: FlightRecord) -> None:
        """Take the timing of the last run in real time, if this campaign has not told its own."""
        if self.latency is None and self.start is None:
            self._flight = record
            self.late, self.n_late = record.worst, record.n_late
            self.version += 1

    def status(self, now_s: float) -> Status:
        """Return the state in words, with its level."""
        return status_of(self, now_s)

    @property
    def timing(self) -> dict[str, Histogram]:
        """Histograms of the times of the loop, by their words; empty before the end."""
        if self.latency is not None:
            return {
                "wake-up late": self.latency.wake_late_us,
                "execution": self.latency.execution_us,
            }
        return {} if self._flight is None else self._flight.timing

    def _extend(self, cycles: Cycles) -> None:
        n_cycles, n_axes = cycles.reference_m.shape
        self.cycle_s = self.cycle_s or BATCH_S / n_cycles
        n_signals = len(SIGNALS) * n_axes
        window = self.window
        if window is None or cycles.first < self._next or window.n_signals != n_signals:
            span = round(WINDOW_S / N_BUCKETS / self.cycle_s)
            window, self.epoch = Window(n_signals, span), self.epoch + 1
            self.window = window
        self._next = cycles.first + n_cycles
        window.extend(cycles.first, np.hstack((cycles.error_m, cycles.reference_m, cycles.input)))
        values = np.stack((cycles.reference_m, cycles.measured_m, cycles.input), axis=1)
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

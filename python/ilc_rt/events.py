"""What the controller says while it runs, as typed events.

``ilc-rt run --events`` prints one JSON object a line, and publishes the same
objects on Zenoh. `parse_event` turns one of them into one of the classes here.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any, ClassVar


class EventError(ValueError):
    """A line that is not an event of the controller."""


@dataclass(frozen=True, slots=True)
class RealTimeReport:
    """What the operating system granted to the servo thread."""

    policy: str = ""
    priority: int = 0
    mlock: bool = False
    kernel: str = ""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Histogram:
    """Quantiles and counts of a time, in microseconds.

    `bins` holds ``(upper bound, count)`` pairs, lowest first.
    """

    p50: float
    p99: float
    p999: float
    max: float
    bins: tuple[tuple[float, int], ...] = ()


@dataclass(frozen=True, slots=True)
class StartEvent:
    """The campaign begins; everything that stays the same while it lasts.

    `iterations` counts all runs of the campaign, also those before
    `first_index` that a resumed one has behind it.
    """

    name: ClassVar[str] = "start"
    cell: str
    campaign: str
    n_samples: int
    n_axes: int
    axis_names: tuple[str, ...]
    cycle_s: float
    first_index: int
    iterations: int
    measure: str
    law: str
    bus: str
    mode: str
    input_units: tuple[str, ...] = ()
    rt: RealTimeReport | None = None


@dataclass(frozen=True, slots=True)
class StateEvent:
    """The campaign entered a state, as ``"running"`` or ``"returning"``."""

    name: ClassVar[str] = "state"
    state: str
    iteration: int | None = None


@dataclass(frozen=True, slots=True)
class ProgressEvent:
    """How far the run has come."""

    name: ClassVar[str] = "progress"
    iteration: int
    sample: int
    n_samples: int


@dataclass(frozen=True, slots=True)
class IterationEvent:
    """One run is over and in the library; lengths in metres, angles in radians.

    `id` is the key of the run in the library, `index` counts the runs of the
    campaign from 0. `tracking_inf_m` and `contour_inf_m` are the largest
    values over time, the `_rms_m` ones root mean squares; all of them are of
    the measurement that is learned from. Contour errors are None where the
    path has none. `axes_tracking_inf_m` and `axes_tracking_rms_m` have one
    number for each axis, in its own unit.
    """

    name: ClassVar[str] = "iteration"
    id: int
    index: int
    tracking_inf_m: float
    tracking_rms_m: float
    contour_inf_m: float | None
    contour_rms_m: float | None
    encoder_tracking_inf_m: float | None = None
    tool_tracking_inf_m: float | None = None
    overruns: int = 0
    missing_samples: int = 0
    late_updates: int = 0
    update_ms: float | None = None
    rolled_back: bool = False
    digest: str = ""
    axes_tracking_inf_m: tuple[float, ...] = ()
    axes_tracking_rms_m: tuple[float, ...] = ()
    learning_off: bool = False
    remark: str | None = None


@dataclass(frozen=True, slots=True)
class JudgedEvent:
    """What the law decided on a run that was told already, as it computed meanwhile."""

    name: ClassVar[str] = "judged"
    id: int
    index: int
    rolled_back: bool
    learning_off: bool
    remark: str | None = None


@dataclass(frozen=True, slots=True)
class LatencyEvent:
    """How late the servo loop woke and how long it computed."""

    name: ClassVar[str] = "latency"
    wake_late_us: Histogram
    execution_us: Histogram


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """Why the axes are being stopped, in one sentence."""

    name: ClassVar[str] = "fault"
    reason: str


@dataclass(frozen=True, slots=True)
class EndEvent:
    """The campaign is over and the axes are at rest.

    `status` is ``"completed"``, ``"interrupted"`` or ``"fault"``.
    """

    name: ClassVar[str] = "end"
    status: str
    iterations: int
    reason: str | None = None


Event = (
    StartEvent
    | StateEvent
    | ProgressEvent
    | IterationEvent
    | JudgedEvent
    | LatencyEvent
    | FaultEvent
    | EndEvent
)

_CLASSES: dict[str, type[Any]] = {
    cls.name: cls
    for cls in (
        StartEvent,
        StateEvent,
        ProgressEvent,
        IterationEvent,
        JudgedEvent,
        LatencyEvent,
        FaultEvent,
        EndEvent,
    )
}


def parse_event(line: str | bytes) -> Event | None:
    """Read one line of the controller's event stream.

    Parameters
    ----------
    line : str or bytes
        One JSON object with the key ``event``.

    Returns
    -------
    Event or None
        None for a kind of event that this version does not know, so that a
        newer controller can still be followed.

    Raises
    ------
    EventError
        If the line is not a JSON object, or lacks a key.

    Examples
    --------
    >>> parse_event('{"event": "fault", "reason": "node 2 is silent"}')
    FaultEvent(reason='node 2 is silent')
    """
    try:
        data = json.loads(line)
    except (ValueError, UnicodeDecodeError) as error:
        message = f"not a JSON object: {line!r}"
        raise EventError(message) from error
    if not isinstance(data, dict) or not isinstance(data.get("event"), str):
        message = f'not an object with the key "event": {line!r}'
        raise EventError(message)
    cls = _CLASSES.get(data["event"])
    if cls is None:
        return None
    return _build(cls, data)


def event_payload(event: Event) -> dict[str, Any]:
    """Return the JSON object of an event, as `parse_event` reads it.

    Examples
    --------
    >>> event_payload(FaultEvent("node 2 is silent"))
    {'event': 'fault', 'reason': 'node 2 is silent'}
    """
    return {"event": event.name, **asdict(event)}


def parse_histogram(data: dict[str, Any]) -> Histogram:
    """Return the histogram of a JSON object with quantiles and bins."""
    bins = tuple((float(upper), int(count)) for upper, count in data.get("bins", ()))
    return Histogram(
        float(data["p50"]), float(data["p99"]), float(data["p999"]), float(data["max"]), bins
    )


def _build(cls: type[Any], data: dict[str, Any]) -> Event:
    values: dict[str, Any] = {}
    for field in fields(cls):
        if field.name in data:
            values[field.name] = data[field.name]
        elif field.default is MISSING:
            message = f'event "{data["event"]}" lacks the key "{field.name}": {data!r}'
            raise EventError(message)
    try:
        if cls is StartEvent:
            values["axis_names"] = tuple(values["axis_names"])
            values["input_units"] = tuple(values.get("input_units", ()))
            report = values.get("rt")
            values["rt"] = _real_time_report(report) if report else None
        elif cls is IterationEvent:
            for name in ("axes_tracking_inf_m", "axes_tracking_rms_m"):
                values[name] = tuple(values.get(name) or ())
        elif cls is LatencyEvent:
            values = {key: parse_histogram(value) for key, value in values.items()}
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        message = f'event "{data["event"]}" is malformed ({error}): {data!r}'
        raise EventError(message) from error
    event: Event = cls(**values)
    return event


def _real_time_report(data: dict[str, Any]) -> RealTimeReport:
    return RealTimeReport(
        policy=str(data.get("policy", "")),
        priority=int(data.get("priority") or 0),
        mlock=bool(data.get("mlock", False)),
        kernel=str(data.get("kernel", "")),
        notes=tuple(str(note) for note in data.get("notes", ())),
    )

"""Events of the running controller, as typed classes.

``ilc-rt run --events`` prints one JSON object per line, and publishes the same objects on Zenoh.
`parse_event` converts them to the classes here.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any, ClassVar, get_args

from ilc_rt.figures import Figures
from ilc_rt.lateness import (
    AnswerTimes,
    LateCounts,
    LateCycle,
    StageSpans,
    parse_answers,
    parse_both_stages,
    parse_counts,
    parse_late_cycle,
    parse_stages,
)

#: Version of the events that this package knows: within one, fields are only added.
SCHEMA = 1


class EventError(ValueError):
    """A line that is not an event of the controller."""


@dataclass(frozen=True, slots=True)
class RealTimeReport:
    """Real-time settings granted to the servo thread by the operating system.

    `awake` is True if the processors are kept from sleeping deeply, `cpu` the processor that the
    thread has to itself, of all in the program, and `spin_us` the time before a tick for which it
    busy-waits.
    """

    policy: str = ""
    priority: int = 0
    mlock: bool = False
    kernel: str = ""
    notes: tuple[str, ...] = ()
    awake: bool = False
    cpu: int | None = None
    spin_us: float = 0.0


@dataclass(frozen=True, slots=True)
class Histogram:
    """Quantiles and counts of a duration, in microseconds.

    `bins` holds ``(upper bound, count)`` pairs, lowest first.
    """

    p50: float
    p99: float
    p999: float
    max: float
    bins: tuple[tuple[float, int], ...] = ()


@dataclass(frozen=True, slots=True)
class StartEvent:
    """Start of a campaign, with everything that is constant during it.

    `iterations` counts all runs of the campaign, including those before `first_index` of a resumed
    one; `schema` is the version of the events.
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
    ctl: str | None = None
    rt: RealTimeReport | None = None
    schema: int = SCHEMA


@dataclass(frozen=True, slots=True)
class StateEvent:
    """The campaign entered a state, e.g. ``"running"`` or ``"returning"``."""

    name: ClassVar[str] = "state"
    state: str
    iteration: int | None = None


@dataclass(frozen=True, slots=True)
class InputState:
    """A digital input of the cell; `use` is "guard", "start", "stop" or "limit".

    `on` is True for a closed guard, a pressed button and a limit switch that is reached, None
    before the input is known.
    """

    name: str
    use: str
    on: bool | None = None


@dataclass(frozen=True, slots=True)
class InputsEvent:
    """Digital inputs have changed; `inputs` has all of the cell, in their order."""

    name: ClassVar[str] = "inputs"
    inputs: tuple[InputState, ...]


@dataclass(frozen=True, slots=True)
class DriveState:
    """State of the drive of an axis.

    `state` is that of CiA 402 in words, e.g. ``"operation enabled"``, None before it is known.
    """

    axis: str
    state: str | None = None


@dataclass(frozen=True, slots=True)
class DrivesEvent:
    """A drive has changed its state; `drives` has all of the cell, in the order of the axes."""

    name: ClassVar[str] = "drives"
    drives: tuple[DriveState, ...]


@dataclass(frozen=True, slots=True)
class ProgressEvent:
    """Progress of the run."""

    name: ClassVar[str] = "progress"
    iteration: int
    sample: int
    n_samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class IterationEvent(Figures):
    """One run is over and in the library, with its figures.

    `id` is the key of the run in the library, `index` counts the runs of the campaign from 0,
    `digest` is the SHA-256 of its arrays. An older controller does not tell the `campaign`.
    """

    name: ClassVar[str] = "iteration"
    id: int
    index: int
    digest: str = ""
    campaign: str | None = None


@dataclass(frozen=True, slots=True)
class JudgedEvent:
    """Decision of the law on a run that was already published, as it was still computing."""

    name: ClassVar[str] = "judged"
    id: int
    index: int
    rolled_back: bool
    learning_off: bool
    remark: str | None = None
    campaign: str | None = None


@dataclass(frozen=True, slots=True)
class DriftEvent:
    """A frozen input does not fit the machine any more: its error has grown too far.

    `ratio` is the error of run `index` over that of the run the input was taken from, `origin`;
    None if that one had no error. `relearned_in` is the campaign in which learning starts again.
    """

    name: ClassVar[str] = "drift"
    index: int
    allowed: float
    origin: str
    ratio: float | None = None
    relearned_in: str | None = None


@dataclass(frozen=True, slots=True)
class RecordingEvent:
    """A recording begins in `file`; with a `reason`, it has lost records or ends early.

    `lost` counts the records lost so far. The runs go on in any case.
    """

    name: ClassVar[str] = "recording"
    file: str
    lost: int
    reason: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LateEvent(LateCycle):
    """A servo cycle lost its deadline; `count` is the number of such cycles since the last event.

    There is about one event a second, and one for every cycle that is worse than all before.
    """

    name: ClassVar[str] = "late"
    iteration: int
    count: int


@dataclass(frozen=True, slots=True)
class LatencyEvent:
    """Timing of the servo loop.

    `wake_late_us`, `receive_us`, `control_us` and `send_us` are the stages of its cycles,
    `execution_us` the last three together. `late` counts cycles that lost their deadline; `worst`
    is the worst of them, `good` one in the middle of the others, and `file` tells more by
    ``ilc-rt why``.
    """

    name: ClassVar[str] = "latency"
    wake_late_us: Histogram
    execution_us: Histogram
    receive_us: Histogram | None = None
    control_us: Histogram | None = None
    send_us: Histogram | None = None
    answers: tuple[AnswerTimes, ...] = ()
    preemptions: int = 0
    minor_faults: int = 0
    major_faults: int = 0
    late: LateCounts | None = None
    worst: LateCycle | None = None
    good: StageSpans | None = None
    file: str | None = None


@dataclass(frozen=True, slots=True)
class LastCycles:
    """Servo cycles before a stop, oldest first; one row per cycle, one column per axis.

    `missing` is True for a cycle whose measurement has not arrived.
    """

    first_sync: int | None
    reference_m: tuple[tuple[float, ...], ...]
    input: tuple[tuple[float, ...], ...]
    encoder_m: tuple[tuple[float, ...], ...]
    tool_m: tuple[tuple[float, ...], ...]
    missing: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class FaultEvent:
    """Reason of a stop of the axes: a sentence, and the same in fields.

    `kind` is the cause, e.g. ``"following_error"``; `axis` and `node` give the place, `code` is a
    number defined by the kind, e.g. an emergency code, `value` is the value found and `limit` the
    allowed one, in `unit`. `input` is the name of a digital input that caused it. `late` is the
    cycle that lost its deadline before the stop, if one did.
    """

    name: ClassVar[str] = "fault"
    reason: str
    kind: str = ""
    axis: str | None = None
    node: int | None = None
    input: str | None = None
    code: int | None = None
    value: float | None = None
    limit: float | None = None
    unit: str | None = None
    late: LateCycle | None = None
    cycles: LastCycles | None = None


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
    | InputsEvent
    | DrivesEvent
    | ProgressEvent
    | IterationEvent
    | JudgedEvent
    | DriftEvent
    | LateEvent
    | LatencyEvent
    | RecordingEvent
    | FaultEvent
    | EndEvent
)

_CLASSES: dict[str, type[Any]] = {cls.name: cls for cls in get_args(Event)}


def parse_event(line: str | bytes) -> Event | None:
    """Read one line of the controller's event stream.

    Parameters
    ----------
    line : str or bytes
        One JSON object with the key ``event``.

    Returns
    -------
    Event or None
        None for an unknown kind of event, so that a newer controller can still be followed.

    Raises
    ------
    EventError
        If the line is not a JSON object, or lacks a key.

    Examples
    --------
    >>> parse_event('{"event": "state", "state": "running", "iteration": 3}')
    StateEvent(state='running', iteration=3)
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
    >>> event_payload(StateEvent("running", 3))
    {'event': 'state', 'state': 'running', 'iteration': 3}
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
            values |= {key: tuple(v) for key, v in values.items() if isinstance(v, list)}
        elif cls is InputsEvent:
            values["inputs"] = tuple(
                InputState(str(one["name"]), str(one["use"]), one.get("on"))
                for one in values["inputs"]
            )
        elif cls is DrivesEvent:
            values["drives"] = tuple(
                DriveState(str(one["axis"]), one.get("state")) for one in values["drives"]
            )
        elif cls is FaultEvent:
            values["cycles"] = _last_cycles(values.get("cycles"))
            values["late"] = parse_late_cycle(values.get("late"))
        elif cls is LateEvent:
            values |= parse_both_stages(values)
        elif cls is LatencyEvent:
            values |= _timing(values)
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        message = f'event "{data["event"]}" is malformed ({error}): {data!r}'
        raise EventError(message) from error
    event: Event = cls(**values)
    return event


def _last_cycles(data: dict[str, Any] | None) -> LastCycles | None:
    if data is None:
        return None
    rows = {
        key: tuple(tuple(float(value) for value in row) for row in data[key])
        for key in ("reference_m", "input", "encoder_m", "tool_m")
    }
    missing = tuple(bool(value) for value in data["missing"])
    return LastCycles(first_sync=data["first_sync"], missing=missing, **rows)


def _timing(data: dict[str, Any]) -> dict[str, Any]:
    """Return the fields of a `LatencyEvent` that are objects; older controllers send two."""
    found: dict[str, Any] = {
        key: parse_histogram(data[key])
        for key in ("wake_late_us", "execution_us", "receive_us", "control_us", "send_us")
        if data.get(key) is not None
    }
    found["late"] = parse_counts(data.get("late"))
    found["answers"] = parse_answers(data.get("answers", ()))
    found["worst"] = parse_late_cycle(data.get("worst"))
    good = data.get("good")
    found["good"] = None if good is None else parse_stages(good)
    return found


def _real_time_report(data: dict[str, Any]) -> RealTimeReport:
    return RealTimeReport(
        policy=str(data.get("policy", "")),
        priority=int(data.get("priority") or 0),
        mlock=bool(data.get("mlock", False)),
        awake=bool(data.get("awake", False)),
        cpu=data.get("cpu"),
        spin_us=float(data.get("spin_us") or 0.0),
        kernel=str(data.get("kernel", "")),
        notes=tuple(str(note) for note in data.get("notes", ())),
    )

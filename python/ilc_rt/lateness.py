"""Servo cycles that lost their deadline: their facts, from events, and a sentence."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from ilc_rt.text import printable

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True, slots=True)
class StageSpans:
    """Times of the stages of a servo cycle, in microseconds.

    `wake_us` is the lateness of its start, `receive_us` the time for taking messages,
    `control_us` for computing the commands, `send_us` for passing them to the bus; `slack_us` is
    left until the next cycle.
    """

    wake_us: float
    receive_us: float
    control_us: float
    send_us: float
    slack_us: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LateCycle:
    """A servo cycle that lost its deadline, and the cause.

    `cause` is "wake_up", "preemption", "receive", "computation" or "send"; `axis` and `node` are
    those that were waited for, if it was one. `missed` cycles were skipped because of it, which
    may use `allowed_us`. `stages` are its stages, `usual` the medians of those before it;
    `answer_us` is the time from SYNC to the answer that was waited for. `refused` is True if the
    bus did not take every frame; the last three count what the host did to the loop's thread.
    """

    tick: int
    cause: str
    stages: StageSpans
    usual: StageSpans
    allowed_us: float = 0.0
    missed: int = 0
    axis: str | None = None
    node: int | None = None
    answer_us: float | None = None
    usual_answer_us: float | None = None
    refused: bool = False
    preemptions: int = 0
    minor_faults: int = 0
    major_faults: int = 0


@dataclass(frozen=True, slots=True)
class LateCounts:
    """Late servo cycles by their causes; `missed` cycles were skipped because of them."""

    wake_up: int = 0
    preemption: int = 0
    receive: int = 0
    computation: int = 0
    send: int = 0
    missed: int = 0


@dataclass(frozen=True, slots=True)
class AnswerTimes:
    """Answer times of a node after SYNC, in microseconds; `axis` is None for the tool encoder."""

    node: int
    count: int
    p50_us: float
    p99_us: float
    max_us: float
    axis: str | None = None


def parse_counts(data: dict[str, Any] | None) -> LateCounts | None:
    """Return the counts of a JSON object, if there is one."""
    if data is None:
        return None
    known = [field.name for field in fields(LateCounts) if field.name in data]
    return LateCounts(**{key: int(data[key]) for key in known})


def parse_answers(rows: Iterable[dict[str, Any]]) -> tuple[AnswerTimes, ...]:
    """Return the answers of each node of JSON objects."""
    return tuple(
        AnswerTimes(
            int(one["node"]), int(one["count"]), float(one["p50_us"]), float(one["p99_us"]),
            float(one["max_us"]), one.get("axis"),
        )
        for one in rows
    )  # fmt: skip


def parse_stages(data: dict[str, Any]) -> StageSpans:
    """Return the stages of a JSON object."""
    return StageSpans(**{field.name: float(data[field.name]) for field in fields(StageSpans)})


def parse_both_stages(cycle: dict[str, Any]) -> dict[str, StageSpans]:
    """Return the stages of a cycle, and the usual ones, of a JSON object."""
    return {key: parse_stages(cycle[key]) for key in ("stages", "usual")}


def parse_late_cycle(data: dict[str, Any] | None) -> LateCycle | None:
    """Return the late cycle of a JSON object, if there is one."""
    if data is None:
        return None
    known = {field.name: data[field.name] for field in fields(LateCycle) if field.name in data}
    return LateCycle(**(known | parse_both_stages(data)))


def late_sentence(cycle: LateCycle) -> str:
    """Return who was late in a cycle, without a full stop.

    Examples
    --------
    >>> usual = StageSpans(wake_us=12.0, receive_us=30.0, control_us=200.0, send_us=40.0)
    >>> slow = StageSpans(wake_us=12.0, receive_us=30.0, control_us=931.0, send_us=40.0)
    >>> late_sentence(LateCycle(tick=7, cause="computation", stages=slow, usual=usual, missed=1))
    'the computation took 931 µs (usually 200); 1 cycle was skipped'
    """
    what = _causes(cycle).get(cycle.cause, printable(cycle.cause))
    if cycle.missed:
        skipped = "1 cycle was" if cycle.missed == 1 else f"{cycle.missed} cycles were"
        what = f"{what}; {skipped} skipped"
    return what


def _causes(cycle: LateCycle) -> dict[str, str]:
    """Return the words for each cause that a cycle may have."""
    stages, usual = cycle.stages, cycle.usual
    whole, usually = (
        sum((row.wake_us, row.receive_us, row.control_us, row.send_us)) for row in (stages, usual)
    )
    return {
        "wake_up": f"the host woke the loop {stages.wake_us:.0f} µs late "
        f"(usually {usual.wake_us:.0f})",
        "preemption": "the host gave the processor to another thread: the cycle took "
        f"{whole:.0f} µs (usually {usually:.0f})",
        "receive": _received(cycle, whole),
        "computation": f"the computation took {stages.control_us:.0f} µs "
        f"(usually {usual.control_us:.0f})",
        "send": "the bus did not take every frame: its queue was full"
        if cycle.refused
        else f"the bus took the commands late: sending took {stages.send_us:.0f} µs "
        f"(usually {usual.send_us:.0f})",
    }


def _received(cycle: LateCycle, whole_us: float) -> str:
    place = "tool" if cycle.axis is None else printable(cycle.axis)
    sender = None if cycle.node is None else f"node {cycle.node} ({place})"
    if whole_us > cycle.allowed_us or cycle.missed:
        whose = f", most of it for {sender}" if sender else ""
        took = f"receiving took {cycle.stages.receive_us:.0f} µs"
        return f"{took} (usually {cycle.usual.receive_us:.0f}){whose}"
    if sender is None:
        return "the bus brought all answers after the next SYNC"
    usual = "" if cycle.usual_answer_us is None else f" (usually {cycle.usual_answer_us:.0f})"
    if cycle.answer_us is None:
        return f"{sender} did not answer"
    return f"{sender} answered {cycle.answer_us:.0f} µs after SYNC{usual}"

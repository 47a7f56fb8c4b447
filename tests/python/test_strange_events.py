"""Events and batches with every kind of value, as any program on the network can publish them.

They are refused at the border, or can be drawn by every view.
"""

from __future__ import annotations

import dataclasses
import io
import json
import random
import re
import types
import typing
from typing import Any

import pytest
from rich.console import Console
from watched_fixture import START

from ilc_rt import events
from ilc_rt.bridge.signals import CELLS_MAX, Cells
from ilc_rt.commands.monitor import _View
from ilc_rt.dashboard import charts
from ilc_rt.dashboard.model import CellModel
from ilc_rt.dashboard.status import axis_words, run_words
from ilc_rt.events import EventError, StartEvent, parse_event
from ilc_rt.misfit import misfit
from ilc_rt.monitor import Message
from ilc_rt.terminal import CellsView

N_MESSAGES = 3000
NUMBERS = [0.0, -1.0, 5e-324, 1e-9, 0.002, 1.5, 1e14, -1e14, 1e200, -1e299]
INTEGERS = [0, -1, 1, 2, 10**6, 2**31, 2**53, 2**63, 10**290]
TEXTS = ["", "x", "running", "bringing_up", "c1", "\x1b[2J", "a" * 500, "機", "m", "rad", "N", "$a",
         "tcp", "encoder", "none", "frozen", "fault", "completed", "realtime"]  # fmt: skip
KINDS = [one for name, one in sorted(vars(events).items()) if re.fullmatch(r"[A-Z]\w+Event", name)]


class Stranger:
    """Makes events of every kind, of values of the right types."""

    def __init__(self) -> None:
        self._random = random.Random(7)

    def message(self) -> Message | None:
        """Return a message that passes the border; None if it does not."""
        if self._random.random() < 0.3:
            return Message("gantry", "servo", self.batch())
        kind = self._random.choice(KINDS)
        payload = {"event": kind.name, **self._object(kind)}
        try:
            event = parse_event(json.dumps(payload))
        except EventError:
            return None
        assert event is not None
        return None if misfit(event) else Message("gantry", "state", payload, event)

    def batch(self) -> dict[str, Any]:
        """Return a batch of three cycles."""
        pick, n_axes = self._random.choice, self._random.choice([1, 2, 2, 3])
        places = [[None, [0, k], [k, 10**12], [1, -5], ["a", {}], [10**300, 2]] for k in range(3)]
        row = [pick([1, 1e14, 1e299, 0.0, 10**400, float("nan"), None]) for _ in range(n_axes)]
        return {
            "schema": 1, "first_sync": pick([0, 3, 6, 2**53 - 1, 10**400, -3, True]),
            "iteration_and_sample": [*map(pick, places)], "reference_m": [row] * 3,
            "encoder_m": [row] * 3, "input": [[0.0] * n_axes] * 3,
            "tool_m": pick([None, [row] * 3]),
        }  # fmt: skip

    def _object(self, kind: Any) -> dict[str, Any]:
        hints = typing.get_type_hints(kind)
        return {one.name: self._value(hints[one.name]) for one in dataclasses.fields(kind)}

    def _value(self, hint: Any) -> Any:
        pick, arguments = self._random.choice, typing.get_args(hint)
        if typing.get_origin(hint) in {typing.Union, types.UnionType}:
            return self._value(pick(arguments))
        if typing.get_origin(hint) is tuple:
            many = arguments[:1] * pick([0, 1, 2, 2, 3, 70]) if Ellipsis in arguments else arguments
            return [self._value(one) for one in many]
        if dataclasses.is_dataclass(hint):
            return self._object(hint)
        # Mostly what passes, so that something does.
        is_usual = self._random.random() < 0.95
        choices = {
            int: INTEGERS[:6] if is_usual else INTEGERS,
            float: NUMBERS[3:6] if is_usual else NUMBERS,
            str: TEXTS[1:] if is_usual else TEXTS,
            bool: [True, False],
        }
        return pick(choices.get(hint, [None]))


def look(cell: CellModel) -> None:
    """Draw a cell everywhere."""
    for option in (
        charts.runs(cell), charts.timing(cell), charts.late_cycle(cell),
        charts.contour(cell, cell.last_run)[0], charts.inputs(cell, cell.last_run),
        *(charts.live(cell, what) for what in ("error", "reference", "input")),
    ):  # fmt: skip
        json.dumps(option, allow_nan=False)
    for axis in range(cell.n_axes):
        axis_words(cell, axis, 1.0)
    run_words(cell)
    Console(file=io.StringIO(), width=60).print(CellsView([cell]))


def test_no_value_of_a_stranger_ends_a_view(capsys: pytest.CaptureFixture[str]) -> None:
    stranger, cell, bridged, view = Stranger(), CellModel("gantry"), Cells(), _View(events=False)
    passed = set()
    for number in range(N_MESSAGES):
        message = stranger.message()
        if message is None:
            continue
        passed.add(type(message.event))
        cell.apply(message, float(number), float(number))
        view.show(message)
        for row in bridged.rows(message):
            # As Foxglove counts the time, and as JSON has numbers.
            assert 0 < row.time_s * 1e9 < 2**63
            json.dumps(row.axes, allow_nan=False)
        if number % 5 == 0:
            look(cell)
    assert len(passed) == len(KINDS) + 1
    assert len(capsys.readouterr().out) > 1000


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"cycle_s": 5e-324}, "cycle_s = 4.94066e-324: 1e-06 to 1 s"),
        ({"cycle_s": -0.002}, "1e-06 to 1 s"),
        ({"cycle_s": 1e200}, "is not of its type or range"),
        ({"n_samples": 0}, "n_samples = 0: 1 or more"),
        ({"axis_names": []}, "0 axes: 1 to 64"),
        ({"axis_names": ["x"] * 65}, "65 axes: 1 to 64"),
        ({"input_units": ["m"]}, "1 input_units of 2 axes"),
        ({"input_units": ["m", ""]}, "input_units: ''"),
        ({"first_index": 10**290}, "first_index = 1e290 is not of its type or range"),
    ],
)
def test_a_start_that_no_controller_sends_is_refused(change: dict[str, Any], told: str) -> None:
    start = parse_event(json.dumps(START | change))
    assert isinstance(start, StartEvent)
    assert told in str(misfit(start))
    good = parse_event(json.dumps(START))
    assert good is not None
    assert misfit(good) is None


def test_parts_of_lists_are_looked_at() -> None:
    inputs = {"event": "inputs", "inputs": [{"name": "door", "use": "stop", "on": 3}]}
    event = parse_event(json.dumps(inputs))
    assert event is not None
    assert "inputs = " in str(misfit(event))


def test_strangers_of_many_names_do_not_fill_a_bridge() -> None:
    cells, batch = Cells(), Stranger().batch()
    for number in range(2 * CELLS_MAX):
        list(cells.rows(Message(f"cell-{number}", "servo", batch)))
    assert len(cells._signals) == CELLS_MAX


def test_axes_of_three_units_share_two_scales() -> None:
    cell = CellModel("mixed")
    names = {"axis_names": ["x", "y", "z"], "n_axes": 3, "input_units": ["m", "N", "rad/s"]}
    event = parse_event(json.dumps(START | names))
    assert event is not None
    cell.apply(Message("mixed", "state", {}, event), 1.0, 1.0)
    option = charts.live(cell, "input")
    assert [one["yAxisIndex"] for one in option["series"]] == [0, 1, 1]
    assert len(option["yAxis"]) == 2

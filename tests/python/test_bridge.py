"""Bridges to PlotJuggler and Foxglove, each heard by a reader of its protocol."""

from __future__ import annotations

import json
import math
import socket
import struct
import sys
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET

import pytest
from ports_fixture import free_port
from processes_fixture import Process
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from ilc_rt import BadInputError, Cell
from ilc_rt.bridge import foxglove, plotjuggler
from ilc_rt.bridge.signals import Cells, Signals
from ilc_rt.events import FaultEvent, parse_event
from ilc_rt.monitor import Message
from ilc_rt.sources import Memory

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from ilc_rt import CampaignResult

CYCLE_S = 0.002
N = 25


def batch(first: int = 100, iteration: int | None = 3) -> Message:
    """Return a batch as the controller publishes it: an axis that is 10 um late, one at rest."""
    rows = [[0.001 * index, 0.5] for index in range(N)]
    payload: dict[str, Any] = {
        "event": "servo",
        "first_sync": first,
        "iteration_and_sample": [None if iteration is None else [iteration, k] for k in range(N)],
        "reference_m": rows,
        "input": [[1e-4, 0.0]] * N,
        "encoder_m": [[x - 1e-5, y] for x, y in rows],
        "tool_m": [[x - 3e-5, None] for x, y in rows],
    }
    return Message("gantry", "servo", payload)


def ended(index: int = 3) -> Message:
    """Return the end of a run as the controller publishes it."""
    payload = {
        "id": 7, "index": index, "tracking_inf_m": 4e-5, "tracking_rms_m": 2e-5,
        "contour_inf_m": 1e-5, "contour_rms_m": 5e-6, "overruns": 0, "update_ms": 0.3,
    }  # fmt: skip
    event = parse_event(json.dumps({"event": "iteration", **payload}))
    return Message("gantry", "iteration", payload, event)


@pytest.fixture
def cell(gantry: Path) -> Cell:
    return Cell.load(gantry)


def test_a_cycle_has_its_time_and_its_errors(cell: Cell) -> None:
    now = [1000.0]
    signals = Signals(cell.axis_names, cell.axis_units, cell.cycle_s, lambda: now[0])
    rows = list(signals.rows(batch()))
    assert len(rows) == N
    assert rows[-1].time_s == pytest.approx(1000.0 - CYCLE_S)
    assert rows[0].iteration == 3
    assert rows[2].axes["x"] == {
        "reference_m": 0.002,
        "encoder_m": 0.002 - 1e-5,
        "tool_m": 0.002 - 3e-5,
        "input": 1e-4,
        "encoder_error_m": pytest.approx(1e-5),
        "tool_error_m": pytest.approx(3e-5),
    }
    # Without a measurement at the tool there is no error there.
    assert rows[2].axes["y"] == {
        "reference_m": 0.5, "encoder_m": 0.5, "input": 0.0, "encoder_error_m": 0.0
    }  # fmt: skip


def test_cycles_are_equidistant_though_batches_arrive_late(cell: Cell) -> None:
    now = [1000.0]
    signals = Signals(cell.axis_names, cell.axis_units, cell.cycle_s, lambda: now[0])
    times = [row.time_s for row in signals.rows(batch(100))]
    now[0] += 0.05 + 0.03
    times += [row.time_s for row in signals.rows(batch(100 + N, iteration=None))]
    steps = [b - a for a, b in pairwise(times)]
    assert steps == pytest.approx([CYCLE_S] * (2 * N - 1))
    # A loop that starts again counts from zero.
    now[0] += 60.0
    assert next(signals.rows(batch(0))).time_s == pytest.approx(now[0] - N * CYCLE_S)


def test_who_missed_the_start_sees_axes_by_number() -> None:
    rows = list(Cells().rows(batch()))
    assert list(rows[0].axes) == ["0", "1"]
    assert rows[1].time_s - rows[0].time_s == pytest.approx(CYCLE_S, abs=1e-6)


def test_a_library_names_the_axes_for_who_missed_the_start(finished: CampaignResult) -> None:
    with Memory([finished.library]) as memory:
        cells = Cells(recall=memory.campaign)
        rows = list(cells.rows(batch()))
        assert list(rows[0].axes) == ["x", "y"]
        assert memory.campaign("press") == []
        other = Message("press", "servo", batch().payload)
        assert list(next(iter(cells.rows(other))).axes) == ["0", "1"]


@pytest.mark.parametrize(
    "payload",
    [
        {}, {"first_sync": "1", "iteration_and_sample": [[0, 0]]},
        {"first_sync": 1, "iteration_and_sample": []},
        {"first_sync": 1, "iteration_and_sample": [3], "encoder_m": [["a", True, None]]},
        {"first_sync": 1, "iteration_and_sample": [[0, 0], [0, 1]], "encoder_m": 3, "input": [[1]]},
    ],
)  # fmt: skip
def test_a_strange_batch_hurts_nobody(payload: dict[str, Any]) -> None:
    for row in Cells().rows(Message("gantry", "servo", payload)):
        assert all(math.isfinite(value) for axis in row.axes.values() for value in axis.values())


def test_plotjuggler_gets_one_flat_object_a_cycle(cell: Cell) -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as reader:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(30.0)
        with plotjuggler.PlotJuggler("127.0.0.1", reader.getsockname()[1], cell) as bridge:
            assert bridge.show(batch()) == N
            assert bridge.show(ended()) == 1
        objects = [json.loads(reader.recv(65536)) for _ in range(N + 1)]
    steps = [b["timestamp"] - a["timestamp"] for a, b in pairwise(objects[:-1])]
    assert steps == pytest.approx([CYCLE_S] * (N - 1), abs=1e-6)
    assert objects[0]["gantry"]["run"] == 3
    assert objects[0]["gantry"]["x"]["tool_error_m"] == pytest.approx(3e-5)
    assert objects[-1]["gantry"]["iteration"]["tracking_rms_m"] == 2e-5


def test_plotjuggler_may_be_started_later(cell: Cell) -> None:
    with plotjuggler.PlotJuggler("127.0.0.1", free_port(), cell) as bridge:
        assert [bridge.show(batch(100 + N * k)) for k in range(3)] == [N, N, N]
    with pytest.raises(BadInputError, match=r"no\.such\.host\.invalid"):
        plotjuggler.PlotJuggler("no.such.host.invalid")


@pytest.fixture
def server(cell: Cell) -> Iterator[foxglove.Foxglove]:
    with foxglove.Foxglove(port=0, described=cell) as server:
        yield server


def test_foxglove_reads_signals_figures_and_words(server: foxglove.Foxglove) -> None:
    """A client of the WebSocket protocol: channels, a subscription, messages with their times."""
    fault = FaultEvent("axis x (node 1): following error 3 mm, limit 2 mm")
    topics = {"/gantry/x", "/gantry/y", "/gantry/iteration", "/gantry/log"}
    for message in (batch(), ended(), Message("gantry", "fault", {}, fault)):
        server.show(message)
    with connect(server.address, subprotocols=[Subprotocol("foxglove.sdk.v1")]) as client:
        channels: dict[str, dict[str, Any]] = {}
        while set(channels) != topics:
            said = json.loads(client.recv(timeout=30.0))
            for channel in said.get("channels", []):
                channels[channel["topic"]] = channel
        assert json.loads(channels["/gantry/x"]["schema"])["properties"]["encoder_error_m"] == {
            "type": "number"
        }
        assert channels["/gantry/log"]["schemaName"] == "foxglove.Log"
        wanted = [
            {"id": number, "channelId": channels[topic]["id"]}
            for number, topic in enumerate(sorted(topics))
        ]
        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        seen: dict[str, Any] = {}
        first = 100 + N
        # The subscription takes effect some time after it was sent.
        while set(seen) != topics:
            server.show(batch(first))
            server.show(ended())
            server.show(Message("gantry", "fault", {}, fault))
            first += N
            try:
                while set(seen) != topics:
                    data = client.recv(timeout=0.5)
                    if isinstance(data, bytes) and data[0] == 1:
                        number, log_time = struct.unpack_from("<IQ", data, 1)
                        seen[sorted(topics)[number]] = (log_time, json.loads(data[13:]))
            except TimeoutError:
                continue
    log_time, signals = seen["/gantry/x"]
    assert log_time > 1.7e18
    assert signals["encoder_error_m"] == pytest.approx(1e-5)
    assert seen["/gantry/iteration"][1]["tracking_rms_m"] == 2e-5
    assert seen["/gantry/log"][1]["message"] == fault.reason
    assert seen["/gantry/log"][1]["level"] == 4


def test_layouts_name_what_is_sent(cell: Cell) -> None:
    rows = list(Cells(cell).rows(batch()))
    # A measurement at the tool of y is absent from this batch, not from a cell.
    known = {f"gantry/{axis}/{name}" for axis, row in rows[0].axes.items() for name in row}
    known |= {"gantry/y/tool_error_m", "gantry/iteration/tracking_rms_m"}
    curves = {curve.get("name") for curve in ET.fromstring(plotjuggler.layout(cell)).iter("curve")}
    assert curves <= known
    assert len(curves) == 7
    described = json.loads(foxglove.layout(cell))
    paths = {
        path["value"].removeprefix("/").replace(".", "/")
        for panel in described["configById"].values()
        for path in panel.get("paths", [])
    }
    assert paths == curves


def test_the_verbs_write_a_layout_and_end(gantry: Path, tmp_path: Path) -> None:
    for tool, file in (("plotjuggler", "l.xml"), ("foxglove", "l.json")):
        port = free_port(socket.SOCK_STREAM if tool == "foxglove" else socket.SOCK_DGRAM)
        where = ["--port", str(port)] if tool == "foxglove" else ["--to", f"127.0.0.1:{port}"]
        argv = [sys.executable, "-m", "ilc_rt.cli", "bridge", tool, gantry, *where, "--layout",
                file, "--no-scouting", "--timeout", "0.2"]  # fmt: skip
        process = Process(argv, tmp_path)
        try:
            assert process.end() == 0, process.errors
        finally:
            process.close()
        assert (tmp_path / file).stat().st_size > 500


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["plotjuggler", "gantry", "--layout", "l.xml"], "needs the TOML file"),
        (["plotjuggler", "--to", "here:0"], "a port from 1 to 65535"),
        (["plotjuggler", "--to", ":9870"], "HOST or HOST:PORT"),
    ],
)
def test_what_cannot_be_bridged_is_refused(arguments: list[str], told: str, tmp_path: Path) -> None:
    process = Process([sys.executable, "-m", "ilc_rt.cli", "bridge", *arguments], tmp_path)
    try:
        assert process.end() == 2
    finally:
        process.close()
    assert told in process.errors[0]

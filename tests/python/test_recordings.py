"""Recordings: readable by other tools, after a kill and on a full disk; from Python, too."""

from __future__ import annotations

import json
import signal
import subprocess
from collections import Counter
from contextlib import suppress
from typing import TYPE_CHECKING

import can
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader
from processes_fixture import EXAMPLE, PATIENT, Bench, Process, program

from ilc_rt import Campaign, identify
from ilc_rt.events import RecordingEvent

if TYPE_CHECKING:
    from pathlib import Path


def replayed(path: Path) -> dict[str, object]:
    """Return the result of a replay."""
    ran = subprocess.run(
        [program("ilc-rt"), "replay", path, "--json", "-"],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert ran.returncode in {0, 1}, ran.stderr
    result: dict[str, object] = json.loads(ran.stdout)
    assert (ran.returncode == 0) == (result["difference"] is None)
    return result


def test_a_recording_from_python_is_read_by_the_makers_of_its_format(tmp_path):
    path = tmp_path / "gantry.mcap"
    campaign = Campaign(EXAMPLE, bus="loopback:", library=tmp_path / "library.db", record=path)
    events = list(campaign.events(2))
    assert [event.file for event in events if isinstance(event, RecordingEvent)] == [str(path)]
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        counts: Counter[str] = Counter()
        for schema, channel, message in reader.iter_messages():
            counts[channel.topic] += 1
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            known = json.loads(schema.data)["properties"]
            content = json.loads(message.data)
            if channel.topic not in {"/events", "/iterations"}:
                assert content.keys() <= known.keys(), channel.topic
            # Foxglove and PlotJuggler know plain types only.
            kinds = {each["type"] for each in known.values()}
            assert kinds <= {"integer", "number", "string", "boolean", "array"}
        attached = {each.name: each.data for each in reader.iter_attachments()}
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == sum(counts.values())
    assert counts["/cycle"] == counts["/axes/x"] == counts["/axes/y"] > 1000
    assert (counts["/iterations"], counts["/tables"]) == (2, 2)
    assert json.loads(attached["loop.json"])["axes"] == ["x", "y"]
    assert replayed(path)["cycles"] == counts["/cycle"]


def test_experiments_of_one_identification_have_a_file_each(tmp_path):
    for number in range(1, 3):
        assert identify._numbered(tmp_path / "a.mcap", number) == tmp_path / (
            "a.mcap" if number == 1 else "a-2.mcap"
        )
    assert identify._numbered(tmp_path, 2) == tmp_path
    assert identify._numbered(None, 2) is None


@pytest.mark.parametrize("name", ["candump", "asc"])
def test_exported_frames_are_read_by_python_can(tmp_path, name):
    path = tmp_path / "gantry.mcap"
    library = tmp_path / "library.db"
    list(Campaign(EXAMPLE, bus="loopback:", library=library, record=path).events(1))
    out = tmp_path / ("frames.log" if name == "candump" else "frames.asc")
    words = ["record", "export", path, "--format", name, "--output", out]
    subprocess.run([program("ilc-rt"), *words], check=True, timeout=120, capture_output=True)
    reader = can.CanutilsLogReader(out) if name == "candump" else can.ASCReader(out)
    messages = list(reader)
    table = tmp_path / "frames.csv"
    words = ["record", "export", path, "--format", "csv", "--output", table]
    subprocess.run([program("ilc-rt"), *words], check=True, timeout=120, capture_output=True)
    rows = [line.split(",") for line in table.read_text().splitlines()[1:]]
    assert len(messages) == len(rows) > 5000
    for message, (_, _, direction, _, identifier, data) in zip(messages, rows, strict=True):
        assert message.arbitration_id == int(identifier, 16)
        assert message.data.hex() == data.lower()
        assert message.is_rx == (direction == "received")


@pytest.fixture
def bench(tmp_path):
    with Bench(tmp_path) as bench:
        yield bench


def test_what_was_recorded_before_a_kill_opens_and_replays(bench):
    cell = bench.cell(short=True, more=PATIENT)
    bench.drives(cell)
    path = bench.folder / "killed.mcap"
    run = bench.controller(cell, "--record", path, "--simulated-drives", runs=1000)
    run.event(event="iteration", index=1)
    run.signal(signal.SIGKILL)
    run.end()
    result = replayed(path)
    assert (result["cut"], result["difference"]) == (True, None)
    # All but the last half second of two runs, of 1.1 s each.
    assert int(str(result["cycles"])) > 500
    topics = set()
    with path.open("rb") as file, suppress(EndOfFile):
        for _, channel, _ in NonSeekingReader(file).iter_messages(log_time_order=False):
            topics.add(channel.topic)
    assert {"/cycle", "/axes/x", "/frames", "/timing"} <= topics


def test_a_full_disk_ends_the_recording_and_not_the_run(bench, request):
    """A file size limit stands in for the disk: the runs go on and are kept."""
    cell = bench.cell(short=True)
    bench.drives(cell, "--lockstep")
    path = bench.folder / "full.mcap"
    # The shell inherits the ignored signal, so the write fails as on a full disk.
    limited = ["bash", "-c", 'trap "" XFSZ; ulimit -f 2000; exec "$@"', "bash"]
    controller = Process(
        [*limited, program("ilc-rt"), "run", cell, "--bus", bench.bus, "--iterations", "6",
         "--library", bench.library, "--events", "--no-telemetry", "--lockstep",
         "--record", path],
        bench.folder,
    )  # fmt: skip
    request.addfinalizer(controller.close)
    assert controller.end() == 0, controller.errors
    told = [event for event in controller.events if event["event"] == "recording"]
    assert [event["reason"] is None for event in told] == [True, False]
    assert "ends early" in told[1]["reason"]
    assert len(controller.errors) == 1
    assert "the run goes on" in controller.errors[0]
    assert len(bench.kept()) == 6
    result = replayed(path)
    assert (result["cut"], result["difference"]) == (True, None)
    assert int(str(result["cycles"])) > 500

"""Randomised trials of failures: kills, full disks, damaged files, babble, foreign nodes.

A few trials are made here, and many by `make trials` (`ILC_TRIALS`, a factor). Random draws depend
on the number of the trial alone.
"""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest
import zenoh
from ports_fixture import free_port
from processes_fixture import PATIENT, Bench, Process, goodbye, program

from ilc_rt import Library

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from ilc_rt import CampaignResult

FACTOR = int(os.environ.get("ILC_TRIALS", "1"))
BOTH_OFF = "1 (x) switch on disabled, 2 (y) switch on disabled"

pytestmark = pytest.mark.timeout(120 * FACTOR)


def trials(n: int) -> range:
    """Return the numbers of `n` trials, of more under `make trials`."""
    return range(n * FACTOR)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def complete(bench: Bench) -> list[str]:
    """Return the digests in the library; loading each run checks its arrays."""
    library = Library(str(bench.library))
    rows = library.list()
    for row in rows:
        library.load(row["id"])
    return [digest for _, _, digest in bench.kept()]


@pytest.mark.parametrize("trial", trials(2))
def test_a_kill_at_any_moment_loses_no_completed_run(bench: Bench, trial: int) -> None:
    """By kill -9, in lock-step: the library is intact, and the next start is clean."""
    cell = bench.cell(short=True)
    drives = bench.drives(cell, "--lockstep")
    controller = bench.controller(cell, "--lockstep", runs=10_000)
    controller.event(event="iteration", index=0)
    time.sleep(random.Random(trial).uniform(0.0, 1.0))
    controller.signal(signal.SIGKILL)
    assert controller.end() == -signal.SIGKILL
    told = [event["digest"] for event in controller.events if event["event"] == "iteration"]
    kept = complete(bench)
    # A run may be in the library before it is published.
    assert kept[: len(told)] == told
    assert len(kept) - len(told) in (0, 1)

    goodbye(drives)
    drives = bench.drives(cell, "--lockstep")
    again = bench.controller(cell, "--lockstep", "--resume", runs=len(kept) + 1)
    assert again.end() == 0, again.errors
    assert complete(bench)[: len(kept)] == kept
    assert BOTH_OFF in goodbye(drives)


@pytest.mark.parametrize("trial", trials(2))
def test_a_signal_at_any_moment_is_a_controlled_stop(bench: Bench, trial: int) -> None:
    """In real time, from bring-up to the fourth run: the axes stop, one reason, drives off."""
    draws = random.Random(trial)
    cell = bench.cell(short=True, more=PATIENT)
    drives = bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=100)
    time.sleep(draws.uniform(0.0, 6.0))
    number, status = draws.choice([(signal.SIGINT, 130), (signal.SIGTERM, 143)])
    controller.signal(number)
    assert controller.end() == status
    assert len(controller.errors) <= 1
    assert BOTH_OFF in goodbye(drives)
    assert not any("EMCY" in line for line in drives.said)


def test_a_full_disk_stops_the_campaign_and_keeps_what_was_kept(
    bench: Bench, request: pytest.FixtureRequest
) -> None:
    """A file size limit stands in for the disk: one sentence, axes at rest."""
    cell = bench.cell(short=True)
    drives = bench.drives(cell, "--lockstep")
    # The shell inherits the ignored signal, so the write fails as on a full disk.
    limited = ["bash", "-c", 'trap "" XFSZ; ulimit -f 400; exec "$@"', "bash"]
    controller = Process(
        [*limited, program("ilc-rt"), "run", cell, "--bus", bench.bus, "--iterations", "1000",
         "--library", bench.library, "--events", "--no-telemetry", "--lockstep"],
        bench.folder,
    )  # fmt: skip
    request.addfinalizer(controller.close)
    status = controller.end()
    assert 0 < status < 100, controller.said[-1]
    end = controller.events[-1]
    assert end["event"] == "end", controller.said
    assert "library.db" in end["reason"]
    assert len(controller.errors) <= 1, controller.errors
    assert BOTH_OFF in goodbye(drives)
    told = [event["digest"] for event in controller.events if event["event"] == "iteration"]
    kept = complete(bench)
    assert len(kept) >= 1
    assert kept[: len(told)] == told[: len(kept)]


@pytest.mark.parametrize("trial", trials(5))
def test_a_damaged_library_is_read_in_part_or_refused(
    finished: CampaignResult, tmp_path: Path, trial: int
) -> None:
    """A damaged file: an error of one line, or the intact part; never a crash."""
    draws = random.Random(trial)
    source = sqlite3.connect(finished.library)
    damaged = tmp_path / "damaged.db"
    source.execute("VACUUM INTO ?", (str(damaged),))
    source.close()
    content = bytearray(damaged.read_bytes())
    for _ in range(draws.randint(1, 30)):
        content[draws.randrange(len(content))] = draws.randrange(256)
    if draws.random() < 0.3:
        del content[draws.randrange(len(content)) :]
    damaged.write_bytes(content)
    try:
        library = Library(str(damaged))
        for row in library.list():
            library.load(row["id"])
    except (ValueError, OSError) as error:
        said = str(error)
    else:
        said = ""
    assert "\n" not in said
    for verb in (["list"], ["show", 1], ["export", 1, tmp_path / "run.csv"]):
        argv = [sys.executable, "-m", "ilc_rt.cli", "library", verb[0], damaged, *verb[1:]]
        if trial > 0 and FACTOR == 1:
            break
        done = subprocess.run(
            [str(word) for word in argv], capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode in (0, 1, 2)
        assert "Traceback" not in done.stderr


def test_babble_on_the_bus_leaves_idle_drives_as_they_were(bench: Bench) -> None:
    """Random datagrams, long and short: the drives continue, and a campaign runs on them after."""
    cell = bench.cell(short=True)
    drives = bench.drives(cell, "--lockstep")
    _, group, port = bench.bus.split(":")
    draws = random.Random(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as babbler:
        babbler.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        babbler.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        for _ in range(20_000 * FACTOR):
            babbler.sendto(draws.randbytes(draws.choice([0, 1, 40, 80, 1400])), (group, int(port)))
    controller = bench.controller(cell, "--lockstep", runs=2)
    assert controller.end() == 0, controller.errors
    assert BOTH_OFF in goodbye(drives)
    assert not any("EMCY" in line for line in drives.said)


def run_heard_by(bench: Bench, endpoint: str, meddle: Callable[[], None]) -> list[str]:
    """Make three runs in lock-step, visible at an endpoint, and interfere meanwhile."""
    telemetry = f'[telemetry]\nlisten = ["{endpoint}"]\nscouting = false\n'
    cell = bench.cell(short=True, more=f"\n{telemetry}")
    drives = bench.drives(cell, "--lockstep")
    controller = bench.start(
        "ilc-rt", "run", cell, "--bus", bench.bus, "--iterations", "3", "--lockstep",
        "--library", bench.library, "--events",
    )  # fmt: skip
    controller.event(event="state", state="running")
    meddle()
    assert controller.end() == 0, controller.errors
    goodbye(drives)
    return [digest for _, _, digest in bench.kept()]


def test_nobody_commands_through_telemetry(tmp_path: Path) -> None:
    """Puts, deletes and queries on every key of the cell: the runs are unaffected."""
    digests = []
    for folder in (tmp_path / "alone", tmp_path / "meddled"):
        folder.mkdir()
        endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"

        def meddle(endpoint: str = endpoint, name: str = folder.name) -> None:
            if name != "meddled":
                return
            config = zenoh.Config()
            config.insert_json5("mode", '"client"')
            config.insert_json5("connect/endpoints", json.dumps([endpoint]))
            config.insert_json5("scouting/multicast/enabled", "false")
            with zenoh.open(config) as session:
                for _ in range(20):
                    for topic in (
                        "state",
                        "servo",
                        "iteration",
                        "fault",
                        "latency",
                        "alive",
                        "stop",
                    ):
                        session.put(f"ilc/gantry/{topic}", json.dumps({"event": "stop"}))
                        session.delete(f"ilc/gantry/{topic}")
                list(session.get("ilc/gantry/**?stop=1", payload=b"stop", timeout=1.0))

        with Bench(folder) as bench:
            digests.append(run_heard_by(bench, endpoint, meddle))
    assert len(digests[0]) == 3
    assert digests[0] == digests[1]


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", "x'; DROP TABLE iteration; --"])
def test_a_name_is_shown_and_kept_as_the_text_that_it_is(bench: Bench, name: str) -> None:
    """Markup and SQL in a cell's name: refused, or escaped wherever it is shown."""
    cell = bench.cell(('name = "gantry"', f'name = "{name}"'), short=True)
    argv = [sys.executable, "-m", "ilc_rt.cli"]
    done = subprocess.run(
        [*argv, "run", str(cell), "--bus", "loopback:", "--iterations", "2", "--library", "l.db",
         "--report", "r.html"],
        cwd=bench.folder, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    assert done.returncode in (0, 2), done.stderr
    if done.returncode == 0:
        assert "<script>alert" not in (bench.folder / "r.html").read_text(encoding="utf-8")
        assert len(Library(str(bench.folder / "l.db")).list()) == 2
    found = Library(str(bench.folder / "other.db")).list()
    assert found == []

"""Neighbours of the telemetry that stop, go, never come or attack: the loop is not touched."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from processes_fixture import PATIENT, Bench, goodbye
from telemetry_fixture import endpoint, start, telemetry

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.xdist_group("telemetry_neighbours")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


STOPPED_READER = """
import json, os, signal, sys, zenoh
config = zenoh.Config()
config.insert_json5("listen/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
def on_value(sample):
    print("heard", flush=True)
    os.kill(os.getpid(), signal.SIGSTOP)
subscriber = session.declare_subscriber("ilc/**", on_value)
print("ready", flush=True)
signal.pause()
"""


# Two campaigns of a minute each on a computer that does thirty other things.
@pytest.mark.timeout(600)
def test_a_subscriber_that_stops_reading_holds_nobody_up(bench: Bench) -> None:
    """The campaign ends meanwhile: what exceeds the network's buffers is dropped."""
    runs = 60
    ours = endpoint()
    quiet = bench.cell(short=True, name="quiet.toml")
    cell = bench.cell(short=True, more=telemetry(connect=[ours]))
    drives = bench.drives(cell, "--lockstep")
    assert bench.controller(quiet, "--lockstep", runs=runs).end() == 0
    goodbye(drives)

    bench.drives(cell, "--lockstep")
    reader = subprocess.Popen(
        [sys.executable, "-c", STOPPED_READER, ours], stdout=subprocess.PIPE, text=True
    )
    try:
        assert reader.stdout is not None
        assert reader.stdout.readline() == "ready\n"
        controller = start(bench, cell, "--lockstep", runs=runs)
        assert controller.end() == 0
        assert reader.stdout.readline() == "heard\n"
    finally:
        reader.send_signal(signal.SIGKILL)
        reader.wait()
        reader.stdout.close()
    digests = [digest for _, _, digest in bench.kept()]
    assert digests[:runs] == digests[runs:]
    assert len(digests) == 2 * runs


ROUTER = """
import json, signal, sys, zenoh
config = zenoh.Config()
config.insert_json5("mode", json.dumps("router"))
config.insert_json5("listen/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
subscriber = session.declare_subscriber("ilc/**", lambda sample: print("heard", flush=True))
print("ready", flush=True)
signal.pause()
"""


@pytest.mark.parametrize("last", [signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP])
def test_a_router_that_goes_takes_nothing_with_it(bench: Bench, last: signal.Signals) -> None:
    """All telemetry goes through it, and the campaign does not depend on it."""
    runs = 20
    ours = endpoint()
    quiet = bench.cell(short=True, name="quiet.toml")
    cell = bench.cell(short=True, more=telemetry(connect=[ours]))
    drives = bench.drives(cell, "--lockstep")
    assert bench.controller(quiet, "--lockstep", runs=runs).end() == 0
    goodbye(drives)

    bench.drives(cell, "--lockstep")
    router = subprocess.Popen(
        [sys.executable, "-c", ROUTER, ours], stdout=subprocess.PIPE, text=True
    )
    assert router.stdout is not None
    try:
        assert router.stdout.readline() == "ready\n"
        controller = start(bench, cell, "--lockstep", runs=runs)
        assert router.stdout.readline() == "heard\n"
        router.send_signal(last)
        assert controller.end() == 0
    finally:
        router.kill()
        router.wait()
        router.stdout.close()
    digests = [digest for _, _, digest in bench.kept()]
    assert len(digests) == 2 * runs
    assert digests[:runs] == digests[runs:]


@pytest.mark.parametrize("wrong", ["tcp/203.0.113.7:7447", "tcp/127.0.0.1:1/nonsense", "nonsense"])
def test_a_cell_runs_unseen_where_its_endpoint_cannot_be_opened(bench: Bench, wrong: str) -> None:
    """A warning, and nothing more."""
    cell = bench.cell(short=True, more=telemetry(listen=[wrong]))
    bench.drives(cell, "--lockstep")
    controller = start(bench, cell, "--lockstep", runs=2)
    assert controller.end() == 0
    (line,) = controller.errors
    assert "[telemetry]" in line
    assert "WARN" in line
    assert "unseen" in line
    assert len(bench.kept()) == 2


def test_an_endpoint_that_is_not_there_is_waited_for_by_nobody(bench: Bench) -> None:
    """A monitor's computer that is switched off."""
    cell = bench.cell(short=True, more=telemetry(connect=[endpoint()]))
    bench.drives(cell, "--lockstep")
    controller = start(bench, cell, "--lockstep", runs=2)
    assert controller.end(20.0) == 0
    assert len(bench.kept()) == 2


HOSTILE = """
import json, os, sys, time, zenoh
os.nice(19)
config = zenoh.Config()
config.insert_json5("listen/endpoints", json.dumps([sys.argv[1]]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
# Its channels take one message, and it never reads: neither events, nor answers, nor queries.
deaf = session.declare_subscriber("ilc/**", zenoh.handlers.RingChannel(1))
mute = session.declare_queryable("ilc/gantry/heard", zenoh.handlers.RingChannel(1))
end = b'{"event": "end", "status": "fault", "iterations": 0}'
garbage = [b"", b"\\xff" * 60_000, b"[" * 60_000, end]
asked = []
told = False
print("ready", flush=True)
while not session.is_closed():
    for key in ("state", "iteration", "fault", "servo", "heard", "alive", "stop"):
        for payload in garbage:
            session.put(f"ilc/gantry/{key}", payload)
    asked.append(session.get("ilc/gantry/state", payload=garbage[1], timeout=60.0))
    asked.append(session.get("ilc/**", payload=garbage[2], timeout=60.0))
    if not told and session.info.peers_zid():
        told = True
        print("attacks", flush=True)
    time.sleep(0.02)
"""


def attacked(bench: Bench, pace: str, runs: int) -> list[list[dict[str, Any]]]:
    """Return the start and iteration events of an undisturbed campaign, and of one under attack."""
    ours = endpoint()
    is_lockstep = pace == "--lockstep"
    options = [pace] if is_lockstep else ["--simulated-drives"]
    figures = []
    for name, section in (("quiet.toml", ""), ("cell.toml", telemetry(connect=[ours]))):
        cell = bench.cell(short=True, more=("" if is_lockstep else PATIENT) + section, name=name)
        drives = bench.drives(cell, *(["--lockstep"] if is_lockstep else []))
        attacker = None
        try:
            if section:
                attacker = subprocess.Popen(
                    [sys.executable, "-c", HOSTILE, ours], stdout=subprocess.PIPE, text=True
                )
                assert attacker.stdout is not None
                assert attacker.stdout.readline() == "ready\n"
                controller = start(bench, cell, *options, runs=runs)
                assert attacker.stdout.readline() == "attacks\n"
            else:
                controller = bench.controller(cell, *options, runs=runs)
            assert controller.end() == 0, controller.errors
        finally:
            if attacker is not None and attacker.stdout is not None:
                attacker.kill()
                attacker.wait()
                attacker.stdout.close()
        goodbye(drives)
        figures.append([e for e in controller.events if e["event"] in {"start", "iteration"}])
    assert [e["index"] for e in figures[1] if e["event"] == "iteration"] == list(range(runs))
    return figures


def of_runs(figures: list[dict[str, Any]], key: str) -> list[Any]:
    """Return a figure of each run."""
    return [e[key] for e in figures if e["event"] == "iteration"]


def test_a_hostile_neighbour_changes_no_bit_in_lock_step(bench: Bench) -> None:
    """Huge queries, answers never read, garbage under the cell's keys."""
    quiet, beside = attacked(bench, "--lockstep", 12)
    assert of_runs(beside, "digest") == of_runs(quiet, "digest")


def test_a_hostile_neighbour_delays_no_loop_by_the_clock(bench: Bench) -> None:
    """The attacker shares the processors: a tenth of the cycles may be late by it.

    A computer that stalls by itself does so now and then, the attacker each time.
    """
    late = []
    for _ in range(3):
        quiet, beside = attacked(bench, "--realtime", 2)
        n_cycles = 2 * next(e["n_samples"] for e in beside if e["event"] == "start")
        late.append((sum(of_runs(beside, "overruns")) - sum(of_runs(quiet, "overruns"))) / n_cycles)
        if late[-1] <= 0.1:
            return
    pytest.fail(f"shares of late cycles: {late}")

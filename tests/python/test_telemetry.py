"""Telemetry: a Zenoh subscriber beside the running programs."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest
from processes_fixture import PATIENT, Bench, goodbye
from telemetry_fixture import Watcher, endpoint, start, telemetry

from ilc_rt import ReadOnlyLibrary
from ilc_rt.events import parse_event

zenoh = pytest.importorskip("zenoh")

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.xdist_group("telemetry")

RUNS = 2


class Watched:
    """Two runs in real time, their telemetry, and the library."""

    def __init__(self, folder: Path) -> None:
        ours, theirs = endpoint(), endpoint()
        with Bench(folder) as bench:
            more = PATIENT + telemetry(listen=[theirs], connect=[ours])
            cell = bench.cell(short=True, more=more)
            watcher = Watcher(listen=[ours])
            try:
                bench.drives(cell)
                self.controller = start(bench, cell, "--simulated-drives", runs=RUNS)
                watcher.wait_for_tokens("alive")
                self.controller.event(event="progress")
                late = Watcher(connect=[theirs])
                try:
                    late.wait_for_tokens("alive")
                    self.states_asked = late.states_asked()
                    self.history_asked = late.history_asked()
                finally:
                    late.session.close()
                self.status = self.controller.end()
                watcher.wait_for_tokens("alive", "gone")
                # Everything published before the token disappeared has arrived before it.
                self.heard = dict(watcher.heard)
            finally:
                watcher.session.close()
            library = ReadOnlyLibrary(bench.library)
            runs = [library.load(run["id"]) for run in library]
            self.rows = [
                [run[name] for name in ("reference_m", "input", "encoder_m", "tool_m")]
                for run in runs
            ]


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Watched:
    """Return two monitored runs."""
    return Watched(tmp_path_factory.mktemp("watched"))


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def test_the_same_events_are_heard_as_are_printed(watched: Watched) -> None:
    """Under their keys, in order, complete and without extras."""
    assert watched.status == 0, watched.controller.errors
    assert watched.controller.errors == []
    assert set(watched.heard) == {"state", "iteration", "latency", "drives", "servo"}
    for key, kinds in {
        "state": {"start", "state", "progress", "end"},
        "iteration": {"iteration"},
        "latency": {"late", "latency"},
        "drives": {"drives"},
    }.items():
        printed = [event for event in watched.controller.events if event["event"] in kinds]
        assert watched.heard[key] == printed
        assert all(parse_event(json.dumps(event)) is not None for event in watched.heard[key])


def test_the_error_is_seen_to_fall(bench: Bench) -> None:
    """One object per run; in lock-step, as a run that a busy machine disturbs teaches nothing."""
    ours = endpoint()
    cell = bench.cell(short=True, more=telemetry(connect=[ours]))
    bench.drives(cell, "--lockstep")
    watcher = Watcher(listen=[ours])
    try:
        assert start(bench, cell, "--lockstep", runs=RUNS).end() == 0
        watcher.wait_for_tokens("alive", "gone")
        first, second = watcher.heard["iteration"]
    finally:
        watcher.session.close()
    assert (first["index"], second["index"]) == (0, 1)
    assert second["tracking_rms_m"] < 0.2 * first["tracking_rms_m"]


def test_servo_batches_are_the_samples_of_the_runs(watched: Watched) -> None:
    """50 ms each, in order; bit-identical to the same samples in the library."""
    batches = watched.heard["servo"]
    first_syncs = [batch["first_sync"] for batch in batches]
    assert first_syncs == list(range(0, 25 * len(batches), 25))
    signals = ("reference_m", "input", "encoder_m", "tool_m")
    n_seen = 0
    for batch in batches:
        assert set(batch) == {"event", "schema", "first_sync", "iteration_and_sample", *signals}
        assert batch["schema"] == 1
        assert len(batch["iteration_and_sample"]) == 25
        arrays = [np.array(batch[name]) for name in signals]
        assert all(array.shape == (25, 2) for array in arrays)
        for row, at in enumerate(batch["iteration_and_sample"]):
            if at is not None:
                run, k = at
                for array, kept in zip(arrays, watched.rows[run], strict=True):
                    np.testing.assert_array_equal(array[row], kept[k])
                n_seen += 1
    assert n_seen == sum(len(row[0]) for row in watched.rows)


def test_a_late_joiner_gets_the_state(watched: Watched) -> None:
    """By a query; subscriptions only receive changes. It is running, or already on its way back."""
    (state,) = watched.states_asked
    states = [event for event in watched.controller.events if event["event"] == "state"]
    running = [event["state"] for event in states].index("running")
    assert state in states[running:]


def test_a_late_joiner_gets_the_campaign_so_far(watched: Watched) -> None:
    """The start first, then the runs, if one has ended by then; last what the drives do now."""
    start, *runs, drives = watched.history_asked
    assert {one["state"] for one in drives["drives"]} == {"operation enabled"}
    assert drives in watched.heard["drives"]
    printed = watched.controller.events
    assert start == next(event for event in printed if event["event"] == "start")
    assert runs == [event for event in printed if event["event"] == "iteration"][: len(runs)]


def test_a_fault_is_heard(bench: Bench) -> None:
    """With the printed reason; then the controller is gone."""
    ours = endpoint()
    cell = bench.cell(short=True, more=telemetry(connect=[ours]))
    watcher = Watcher(listen=[ours])
    try:
        bench.drives(cell, "--lockstep", "--mute", "1@0.5")
        controller = start(bench, cell, "--lockstep", runs=10_000)
        assert controller.end() == 3
        watcher.wait_for_tokens("alive", "gone")
        (fault,) = watcher.heard["fault"]
        assert controller.errors[-1].endswith(fault["reason"])
        assert watcher.heard["state"][-1]["status"] == "fault"
    finally:
        watcher.session.close()


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


@pytest.mark.parametrize("pace", ["--lockstep", "--realtime"])
def test_a_hostile_neighbour_changes_nothing_in_the_loop(bench: Bench, pace: str) -> None:
    """Huge queries, answers never read, garbage under the cell's keys; in lock-step bit for bit.

    By the clock the attacker shares the processors: a tenth of the cycles may be late by it.
    """
    runs = 12 if pace == "--lockstep" else 2
    ours = endpoint()
    more = "" if pace == "--lockstep" else PATIENT
    options = [pace] if pace == "--lockstep" else ["--simulated-drives"]
    figures = []
    for name, section in (("quiet.toml", ""), ("cell.toml", telemetry(connect=[ours]))):
        cell = bench.cell(short=True, more=more + section, name=name)
        drives = bench.drives(cell, *(["--lockstep"] if pace == "--lockstep" else []))
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
    quiet, attacked = ([e for e in one if e["event"] == "iteration"] for one in figures)
    assert [run["index"] for run in attacked] == list(range(runs))
    if pace == "--lockstep":
        assert [run["digest"] for run in attacked] == [run["digest"] for run in quiet]
    else:
        n_cycles = runs * next(e["n_samples"] for e in figures[1] if e["event"] == "start")
        overruns = [sum(run["overruns"] for run in one) for one in (quiet, attacked)]
        assert overruns[1] <= overruns[0] + n_cycles // 10

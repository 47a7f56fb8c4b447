"""Telemetry: a Zenoh subscriber beside the running programs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
from processes_fixture import PATIENT, Bench
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

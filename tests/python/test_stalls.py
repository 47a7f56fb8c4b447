"""A stalled computer: simulated drives and controller tolerate it."""

from __future__ import annotations

import random
import signal
import time
from typing import TYPE_CHECKING

import pytest
from processes_fixture import Bench, Process, goodbye

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

RUNS = 3
N_STALLS = 6


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def stall(processes: list[Process], seconds: float) -> None:
    """Stop some processes for a while."""
    for process in processes:
        process.signal(signal.SIGSTOP)
    time.sleep(seconds)
    for process in processes:
        process.signal(signal.SIGCONT)


@pytest.mark.parametrize("who", ["drives", "controller", "both"])
def test_a_stall_pauses_the_motion_and_ends_nothing(bench: Bench, who: str) -> None:
    """20 to 300 ms at random moments: every run is made, and no sample is lost."""
    draw = random.Random(f"stalls of {who}")
    cell = bench.cell(short=True)
    drives = bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=RUNS)
    stalled = {"drives": [drives], "controller": [controller], "both": [drives, controller]}[who]
    controller.event(event="state", state="running", iteration=0)
    for _ in range(N_STALLS):
        time.sleep(draw.uniform(0.05, 0.6))
        stall(stalled, draw.uniform(0.02, 0.3))
    assert controller.end() == 0, controller.errors
    runs = [event for event in controller.events if event["event"] == "iteration"]
    assert len(runs) == len(bench.kept()) == RUNS
    assert sum(run["missing_samples"] for run in runs) == 0
    assert not any("EMCY" in line for line in drives.said)
    assert "1 (x) switch on disabled, 2 (y) switch on disabled" in goodbye(drives)


def test_a_stalled_run_is_the_run_that_was_not_stalled(bench: Bench) -> None:
    """The plant pauses with the controller: the path is the same, and the stall is counted."""
    cell = bench.cell(short=True)
    bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", "--no-learning", runs=3)
    controller.event(event="state", state="running", iteration=1)
    controller.event(event="progress", iteration=1)
    stall([controller], 0.2)
    assert controller.end() == 0, controller.errors
    runs = [event for event in controller.events if event["event"] == "iteration"]
    assert runs[1]["overruns"] >= 50
    # Friction depends on the previous run, so even undisturbed runs differ slightly.
    assert runs[1]["tracking_rms_m"] == pytest.approx(runs[2]["tracking_rms_m"], rel=0.05)


def test_a_real_drive_is_not_waited_for(bench: Bench) -> None:
    """Unless the drives are declared as simulated, the computer's stall stops the axes."""
    cell = bench.cell(short=True)
    bench.drives(cell)
    controller = bench.controller(cell, runs=3)
    controller.event(event="progress", iteration=0)
    stall([controller], 0.4)
    assert controller.end() == 3
    (line,) = controller.errors
    assert "this computer stalled for " in line
    assert "the loop woke " in line


def test_drives_come_to_rest_without_their_controller(bench: Bench) -> None:
    """After kill -9 the plant waits for a second, and then the drives miss their commands."""
    cell = bench.cell(short=True)
    drives = bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=3)
    controller.event(event="progress", iteration=0)
    controller.signal(signal.SIGKILL)
    for node in (1, 2):
        drives.line_with(f"node {node}: EMCY 0x8250", deadline_s=10.0)
        drives.line_with(f"node {node}: fault", deadline_s=10.0)
    assert "1 (x) fault, 2 (y) fault" in goodbye(drives)


def test_drives_without_power_are_noticed_all_the_same(bench: Bench) -> None:
    """The timeout ends: the loop pauses for a second, and then the node is silent."""
    cell = bench.cell(short=True)
    # The other drive waits for longer than the loop does: a busy computer may be late to tell it.
    drives = bench.drives(cell, "--mute", "2@3", "--sync-lost-after", "20")
    controller = bench.controller(cell, "--simulated-drives", runs=10_000)
    drives.line_with("node 2: lost power")
    assert controller.end(30.0) == 3
    (line,) = controller.errors
    assert "drive of axis y (node 2) is silent: no answer in " in line
    assert "1 (x) switch on disabled" in goodbye(drives)

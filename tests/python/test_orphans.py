"""Programs end with their parent, and left-over drives are recognised."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from children_fixture import children
from processes_fixture import Bench

if TYPE_CHECKING:
    from collections.abc import Iterator

DEADLINE_S = 30.0


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def is_gone(pid: int) -> bool:
    """Return whether a process has ended, reaped or not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def wait_until_gone(pids: list[int]) -> None:
    """Wait until all of these have ended."""
    until = time.monotonic() + DEADLINE_S
    while not all(map(is_gone, pids)):
        assert time.monotonic() < until, "a program outlived the one that started it"
        time.sleep(0.02)


def run(bench: Bench, cell: Path, *more: str) -> subprocess.Popen[str]:
    """Start `ilc run` and wait until the first run is kept."""
    argv = [
        sys.executable, "-m", "ilc_rt.cli", "run", str(cell), "--bus", bench.bus,
        "--library", str(bench.library), "-n", "1000", *more,
    ]  # fmt: skip
    process = subprocess.Popen(
        argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=bench.folder
    )
    assert process.stdout is not None
    for line in process.stdout:
        if line.split()[:1] == ["0"]:
            return process
    raise AssertionError(process.communicate())


@pytest.mark.parametrize("also", ["", "ilc-rt", "ilc-sim"])
def test_killed_programs_leave_no_children_and_a_clean_place(bench: Bench, also: str) -> None:
    """After kill -9 of `ilc run`, alone or with one child, the same address is free again."""
    cell = bench.cell(short=True)
    process = run(bench, cell)
    programs = children(process.pid)
    assert set(programs) == {"ilc-rt", "ilc-sim"}
    process.kill()
    if also:
        os.kill(programs[also], signal.SIGKILL)
    process.communicate()
    wait_until_gone(list(programs.values()))
    n_kept = len(bench.kept())
    assert n_kept >= 1
    argv = [
        sys.executable, "-m", "ilc_rt.cli", "run", str(cell), "--bus", bench.bus,
        "--library", str(bench.library), "-n", str(n_kept + 1), "--resume",
    ]  # fmt: skip
    again = subprocess.run(argv, capture_output=True, text=True, check=False, cwd=bench.folder)
    assert again.returncode == 0, again.stderr
    assert [index for _, index, _ in bench.kept()] == list(range(n_kept + 1))


def test_lock_step_programs_end_as_well(bench: Bench) -> None:
    """Also without a clock."""
    process = run(bench, bench.cell(short=True), "--lockstep")
    programs = list(children(process.pid).values())
    process.kill()
    process.communicate()
    wait_until_gone(programs)


def test_drives_that_are_there_already_are_recognised(bench: Bench) -> None:
    """The second ones do not boot, so the first ones and their controller continue undisturbed."""
    cell = bench.cell(short=True)
    first = bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=3)
    controller.event(event="progress", iteration=0)
    second = bench.start("ilc-sim", "run", cell, "--bus", bench.bus)
    assert second.end() == 2
    (line,) = second.errors
    assert line.startswith(f"ilc-sim: {bench.bus}: node ")
    assert "is on this bus already" in line
    assert controller.end() == 0, controller.errors
    # Idle drives, whose heartbeat is not enabled, are found by asking.
    first.signal(signal.SIGINT)
    first.end()
    bench.drives(cell)
    third = bench.start("ilc-sim", "run", cell, "--bus", bench.bus)
    assert third.end() == 2

"""Commissioning with `ilc-rt` alone, on simulated drives in another process."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest
from processes_fixture import PATIENT, Bench, Process, goodbye, program

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

BOTH_OFF = "1 (x) switch on disabled, 2 (y) switch on disabled"
DEADLINE_S = 60.0


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


@pytest.fixture
def cell(bench: Bench) -> Path:
    """Return a cell that tolerates a busy machine."""
    return bench.cell(short=True, more=PATIENT)


@pytest.fixture
def drives(bench: Bench, cell: Path) -> Process:
    return bench.drives(cell)


def said(bench: Bench, *argv: str | Path, status: int = 0) -> dict[str, Any]:
    """Run a verb to its end and return what `--json -` has."""
    process = bench.start("ilc-rt", *argv, "--json", "-")
    assert process.end() == status, (process.said, process.errors)
    return json.loads("\n".join(process.said)) if process.said else {}


def refused(bench: Bench, *argv: str | Path, status: int = 2) -> str:
    """Run a verb that refuses, and return its line."""
    process = bench.start("ilc-rt", *argv)
    assert process.end() == status, (process.said, process.errors)
    assert len(process.errors) == 1, process.errors
    return process.errors[0]


@pytest.mark.usefixtures("drives")
def test_a_scan_finds_what_is_there_and_what_is_not(bench: Bench, cell: Path) -> None:
    """With an address, with a cell, and with a cell whose node does not exist."""
    found = said(bench, "scan", bench.bus)
    assert [node["node"] for node in found["nodes"]] == [1, 2, 10]
    first = found["nodes"][0]
    assert first["name"] == "ilc-sim CiA 402 drive"
    assert first["identity"][3] == 1
    assert first["drive"]["state"] == "switch on disabled"
    assert {"csp", "csv"} <= set(first["drive"]["supported"])
    assert found["nodes"][2]["drive"] is None
    assert said(bench, "scan", cell, "--bus", bench.bus)["nodes"][1]["axis"] == "y"
    wrong = bench.cell(("node = 2", "node = 77"), name="wrong.toml")
    assert "node 77 (axis y) does not answer" in refused(
        bench, "scan", wrong, "--bus", bench.bus, status=1
    )


def test_an_empty_bus_says_so(bench: Bench) -> None:
    assert "no node answers" in refused(bench, "scan", bench.bus, status=1)


@pytest.mark.usefixtures("drives")
def test_objects_are_read_and_written_in_their_type(bench: Bench, cell: Path) -> None:
    """Numbers, text in segments, refusals of the node in words."""
    read = said(bench, "sdo", "read", bench.bus, "1", "6041")
    assert (read["value"], read["type"], read["name"]) == (0x250, "u16", "Statusword")
    assert said(bench, "sdo", "read", cell, "x", "1008", "--bus", bench.bus)["value"] == (
        "ilc-sim CiA 402 drive"
    )
    written = said(bench, "sdo", "write", bench.bus, "1", "607D:1", "-0x10")
    assert (written["value"], written["type"]) == (-16, "i32")
    line = refused(bench, "sdo", "read", bench.bus, "1", "9999", status=1)
    assert "0x06020000 (object does not exist)" in line
    line = refused(bench, "sdo", "write", bench.bus, "1", "6041", "1", status=1)
    assert "0x06010002 (object is read-only)" in line
    line = refused(bench, "sdo", "read", bench.bus, "55", "6041", "--timeout", "0.1", status=1)
    assert "no answer within 100ms" in line
    line = refused(bench, "sdo", "write", bench.bus, "1", "6065", "-1", "--type", "u32")
    assert "u32: allowed 0 to 4294967295" in line
    assert "allowed INDEX" in refused(bench, "sdo", "read", bench.bus, "1", "x")
    assert "allowed 1 to 127, or an axis: x, y" in refused(
        bench, "sdo", "read", cell, "z", "6041", "--bus", bench.bus
    )


@pytest.mark.usefixtures("drives")
def test_reading_leaves_a_campaign_alone_and_changing_is_refused(bench: Bench, cell: Path) -> None:
    """Beside a run: scan and status work, every verb that changes something refuses."""
    controller = bench.controller(cell, runs=1000)
    controller.event(event="progress", iteration=0)
    assert len(said(bench, "scan", cell, "--bus", bench.bus)["nodes"]) == 3
    status = said(bench, "status", cell, "--bus", bench.bus)
    assert [axis["state"] for axis in status["axes"]] == ["operation enabled"] * 2
    assert status["master"] is not None
    for verb in (
        ["sdo", "write", cell, "x", "6065", "1", "--bus", bench.bus],
        ["reset", cell, "--bus", bench.bus],
        ["disable", cell, "--bus", bench.bus],
        ["enable", cell, "--bus", bench.bus],
        ["jog", cell, "x", "0.001", "--bus", bench.bus],
        ["goto", cell, "x=0.05", "--bus", bench.bus],
    ):
        assert "another master is at work" in refused(bench, *verb)
    # It has not stopped for any of them.
    controller.signal(signal.SIGINT)
    assert controller.end() == 130


def test_moves_by_hand_arrive_and_leave_the_drives_off(
    bench: Bench, cell: Path, drives: Process
) -> None:
    """Jog, goto and enable; the other axis holds."""
    options = ["--bus", bench.bus, "--simulated-drives"]
    before = said(bench, "status", cell, "--bus", bench.bus)["axes"]
    end = said(bench, "jog", cell, "x", "0.004", *options)
    assert end["status"] == "completed"
    assert end["position_m"]["x"] == pytest.approx(before[0]["position_m"] + 0.004, abs=1e-4)
    assert end["position_m"]["y"] == pytest.approx(before[1]["position_m"], abs=1e-4)
    end = said(bench, "goto", cell, "x=0.05", "y=0.03", *options)
    assert end["position_m"] == pytest.approx({"x": 0.05, "y": 0.03}, abs=1e-4)
    assert said(bench, "enable", cell, "--seconds", "0.2", *options)["status"] == "completed"
    assert BOTH_OFF in goodbye(drives)


@pytest.mark.usefixtures("drives")
def test_what_a_move_may_not_do_is_refused_before_it_begins(bench: Bench, cell: Path) -> None:
    """Beyond a limit, too fast, unknown, nonsense."""
    for words, says in (
        (["jog", cell, "x", "5"], "destination 5.04"),
        (["goto", cell, "y=-1"], "allowed -0.02 to 0.1 m"),
        (["goto", cell, "x=0.05", "--speed", "9"], "speed 9 m/s: allowed above 0, up to"),
        (["goto", cell, "z=0.05"], "axis z: allowed: x, y"),
        (["goto", cell, "x=nan"], "allowed AXIS=POSITION"),
        (["goto", cell, "x=0.01", "x=0.02"], "two positions"),
        (["jog", cell, "x", "0"], "a number other than 0"),
        (["jog", cell, "x", "--speed", "0.01"], "allowed with a terminal or a pipe"),
    ):
        assert says in refused(bench, *words, "--bus", bench.bus), words


def started(bench: Bench, words: list[str | Path], stdin: int) -> subprocess.Popen[str]:
    """Start a move with standard input of its own."""
    return subprocess.Popen(
        [program("ilc-rt"), *words, "--bus", bench.bus, "--simulated-drives"],
        stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=bench.folder,
    )  # fmt: skip


def until_moving(process: subprocess.Popen[str]) -> None:
    """Read until the axes move."""
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("moving: "):
            return
    raise AssertionError(process.communicate())


def at_rest(bench: Bench, cell: Path) -> None:
    """Wait until both drives are off, well before the end of the axis."""
    until = time.monotonic() + DEADLINE_S
    while True:
        axes = said(bench, "status", cell, "--bus", bench.bus)["axes"]
        if {axis["state"] for axis in axes} == {"switch on disabled"}:
            break
        assert time.monotonic() < until, axes
        time.sleep(0.1)
    assert axes[0]["position_m"] < 0.099


SLOWLY = ["0.05", "--at-speed", "0.002"]


@pytest.mark.usefixtures("drives")
def test_a_closed_pipe_ends_a_move(bench: Bench, cell: Path) -> None:
    process = started(bench, ["jog", cell, "x", *SLOWLY], subprocess.PIPE)
    until_moving(process)
    assert process.stdin is not None
    process.stdin.close()
    process.stdin = None
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 3
    assert "controlled stop: standard input was closed" in errors
    at_rest(bench, cell)


@pytest.mark.usefixtures("drives")
def test_ctrl_c_ends_a_move(bench: Bench, cell: Path) -> None:
    process = started(bench, ["jog", cell, "x", *SLOWLY], subprocess.DEVNULL)
    until_moving(process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 130
    assert "stopped by Ctrl-C" in errors
    at_rest(bench, cell)


@pytest.mark.usefixtures("drives")
def test_an_output_that_no_one_reads_ends_a_move(bench: Bench, cell: Path) -> None:
    process = started(bench, ["jog", cell, "x", *SLOWLY], subprocess.DEVNULL)
    until_moving(process)
    assert process.stdout is not None
    process.stdout.close()
    assert process.wait(DEADLINE_S) == 3
    assert process.stderr is not None
    assert "nobody reads the output" in process.stderr.read()
    process.stderr.close()
    at_rest(bench, cell)


@pytest.mark.usefixtures("drives")
def test_a_parent_that_is_killed_ends_a_move(bench: Bench, cell: Path) -> None:
    """The move has a file as its output and nothing as its input: only the parent tells."""
    words = [str(program("ilc-rt")), "jog", str(cell), "x", *SLOWLY, "--bus", bench.bus]
    script = (
        "import subprocess, sys, time\n"
        "log = open('log', 'w')\n"
        "subprocess.Popen(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=log, stderr=log)\n"
        "time.sleep(1000)\n"
    )
    log = bench.folder / "log"
    parent = subprocess.Popen(
        [sys.executable, "-c", script, *words, "--simulated-drives"], cwd=bench.folder
    )
    until = time.monotonic() + DEADLINE_S
    while not log.exists() or "moving: " not in log.read_text():
        assert time.monotonic() < until
        time.sleep(0.02)
    parent.kill()
    parent.wait()
    while "the program that started this one is gone" not in log.read_text():
        assert time.monotonic() < until
        time.sleep(0.02)
    at_rest(bench, cell)


@pytest.mark.usefixtures("drives")
def test_a_terminal_that_is_gone_ends_a_move(bench: Bench, cell: Path) -> None:
    """The other end of the pseudo-terminal closes: SIGHUP, and no more output."""
    child, terminal = pty.fork()
    if child == 0:
        os.execv(
            program("ilc-rt"),
            ["ilc-rt", "jog", str(cell), "x", *SLOWLY, "--bus", bench.bus, "--simulated-drives"],
        )
    heard = b""
    while b"moving: " not in heard:
        heard += os.read(terminal, 4096)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) in (129, 3)
    at_rest(bench, cell)


@pytest.mark.usefixtures("drives")
def test_a_key_moves_an_axis_for_as_long_as_it_is_held(bench: Bench, cell: Path) -> None:
    """Nothing moves before the first input; without input the axis comes to rest."""
    words = ["jog", cell, "x", "--speed", "0.002", "--hold", "2"]
    process = started(bench, words, subprocess.PIPE)
    assert process.stdin is not None
    assert process.stdout is not None
    assert "hold Enter to move axis x" in process.stdout.readline()
    # Every report is answered by a key until the axis moves.
    line = ""
    while not line.startswith("moving: "):
        process.stdin.write("\n")
        process.stdin.flush()
        line = process.stdout.readline()
        assert line, process.communicate()
    rest = process.stdout.read()
    assert process.wait(DEADLINE_S) == 0
    assert "released: no input for 2 s" in rest
    for stream in (process.stdin, process.stdout, process.stderr):
        assert stream is not None
        stream.close()
    at_rest(bench, cell)


def test_a_fault_is_told_left_and_reset(bench: Bench) -> None:
    """After kill -9 of a controller: named by status, refused by run, named and reset by reset."""
    cell = bench.cell(short=True, more="\n[safety]\nsilent_cycles_max = 250\n")
    drives = bench.drives(cell)
    controller = bench.controller(cell, runs=1000)
    controller.event(event="progress", iteration=0)
    controller.signal(signal.SIGKILL)
    controller.end()
    for node in (1, 2):
        drives.line(
            lambda line, node=node: f"node {node}: EMCY 0x8250" in line, f"EMCY of node {node}"
        )
    axes = said(bench, "status", cell, "--bus", bench.bus)["axes"]
    assert [(axis["state"], axis["code"]) for axis in axes] == [("fault", 0x8250)] * 2
    options = ["--bus", bench.bus, "--simulated-drives"]
    assert "is in fault: 0x8250" in refused(bench, "jog", cell, "x", "0.001", *options)
    reset = said(bench, "reset", cell, "--axis", "x", "--bus", bench.bus)["nodes"]
    assert [(one["axis"], one["reset"], one["faults"]["code"]) for one in reset] == [
        ("x", True, 0x8250)
    ]
    assert "axis y (node 2) is in fault" in refused(bench, "jog", cell, "x", "0.001", *options)
    end = said(bench, "jog", cell, "x", "0.001", "--reset-faults", *options)
    assert end["status"] == "completed"
    assert BOTH_OFF in goodbye(drives)

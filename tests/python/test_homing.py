"""Homing by the programs and in one process, ended by whatever ends a move by hand."""

from __future__ import annotations

import json
import signal
import subprocess
from typing import TYPE_CHECKING, Any

import pytest
from processes_fixture import DEADLINE_S, PATIENT, Bench, Process, program

from ilc_rt import Campaign
from ilc_rt.errors import CampaignError, FaultError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

#: Habits of real drives.
QUIRKS = """
[axis.simulation.quirks]
sdo_delay_ms = 2
quick_stop_option = 2
keeps_mode_under_halt = true
statusword_on_event = true
lacks_torque_offset = true
lacks_following_error_time = true
"""


def homing(method: int, offset_m: float, more: str = "", speed_m_s: float = 0.05) -> str:
    """Return the homing of an axis."""
    switch = f"speed_switch_m_s = {speed_m_s}\n" if method < 33 else ""
    return (
        f'[axis.homing]\nkind = "drive"\nmethod = {method}\noffset_m = {offset_m}\n'
        f"{switch}speed_zero_m_s = 0.005\n{more}\n"
    )


def cell_with(bench: Bench, section: str, quirks: str = "") -> Path:
    """Write the short cell with a homing of its first axis."""
    change = ("[axis.model]", f"{section}\n[axis.model]")
    more = ("position_start_m = 0.04\n", f"position_start_m = 0.04\n{quirks}\n")
    return bench.cell(change, more, short=True, more=PATIENT)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def home(bench: Bench, cell: Path, *options: str) -> Process:
    return bench.start(
        "ilc-rt", "home", cell, "--bus", bench.bus, "--simulated-drives", "--json", "-", *options
    )


def homed(bench: Bench, cell: Path, *options: str, status: int = 0) -> dict[str, Any]:
    """Home to the end and return what `--json -` has."""
    process = home(bench, cell, *options)
    assert process.end() == status, (process.said, process.errors)
    found: dict[str, Any] = json.loads("\n".join(process.said))
    return found


def states(bench: Bench, cell: Path) -> list[str]:
    """Return the state of each drive."""
    process = bench.start("ilc-rt", "status", cell, "--bus", bench.bus, "--json", "-")
    assert process.end() == 0, process.errors
    return [axis["state"] for axis in json.loads("\n".join(process.said))["axes"]]


def test_an_axis_is_homed_once_and_then_moves(bench: Bench) -> None:
    """With the habits of a real drive, by the clock: from its switch, inside, left alone, moved."""
    cell = cell_with(bench, homing(17, -0.026), QUIRKS)
    bench.drives(cell)
    jog = ["jog", cell, "x", "0.002", "--bus", bench.bus, "--simulated-drives"]
    process = bench.start("ilc-rt", *jog)
    assert process.end() == 2
    assert "is not homed: its homing method (0x6098) is 0" in process.errors[0]
    assert f"`ilc-rt home {cell} --axis x` homes it" in process.errors[0]
    first = homed(bench, cell)
    assert first["status"] == "completed"
    [axis] = first["axes"]
    assert (axis["axis"], axis["homed"], axis["was_homed"]) == ("x", True, False)
    assert axis["position_m"] == pytest.approx(-0.0188, abs=2e-4)
    again = homed(bench, cell, "--axis", "x")
    assert again["axes"][0]["was_homed"]
    process = bench.start("ilc-rt", *jog)
    assert process.end() == 0, process.errors
    for words, says in (
        (["--axis", "y"], "--axis y: its drive searches no home"),
        (["--axis", "z"], "axis z: allowed: x, y"),
    ):
        process = home(bench, cell, *words)
        assert process.end() == 2
        assert says in process.errors[0]


def test_ctrl_c_ends_a_homing(bench: Bench) -> None:
    cell = cell_with(bench, homing(17, -0.026, speed_m_s=0.005))
    bench.drives(cell)
    process = bench.start("ilc-rt", "home", cell, "--bus", bench.bus, "--simulated-drives")
    process.line_with("homing: x shows")
    process.signal(signal.SIGINT)
    assert process.end() == 130
    assert process.errors[-1] == "ilc-rt: stopped by Ctrl-C"
    assert states(bench, cell) == ["switch on disabled"] * 2


def test_a_closed_pipe_ends_a_homing(bench: Bench) -> None:
    cell = cell_with(bench, homing(17, -0.026, speed_m_s=0.005))
    bench.drives(cell)
    words = ["home", str(cell), "--bus", bench.bus, "--simulated-drives"]
    process = subprocess.Popen(
        [program("ilc-rt"), *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, cwd=bench.folder,
    )  # fmt: skip
    assert process.stdin is not None
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("homing: "):
            break
    process.stdin.close()
    process.stdin = None
    _, errors = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 3
    assert "controlled stop: standard input was closed" in errors
    assert states(bench, cell) == ["switch on disabled"] * 2


def test_a_killed_homing_leaves_the_drive_at_rest(bench: Bench) -> None:
    """The drive misses its commands, faults at rest, and homes after a reset."""
    cell = cell_with(bench, homing(17, -0.026, speed_m_s=0.01))
    drives = bench.drives(cell)
    process = bench.start("ilc-rt", "home", cell, "--bus", bench.bus, "--simulated-drives")
    process.line_with("homing: x shows")
    process.signal(signal.SIGKILL)
    process.end()
    drives.line_with("node 1: EMCY 0x8250")
    process = home(bench, cell)
    assert process.end() == 2
    assert "axis x (node 1) is in fault: 0x8250" in process.errors[0]
    found = homed(bench, cell, "--reset-faults")
    assert found["axes"][0]["homed"]


@pytest.mark.parametrize("pace", ["--simulated-drives", "--lockstep"])
def test_lost_drives_end_a_homing(bench: Bench, pace: str) -> None:
    """Also in lock-step, where each answer is waited for."""
    cell = cell_with(bench, homing(17, -0.026, "timeout_s = 600.0", speed_m_s=0.001))
    drives = bench.drives(cell, *([pace] if pace == "--lockstep" else []))
    process = bench.start("ilc-rt", "home", cell, "--bus", bench.bus, pace)
    process.line_with("homing: x shows")
    drives.signal(signal.SIGKILL)
    assert process.end() == 3
    assert "axis x: the drive does not answer any more" in process.errors[-1]


def test_a_campaign_in_one_process_homes_first(bench: Bench) -> None:
    cell = cell_with(bench, homing(17, -0.026))
    options: dict[str, Any] = {"library": bench.library, "bus": "loopback:"}
    with pytest.raises(CampaignError, match=r"axis x .* is not homed"):
        list(Campaign(cell, **options).run(1))
    records = list(Campaign(cell, **options, home=True).run(2))
    assert [record.index for record in records] == [0, 1]
    late = cell_with(bench, homing(17, -0.026, "timeout_s = 0.2"))
    with pytest.raises(FaultError, match=r"no home within homing\.timeout_s = 0\.2 s"):
        list(Campaign(late, **options, home=True).run(1))

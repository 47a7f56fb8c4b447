"""Failures of a machine, inflicted on the real programs while the axes move."""

from __future__ import annotations

import os
import re
import signal
from typing import TYPE_CHECKING

import pytest
from processes_fixture import PATIENT, Bench, Process, goodbye

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

BOTH_OFF = "1 (x) switch on disabled, 2 (y) switch on disabled"


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


@pytest.fixture
def patient(bench: Bench) -> Path:
    """Return a cell that tolerates a busy machine."""
    return bench.cell(short=True, more=PATIENT)


def moving(controller: Process, run: int = 0) -> None:
    """Read until the axes have moved for a tenth of a second of a run."""
    controller.event(event="state", state="running", iteration=run)
    controller.event(event="progress", iteration=run)


def states(controller: Process) -> list[str]:
    return [event["state"] for event in controller.events if event["event"] == "state"]


@pytest.mark.parametrize(
    ("number", "status", "reason"),
    [
        (signal.SIGINT, 130, "stopped by Ctrl-C"),
        (signal.SIGTERM, 143, "stopped by SIGTERM"),
        (signal.SIGHUP, 129, "stopped as its terminal is gone (SIGHUP)"),
    ],
)
def test_a_signal_brings_the_axes_to_rest(
    bench: Bench, patient: Path, number: signal.Signals, status: int, reason: str
) -> None:
    """Mid-run: a controlled stop, drives off, the reason named, the run not kept."""
    drives = bench.drives(patient)
    controller = bench.controller(patient, "--simulated-drives", "--json", "figures.json", runs=5)
    moving(controller)
    controller.signal(number)
    assert controller.end() == status
    assert states(controller)[-2:] == ["stopping", "stopped"]
    end = controller.events[-1]
    assert (end["event"], end["status"], end["reason"]) == ("end", "interrupted", reason)
    assert controller.errors == []
    assert bench.kept() == []
    assert BOTH_OFF in goodbye(drives)
    assert not any("EMCY" in line for line in drives.said)


def test_a_signal_under_nohup_is_ignored(bench: Bench, patient: Path) -> None:
    """A campaign started with nohup must outlive the terminal."""
    bench.drives(patient)
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        controller = bench.controller(patient, "--simulated-drives", runs=1)
    finally:
        signal.signal(signal.SIGHUP, before)
    moving(controller)
    controller.signal(signal.SIGHUP)
    assert controller.end() == 0


def test_a_signal_in_lock_step_stops_as_well(bench: Bench, patient: Path) -> None:
    """The ticks of the stop are paced by the drives like all others."""
    drives = bench.drives(patient, "--lockstep")
    controller = bench.controller(patient, "--lockstep", runs=10_000)
    controller.event(event="iteration", index=2)
    controller.signal(signal.SIGINT)
    assert controller.end() == 130
    assert BOTH_OFF in goodbye(drives)
    n_kept = len(bench.kept())
    assert n_kept >= 3
    assert controller.events[-1]["iterations"] == n_kept


def test_a_reader_of_events_who_goes_stops_the_axes(bench: Bench, patient: Path) -> None:
    """Trouble would go unnoticed: a controlled stop, drives off, no panic."""
    drives = bench.drives(patient, "--lockstep")
    reading, writing = os.pipe()
    controller = bench.controller(patient, "--lockstep", runs=2, stdout=writing)
    os.close(writing)
    os.close(reading)
    assert controller.end() == 128 + signal.SIGPIPE
    assert controller.errors == []
    assert len(bench.kept()) < 2
    assert BOTH_OFF in goodbye(drives)


def test_a_reader_of_the_table_who_goes_stops_nothing(bench: Bench, patient: Path) -> None:
    """As in `ilc-rt run | head -1`: the runs are made and kept, drives off, no panic."""
    drives = bench.drives(patient, "--lockstep")
    reading, writing = os.pipe()
    controller = bench.start(
        "ilc-rt", "run", patient, "--bus", bench.bus, "--lockstep", "--iterations", "2",
        "--library", bench.library, "--no-telemetry", stdout=writing,
    )  # fmt: skip
    os.close(writing)
    os.close(reading)
    assert controller.end() == 0
    assert controller.errors == []
    assert [index for _, index, _ in bench.kept()] == [0, 1]
    assert BOTH_OFF in goodbye(drives)


@pytest.mark.parametrize("pace", ["realtime", "lockstep"])
def test_drives_that_die_are_noticed(bench: Bench, pace: str) -> None:
    """After kill -9 of all drives: exit status 3 soon, one line with axis, node and duration."""
    options = ["--lockstep"] if pace == "lockstep" else []
    cell = bench.cell(
        short=True, more="\n[safety]\nsilent_cycles_max = 100\nanswer_timeout_s = 1.0\n"
    )
    drives = bench.drives(cell, *options)
    controller = bench.controller(cell, *options, runs=10_000)
    controller.event(event="state", state="running", iteration=1)
    drives.signal(signal.SIGKILL)
    assert controller.end() == 3
    (line,) = controller.errors
    # Killed between two answers to one SYNC, the missing ones are named first.
    nodes = r"(drive of axis [xy] \(node [12]\)|tool measurement \(node 10\))"
    # A computer that stalls makes several cycles at once.
    silence = r"1 s" if options else r"[1-9]\d\d cycles \(\d+ ms\)"
    said = f"{nodes} is silent: no answer in {silence}"
    assert re.fullmatch(f"ilc-rt: controlled stop: {said}", line), line
    fault = next(event for event in controller.events if event["event"] == "fault")
    assert line.endswith(fault["reason"])
    assert controller.events[-1]["status"] == "fault"
    assert {"stopping", "stopped"} <= set(states(controller))
    # The end of the campaign counts the runs in the library.
    assert controller.events[-1]["iterations"] == len(bench.kept()) >= 1


@pytest.mark.parametrize("pace", ["realtime", "lockstep"])
def test_one_drive_without_power_stops_the_other(bench: Bench, pace: str) -> None:
    """The other axis is brought to rest along its ramp and disabled, without a fault."""
    options = ["--lockstep"] if pace == "lockstep" else []
    cell = bench.cell(
        short=True, more="\n[safety]\nsilent_cycles_max = 100\nanswer_timeout_s = 1.0\n"
    )
    drives = bench.drives(cell, *options, "--mute", "2@3")
    controller = bench.controller(cell, *options, runs=10_000)
    drives.line_with("node 2: lost power")
    assert controller.end() == 3
    (line,) = controller.errors
    # At 0.1 m/s the command is 10 mm ahead of the last known position in less than 100 cycles.
    assert "drive of axis y (node 2) is silent: no answer in " in line
    assert states(controller)[-2:] == ["stopping", "stopped"]
    assert "1 (x) switch on disabled" in goodbye(drives)
    after = drives.said[drives.said.index(next(s for s in drives.said if "lost power" in s)) :]
    of_node_1 = [said.split("node 1: ")[1] for said in after if "node 1: " in said]
    assert of_node_1 == ["ready to switch on", "switch on disabled", "pre-operational"]


def test_a_tool_measurement_without_power_stops_both(bench: Bench) -> None:
    """Learning without measurement: both axes stop, and the node of the measurement is named."""
    cell = bench.cell(short=True, more="\n[safety]\nsilent_cycles_max = 100\n")
    drives = bench.drives(cell, "--mute", "10@3")
    controller = bench.controller(cell, runs=10_000)
    assert controller.end() == 3
    (line,) = controller.errors
    assert "tool measurement (node 10) is silent" in line
    assert BOTH_OFF in goodbye(drives)
    assert not any("EMCY" in said for said in drives.said)


def test_drives_stop_by_themselves_and_nothing_is_lost(bench: Bench) -> None:
    """After kill -9 of the controller, --resume continues with the same drives and loses no run."""
    cell = bench.cell(short=True, more="\n[safety]\nsilent_cycles_max = 250\n")
    drives = bench.drives(cell)
    controller = bench.controller(cell, runs=4)
    told = [controller.event(event="iteration", index=index)["digest"] for index in range(2)]
    moving(controller, run=2)
    controller.signal(signal.SIGKILL)
    for node in (1, 2):
        drives.line(
            lambda line, node=node: f"node {node}: EMCY 0x8250" in line, f"EMCY of node {node}"
        )
    assert controller.end() == -signal.SIGKILL
    kept = bench.kept()
    assert [digest for _, _, digest in kept] == told

    # The drives are still in fault: it is named and left, unless a person requests the reset.
    refused = bench.controller(cell, "--resume", runs=4)
    assert refused.end() == 2
    (line,) = refused.errors
    assert "axis x (node 1) is in fault: 0x8250" in line
    assert "--reset-faults" in line
    resumed = bench.controller(cell, "--resume", "--reset-faults", "--json", "figures.json", runs=4)
    start = resumed.event(event="start")
    assert (start["first_index"], start["campaign"]) == (2, kept[0][0])
    assert resumed.end() == 0, resumed.errors
    assert bench.kept()[:2] == kept
    assert [(campaign, index) for campaign, index, _ in bench.kept()] == [
        (kept[0][0], index) for index in range(4)
    ]
    assert "1 (x) switch on disabled, 2 (y) switch on disabled" in goodbye(drives)

    # Drives with power restored, and no runs left: refused, and nothing moves.
    drives = bench.drives(cell)
    again = bench.controller(cell, "--resume", runs=4)
    assert again.end() == 2
    assert again.errors == [
        f"ilc-rt: --resume: campaign {kept[0][0]} has 4 of 4 runs already; "
        "ask for more with --iterations"
    ]
    assert " 0 SYNC received" in goodbye(drives)
    assert len(bench.kept()) == 4


def test_a_resumed_campaign_is_the_one_that_was_not_cut(bench: Bench, tmp_path: Path) -> None:
    """In lock-step: two runs, then two more by other processes, equal four of one campaign."""
    cell = bench.cell(short=True)
    digests = []
    for folder, parts in ((tmp_path / "cut", [2, 4]), (tmp_path / "whole", [4])):
        folder.mkdir()
        with Bench(folder) as other:
            for part, runs in enumerate(parts):
                drives = other.drives(cell, "--lockstep")
                resume = ["--resume"] if part else []
                assert other.controller(cell, "--lockstep", *resume, runs=runs).end() == 0
                goodbye(drives)
            digests.append([digest for _, _, digest in other.kept()])
    cut, whole = digests
    assert len(whole) == 4
    # After a power cycle the axes start elsewhere, so friction leaves them at another rest
    # position.
    assert cut[:2] == whole[:2]

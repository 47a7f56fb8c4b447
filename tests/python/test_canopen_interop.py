"""python-canopen, an independent master, drives the simulated drives.

It runs over UDP multicast on this host (hop limit 0), against the program ``ilc-sim`` as users
run it.
"""

from __future__ import annotations

import contextlib
import subprocess
import time
from typing import TYPE_CHECKING

import canopen
import pytest
from interop_fixture import (
    CELL,
    COUNTS_PER_M,
    PATIENCE_S,
    START_COUNTS,
    STEP_COUNTS,
    Sim,
    attach,
    data_sheet,
    enable,
    find_sim,
    follow,
    running,
    wait_for_emergency,
    wait_until,
)

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="session")
def eds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the data sheet of the first drive."""
    return data_sheet(tmp_path_factory.mktemp("eds") / "drive.eds")


def test_boot_and_identity_and_texts(eds: Path) -> None:
    with running() as (_, network):
        node = attach(network, 1, eds)
        assert node.nmt.state == "PRE-OPERATIONAL"
        assert node.sdo[0x1000].raw == 0x0002_0192
        assert node.sdo[0x1018][4].raw == 1
        # Longer than four bytes: segmented, in both directions.
        assert node.sdo[0x1008].raw == "ilc-sim CiA 402 drive"
        node.sdo[0x2000].raw = "named by python-canopen"
        assert node.sdo[0x2000].raw == "named by python-canopen"
        with pytest.raises(canopen.SdoAbortedError) as refusal:
            node.sdo[0x6060].raw = 7
        assert refusal.value.code == 0x0609_0030
        with pytest.raises(canopen.SdoAbortedError) as refusal:
            node.sdo.upload(0x5FFF, 0)
        assert refusal.value.code == 0x0602_0000


def test_scan_finds_all_nodes() -> None:
    with running() as (_, network):
        network.scanner.search()
        wait_until(lambda: set(network.scanner.nodes) >= {1, 2, 10}, "answers of three nodes")
        assert sorted(network.scanner.nodes) == [1, 2, 10]


def test_pdo_configuration(eds: Path) -> None:
    with running() as (_, network):
        node = attach(network, 1, eds)
        node.tpdo.read()
        assert [variable.index for variable in node.tpdo[1]] == [0x6041, 0x6064, 0x6077]
        pdo = node.tpdo[1]
        pdo.clear()
        pdo.add_variable(0x6064)
        pdo.add_variable(0x606C)
        pdo.trans_type = 2
        pdo.enabled = True
        pdo.save()
        node.nmt.state = "OPERATIONAL"
        received: list[int] = []
        pdo.add_callback(lambda mapped: received.append(mapped[0].raw))
        for _ in range(6):
            network.sync.transmit()
        wait_until(lambda: len(received) >= 3, "three answers to six SYNC")
        # Answered: all earlier messages have arrived.
        assert node.sdo[0x6064].raw == received[-1] == START_COUNTS
        assert len(received) == 3


def test_position_move(eds: Path) -> None:
    with running() as (sim, network):
        node = attach(network, 1, eds)
        enable(network, node, "CYCLIC SYNCHRONOUS POSITION")
        sim.wait_line("node 1: operation enabled")
        last = follow(node, STEP_COUNTS, 20)
        assert last == START_COUNTS + 20 * STEP_COUNTS
        # Static friction leaves the axis slightly short until the integral has built up.
        wait_until(
            lambda: abs(node.tpdo_values[0x6064] - last) < COUNTS_PER_M * 0.0002,
            f"0.2 mm around {last}",
        )
        assert node.state == "OPERATION ENABLED"
        node.state = "SWITCH ON DISABLED"
        sim.wait_line("node 1: switch on disabled")


def test_velocity_move(eds: Path) -> None:
    with running() as (_, network):
        node = attach(network, 2, eds)
        # The data sheet is that of node 1: the identifiers are the node's own.
        node.rpdo.read()
        pdo = node.rpdo[1]
        pdo.clear()
        for index in (0x6040, 0x60FF, 0x60B2):
            pdo.add_variable(index)
        pdo.enabled = True
        pdo.save()
        enable(network, node, "CYCLIC SYNCHRONOUS VELOCITY")
        before = node.tpdo_values[0x6064]
        node.rpdo_pointers[0x60FF].raw = round(0.02 * COUNTS_PER_M)
        wait_until(
            lambda: node.tpdo_values[0x6064] > before + 0.005 * COUNTS_PER_M, "5 mm at 20 mm/s"
        )
        assert node.tpdo_values[0x606C] == pytest.approx(0.02 * COUNTS_PER_M, rel=0.05)


def test_quick_stop_holds(eds: Path) -> None:
    with running() as (_, network):
        node = attach(network, 1, eds)
        enable(network, node, "CYCLIC SYNCHRONOUS POSITION")
        follow(node, STEP_COUNTS, 10)
        node.state = "QUICK STOP ACTIVE"
        wait_until(lambda: abs(node.tpdo_values[0x606C]) < COUNTS_PER_M * 0.001, "standstill")
        assert node.state == "QUICK STOP ACTIVE"


def test_far_target_faults_and_is_reset(eds: Path) -> None:
    with running() as (sim, network):
        node = attach(network, 1, eds)
        enable(network, node, "CYCLIC SYNCHRONOUS POSITION")
        before = node.tpdo_values[0x6064]
        node.rpdo_pointers[0x607A].raw = 0
        wait_for_emergency(node, 0x8611)
        line = sim.wait_line("EMCY")
        assert line.endswith("node 1: EMCY 0x8611, following error")
        wait_until(node.is_faulted, "fault")
        assert node.sdo[0x603F].raw == 0x8611
        assert abs(node.tpdo_values[0x6064] - before) < 0.02 * COUNTS_PER_M
        node.rpdo_pointers[0x607A].raw = node.tpdo_values[0x6064]
        node.reset_from_fault()
        assert node.state == "OPERATION ENABLED"
        assert node.sdo[0x603F].raw == 0


def test_silent_controller_stops_the_drive(eds: Path) -> None:
    with running() as (sim, network):
        node = attach(network, 1, eds)
        node.sdo[0x1400][5].raw = 500
        enable(network, node, "CYCLIC SYNCHRONOUS POSITION")
        follow(node, STEP_COUNTS, 10)
        # SYNC goes on, commands do not.
        node.rpdo[1].stop()
        wait_for_emergency(node, 0x8250)
        assert "no command (RPDO) in time" in sim.wait_line("EMCY")
        wait_until(node.is_faulted, "fault")
        assert abs(node.tpdo_values[0x606C]) < COUNTS_PER_M * 0.001


def test_heartbeat_of_the_controller_is_watched(eds: Path) -> None:
    with running() as (sim, network):
        node = attach(network, 1, eds)
        enable(network, node, "CYCLIC SYNCHRONOUS POSITION")
        node.sdo[0x1016][1].raw = (100 << 16) | 1500
        beat = network.send_periodic(0x700 + 100, b"\x05", 0.02)
        try:
            # The first heartbeat starts the monitoring; twice the limit later the drive is still
            # operational.
            assert node.tpdo[1].wait_for_reception(timeout=PATIENCE_S) is not None
            end = time.monotonic() + 3.0
            while time.monotonic() < end:
                assert node.tpdo[1].wait_for_reception(timeout=PATIENCE_S) is not None
            assert node.state == "OPERATION ENABLED"
        finally:
            beat.stop()
        wait_for_emergency(node, 0x8130)
        sim.wait_line("EMCY 0x8130")
        # Its reaction to a lost controller: no process data, and the axis stopped.
        sim.wait_line("node 1: pre-operational")
        sim.wait_line("node 1: fault")


def test_drive_that_loses_power_goes_silent(eds: Path) -> None:
    with running("--mute", "2@0.2") as (sim, network):
        node = attach(network, 2, eds)
        node.sdo[0x1017].raw = 20
        node.nmt.wait_for_heartbeat(timeout=PATIENCE_S)
        # The time until it loses power begins.
        network.sync.transmit()
        sim.wait_line("node 2: lost power")
        # Frames in flight have arrived by then; 25 periods later there must be no more.
        with contextlib.suppress(canopen.nmt.NmtError):
            node.nmt.wait_for_heartbeat(timeout=0.1)
        with pytest.raises(canopen.nmt.NmtError):
            node.nmt.wait_for_heartbeat(timeout=0.5)


def test_in_lockstep_time_is_counted_in_syncs(eds: Path) -> None:
    with running("--lockstep") as (_, network):
        node = attach(network, 1, eds)
        beats: list[int] = []
        node.nmt.add_heartbeat_callback(beats.append)
        # The cell's cycle is 2 ms: one heartbeat in ten SYNCs, however long they take.
        node.sdo[0x1017].raw = 20
        for _ in range(35):
            network.sync.transmit()
        assert node.sdo[0x1017].raw == 20
        wait_until(lambda: len(beats) >= 3, "three heartbeats")
        assert beats == [0x7F] * 3


def test_summary_at_the_end() -> None:
    sim = Sim()
    last = sim.stop()
    assert last.startswith("stopped after ")
    assert "0 not sent; nodes 1 (x) switch on disabled, 2 (y) switch on disabled" in last


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["run", str(CELL), "--bus", "loopback:"], "own process"),
        (["run", str(CELL), "--mute", "9@1"], "the cell has nodes 1, 2, 10"),
        (["run", "absent.toml"], "absent.toml: cannot be read"),
        (["eds", str(CELL), "--node", "3"], "the cell has nodes 1, 2, 10"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], expected: str) -> None:
    result = subprocess.run(
        [find_sim(), *arguments], capture_output=True, text=True, check=False, timeout=PATIENCE_S
    )
    assert result.returncode == 2
    assert result.stdout == ""
    assert expected in result.stderr
    assert result.stderr.count("\n") == 1

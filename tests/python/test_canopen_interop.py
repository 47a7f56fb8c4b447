"""python-canopen, an independent master, drives the simulated drives.

It runs over UDP multicast on this host (hop limit 0), against the program ``ilc-sim`` as users
run it.
"""

from __future__ import annotations

import contextlib
import os
import queue
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import can
import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).resolve().parents[2]
CELL = ROOT / "examples" / "01_gantry.toml"
GROUP = "239.74.163.2"
SYNC_S = 0.01
PATIENCE_S = 5.0
COUNTS_PER_M = 100_000_000
START_COUNTS = 4_000_000
STEP_COUNTS = 50_000


def find_sim() -> Path:
    """Return the built ``ilc-sim``: beside Python, on the path, or in cargo's folder."""
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    beside = Path(sys.executable).parent / "ilc-sim"
    for candidate in (target / "release" / "ilc-sim", beside):
        if candidate.is_file():
            return candidate
    found = shutil.which("ilc-sim")
    assert found is not None, "ilc-sim is not built: `make build`"
    return Path(found)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return probe.getsockname()[1]


def wait_until(holds: Callable[[], bool], what: str, timeout_s: float = PATIENCE_S) -> None:
    """Wait for a condition; fail with its name."""
    deadline = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < deadline, f"not within {timeout_s} s: {what}"
        time.sleep(0.002)


class Sim:
    """A running ``ilc-sim`` and its output."""

    def __init__(self, *arguments: str) -> None:
        self.port = free_port()
        self.lines: list[str] = []
        self._incoming: queue.Queue[str | None] = queue.Queue()
        address = f"udp:{GROUP}:{self.port}"
        self._process = subprocess.Popen(
            [find_sim(), "run", CELL, "--bus", address, *arguments],
            stdout=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read)
        self._reader.start()
        ready = self.wait_line("ready")
        clock = "lock-step" if "--lockstep" in arguments else "real time"
        assert ready == f"ready: nodes 1 (x), 2 (y), 10 (tool) on {address}; {clock}"

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._incoming.put(line.rstrip())
        self._incoming.put(None)

    def wait_line(self, part: str) -> str:
        """Return the next line that contains ``part``."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            line = self._incoming.get(timeout=max(0.0, deadline - time.monotonic()))
            assert line is not None, f"ended before {part!r}: {self.lines}"
            self.lines.append(line)
            if part in line:
                return line

    def stop(self) -> str:
        """Interrupt it and return its last line."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        status = self._process.wait(timeout=PATIENCE_S)
        self._reader.join()
        assert self._process.stdout is not None
        self._process.stdout.close()
        while (line := self._incoming.get_nowait()) is not None:
            self.lines.append(line)
        assert status == 0
        return self.lines[-1]


@contextlib.contextmanager
def running(*arguments: str) -> Iterator[tuple[Sim, canopen.Network]]:
    """Run the drives and a CANopen network to them."""
    sim = Sim(*arguments)
    bus = can.Bus(interface="udp_multicast", channel=GROUP, port=sim.port, hop_limit=0)
    network = canopen.Network(bus=bus)
    network.connect()
    try:
        yield sim, network
    finally:
        for node in network.values():
            node.rpdo.stop()
        network.sync.stop()
        network.disconnect()
        sim.stop()


@pytest.fixture(scope="session")
def eds(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the data sheet of the first drive."""
    path = tmp_path_factory.mktemp("eds") / "drive.eds"
    text = subprocess.run(
        [find_sim(), "eds", CELL, "--node", "1"], check=True, capture_output=True, text=True
    ).stdout
    path.write_text(text)
    return path


def attach(network: canopen.Network, number: int, eds: Path) -> BaseNode402:
    """Reset a drive, wait for its boot-up, and return it."""
    node = BaseNode402(number, str(eds))
    network.add_node(node)
    # The defaults, 0.2 to 0.8 s, are too short on a busy machine.
    node.sdo.RESPONSE_TIMEOUT = 2.0
    node.TIMEOUT_CHECK_TPDO = 2.0
    node.TIMEOUT_SWITCH_OP_MODE = 5.0
    node.TIMEOUT_SWITCH_STATE_FINAL = 5.0
    node.TIMEOUT_SWITCH_STATE_SINGLE = 5.0
    # `wait_for_bootup` would miss an answer that arrives before it starts to wait.
    has_booted = threading.Event()
    node.nmt.add_heartbeat_callback(lambda state: has_booted.set() if state == 0 else None)
    node.nmt.state = "RESET COMMUNICATION"
    assert has_booted.wait(PATIENCE_S), f"no boot-up of node {number}"
    wait_until(lambda: node.nmt.state == "PRE-OPERATIONAL", "pre-operational")
    return node


def enable(network: canopen.Network, node: BaseNode402, mode: str) -> None:
    """Bring a drive from pre-operational to operation enabled, holding its position."""
    node.sdo[0x60C2][1].raw = round(SYNC_S * 1000)
    node.setup_402_state_machine()
    network.sync.start(SYNC_S)
    node.nmt.state = "OPERATIONAL"
    wait_until(lambda: node.tpdo_values.get(0x6041, 0) != 0, "a statusword")
    node.op_mode = mode
    assert node.op_mode == mode
    if mode == "CYCLIC SYNCHRONOUS POSITION":
        node.rpdo_pointers[0x607A].raw = node.tpdo_values[0x6064]
    # python-canopen sends a synchronous RPDO only if its period is set.
    node.rpdo[1].start(SYNC_S)
    node.state = "OPERATION ENABLED"


def follow(node: BaseNode402, step_counts: int, n_cycles: int) -> int:
    """Set a ramp of targets, one after each SYNC; return the last."""
    target = node.rpdo_pointers[0x607A]
    for _ in range(n_cycles):
        assert node.tpdo[1].wait_for_reception(timeout=2.0) is not None
        target.raw += step_counts
    return target.raw


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
            node.sdo[0x6060].raw = 1
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
        emergency = node.emcy.wait(0x8611, timeout=PATIENCE_S)
        assert emergency is not None
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
        assert node.emcy.wait(0x8250, timeout=PATIENCE_S) is not None
        assert "no command (RPDO) in time" in sim.wait_line("EMCY")
        wait_until(node.is_faulted, "fault")
        assert abs(node.tpdo_values[0x606C]) < COUNTS_PER_M * 0.001


def test_heartbeat_of_the_controller_is_watched(eds: Path) -> None:
    with running() as (sim, network):
        node = attach(network, 1, eds)
        enable(network, node, "CYCLIC SYNCHRONOUS POSITION")
        node.sdo[0x1016][1].raw = (100 << 16) | 500
        beat = network.send_periodic(0x700 + 100, b"\x05", 0.02)
        try:
            # The first heartbeat starts the monitoring; twice the limit later the drive is still
            # operational.
            assert node.tpdo[1].wait_for_reception(timeout=2.0) is not None
            end = time.monotonic() + 1.0
            while time.monotonic() < end:
                assert node.tpdo[1].wait_for_reception(timeout=2.0) is not None
            assert node.state == "OPERATION ENABLED"
        finally:
            beat.stop()
        assert node.emcy.wait(0x8130, timeout=PATIENCE_S) is not None
        sim.wait_line("EMCY 0x8130")
        # Its reaction to a lost controller: no process data, and the axis stopped.
        sim.wait_line("node 1: pre-operational")
        sim.wait_line("node 1: fault")


def test_drive_that_loses_power_goes_silent(eds: Path) -> None:
    with running("--mute", "2@3.0") as (sim, network):
        node = attach(network, 2, eds)
        node.sdo[0x1017].raw = 20
        node.nmt.wait_for_heartbeat(timeout=1.0)
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

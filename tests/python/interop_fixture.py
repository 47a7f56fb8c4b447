"""python-canopen, an independent master, and the program ``ilc-sim`` on a bus of their own.

The bus is UDP multicast on this host (hop limit 0), or the CAN interface named by ILC_INTEROP_CAN.
"""

from __future__ import annotations

import contextlib
import os
import queue
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import can
import canopen
from canopen.profiles.p402 import BaseNode402
from ports_fixture import GROUP, free_port

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).resolve().parents[2]
CELL = ROOT / "examples" / "01_gantry.toml"
SYNC_S = 0.01
PATIENCE_S = 30.0
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


def wait_until(holds: Callable[[], bool], what: str, timeout_s: float = PATIENCE_S) -> None:
    """Wait for a condition; fail with its name."""
    deadline = time.monotonic() + timeout_s
    while not holds():
        assert time.monotonic() < deadline, f"not within {timeout_s} s: {what}"
        time.sleep(0.002)


def wait_for_emergency(node: canopen.RemoteNode, code: int) -> None:
    """Wait for an emergency message; `emcy.wait` misses one that comes before it begins to wait."""
    wait_until(lambda: code in [error.code for error in node.emcy.log], f"emergency {code:#06x}")


class Sim:
    """A running ``ilc-sim`` and its output."""

    def __init__(self, *arguments: str, cell: Path = CELL) -> None:
        self.port = free_port()
        interface = os.environ.get("ILC_INTEROP_CAN")
        self.lines: list[str] = []
        self._incoming: queue.Queue[str | None] = queue.Queue()
        address = f"can:{interface}" if interface else f"udp:{GROUP}:{self.port}"
        self._process = subprocess.Popen(
            [find_sim(), "run", cell, "--bus", address, *arguments],
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
def running(*arguments: str, cell: Path = CELL) -> Iterator[tuple[Sim, canopen.Network]]:
    """Run the drives and a CANopen network to them."""
    sim = Sim(*arguments, cell=cell)
    interface = os.environ.get("ILC_INTEROP_CAN")
    if interface:
        bus = can.Bus(interface="socketcan", channel=interface)
    else:
        bus = can.Bus(interface="udp_multicast", channel=GROUP, port=sim.port, hop_limit=0)
    network = canopen.Network(bus=bus)
    network.connect()
    try:
        yield sim, network
    finally:
        disconnect(network)
        sim.stop()


def disconnect(network: canopen.Network) -> None:
    """End what a network sends periodically, wait for its last frames, and close its bus."""
    # Once each: SocketCAN does not know a task any more that it has stopped.
    for node in network.values():
        node.pdo.stop()
    network.sync.stop()
    # `stop` sets a flag only: its thread may be on the way to the bus, which must still be open.
    for thread in threading.enumerate():
        if thread.name.startswith("Cyclic send task"):
            thread.join()
    network.disconnect()


def data_sheet(path: Path, cell: Path = CELL, node: int = 1) -> Path:
    """Write the data sheet of a drive and return its path."""
    text = subprocess.run(
        [find_sim(), "eds", cell, "--node", str(node)], check=True, capture_output=True, text=True
    ).stdout
    path.write_text(text)
    return path


def attach(network: canopen.Network, number: int, eds: Path) -> BaseNode402:
    """Reset a drive, wait for its boot-up, and return it."""
    node = BaseNode402(number, str(eds))
    network.add_node(node)
    # python-can hears its own multicast, on a busy machine after the answer to it: its own command,
    # taken for another master's, would then undo the state that the answer has told.
    network.unsubscribe(0, node.nmt.on_command)
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
        assert node.tpdo[1].wait_for_reception(timeout=PATIENCE_S) is not None
        target.raw += step_counts
    return target.raw

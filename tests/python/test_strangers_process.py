"""Foreign programs on the same bus or network, beside the real ones."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import textwrap
import time
import uuid
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from ports_fixture import free_port
from processes_fixture import PATIENT, Bench, Process, goodbye

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path) as bench:
        yield bench


def refused(process: Process, *parts: str) -> None:
    """Check that a program refuses with one line that has all parts."""
    assert process.end() == 2
    (line,) = process.errors
    for part in parts:
        assert part in line, line


def test_a_second_simulator_refuses_where_idle_drives_are(bench: Bench) -> None:
    """It asks, receives an answer, and has sent no boot-up."""
    cell = bench.cell(short=True)
    drives = bench.drives(cell)
    second = bench.start("ilc-sim", "run", cell, "--bus", bench.bus)
    refused(second, bench.bus, "node 1 is on this bus already", "stop it, or give --bus")
    assert second.said == []
    assert "stopped after" in goodbye(drives)
    bench.drives(cell)


def test_nobody_disturbs_a_campaign_that_is_under_way(bench: Bench) -> None:
    """A second simulator and a second controller exit; every run is kept."""
    cell = bench.cell(short=True, more=PATIENT)
    bench.drives(cell)
    controller = bench.controller(cell, "--simulated-drives", runs=4)
    controller.event(event="state", state="running", iteration=0)
    refused(bench.start("ilc-sim", "run", cell, "--bus", bench.bus), "is on this bus already")
    second = bench.start(
        "ilc-rt", "run", cell, "--bus", bench.bus, "--iterations", "1",
        "--library", bench.folder / "other.db", "--no-telemetry",
    )  # fmt: skip
    refused(second, "another master is at work on this bus (", "heard); nothing was sent")
    assert controller.end() == 0, controller.errors
    assert len(bench.kept()) == 4


def test_a_bus_is_free_again_after_a_controller_was_killed(bench: Bench) -> None:
    """The drives stop on their own, and the next controller may use the bus."""
    cell = bench.cell(short=True, more=PATIENT)
    bench.drives(cell)
    controller = bench.controller(cell, runs=4)
    controller.event(event="state", state="running", iteration=0)
    controller.close()
    again = bench.controller(cell, "--reset-faults", "--simulated-drives", runs=1)
    assert again.end() == 0, again.errors


zenoh = pytest.importorskip("zenoh")

STRANGER = textwrap.dedent(
    """
    import json, sys, time, zenoh
    session = zenoh.open(zenoh.Config())
    heard = []
    subscriber = session.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr)))
    stop = bytes([0, 0, 2, 0])
    until = time.monotonic() + float(sys.argv[1])
    while time.monotonic() < until:
        session.put(f"{sys.argv[2]}/stranger", stop)
        time.sleep(0.05)
    print(json.dumps(sorted(set(heard))), flush=True)
    session.close()
    """
)


def ip(*words: str) -> None:
    """Run `ip` with arguments, e.g. `ip link add`."""
    subprocess.run(["ip", *words], check=True, capture_output=True)


@pytest.fixture
def two_hosts() -> Iterator[tuple[str, str]]:
    """Return the names of two network namespaces connected by a veth pair."""
    if shutil.which("ip") is None or os.geteuid() != 0:
        pytest.skip("two network namespaces need iproute2 and root")
    tag = uuid.uuid4().hex[:6]
    ours, theirs = f"ilc-{tag}-a", f"ilc-{tag}-b"
    try:
        ip("netns", "add", ours)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"network namespaces are not permitted here: {error.stderr!r}")
    try:
        ip("netns", "add", theirs)
        ip("link", "add", f"v{tag}a", "netns", ours, "type", "veth",
           "peer", "name", f"v{tag}b", "netns", theirs)  # fmt: skip
        for host, end, address in ((ours, "a", "10.213.7.1/24"), (theirs, "b", "10.213.7.2/24")):
            ip("-n", host, "link", "set", "lo", "up")
            ip("-n", host, "address", "add", address, "dev", f"v{tag}{end}")
            ip("-n", host, "link", "set", f"v{tag}{end}", "up")
            ip("-n", host, "route", "add", "default", "dev", f"v{tag}{end}")
        yield ours, theirs
    finally:
        for host in (ours, theirs):
            subprocess.run(["ip", "netns", "delete", host], check=False, capture_output=True)


class On:
    """Starts programs in a network namespace."""

    def __init__(self, bench: Bench, host: str) -> None:
        self._bench = bench
        self._prefix = ["ip", "netns", "exec", host]

    def start(self, *argv: str | Path) -> Process:
        """Start a program of the project there."""
        from processes_fixture import program

        process = Process([*self._prefix, program(str(argv[0])), *argv[1:]], self._bench.folder)
        self._bench._processes.append(process)
        return process

    def python(self, *argv: str) -> subprocess.Popen[str]:
        """Start Python there."""
        command = [*self._prefix, sys.executable, *argv]
        return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def test_a_zenoh_bus_and_its_telemetry_stay_on_their_host(
    bench: Bench, two_hosts: tuple[str, str]
) -> None:
    """A foreign session on the next host has no access; a monitor here receives all."""
    ours, theirs = (On(bench, host) for host in two_hosts)
    key = "test/cell/bus"
    cell = bench.cell(short=True, more=PATIENT)
    drives = ours.start("ilc-sim", "run", cell, "--bus", f"zenoh:{key}")
    drives.line_with("ready:")
    stranger = theirs.python("-c", STRANGER, "12", key)
    monitor = ours.python("-m", "ilc_rt.cli", "monitor", "gantry", "-n", "3", "--timeout", "40")
    # Discovery has time before the campaign begins.
    time.sleep(2.0)
    controller = ours.start(
        "ilc-rt", "run", cell, "--bus", f"zenoh:{key}", "--iterations", "3",
        "--library", bench.library, "--events", "--simulated-drives",
    )  # fmt: skip
    try:
        assert controller.end() == 0, controller.errors
        heard, _ = stranger.communicate(timeout=40)
        seen, _ = monitor.communicate(timeout=60)
    finally:
        for process in (stranger, monitor):
            process.kill()
            process.wait()
    assert len(bench.kept()) == 3
    assert json.loads(heard) == [f"{key}/stranger"] or json.loads(heard) == []
    assert "gantry: controller alive" in seen


def resident_mb(pid: int) -> float:
    """Return the resident memory of a process."""
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return float(line.split()[1]) / 1024.0
    raise AssertionError(pid)


def test_strangers_do_not_fill_the_memory(bench: Bench) -> None:
    """Huge queries and idle connections cost the controller almost nothing."""
    port = free_port(socket.SOCK_STREAM)
    endpoint = f"tcp/127.0.0.1:{port}"
    more = f'\n[telemetry]\nscouting = false\nlisten = ["{endpoint}"]\n'
    cell = bench.cell(short=True, more=more)
    bench.drives(cell, "--lockstep")
    controller = bench.start(
        "ilc-rt", "run", cell, "--lockstep", "--bus", bench.bus, "--iterations", "100000",
        "--library", bench.library, "--events",
    )  # fmt: skip
    controller.event(event="iteration", index=1)
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("listen/endpoints", "[]")
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    idle: list[socket.socket | None] = []
    try:
        before_mb = resident_mb(controller.pid)
        for _ in range(4):
            list(session.get("ilc/gantry/state", payload=bytes(60_000_000), timeout=0.5))
        idle.extend(connected(port) for _ in range(300))
        after_mb = resident_mb(controller.pid)
    finally:
        for connection in idle:
            if connection is not None:
                connection.close()
        session.close()
    assert after_mb - before_mb < 64.0, f"{before_mb:.0f} MB, then {after_mb:.0f} MB"
    controller.event(event="iteration", index=controller.events[-1].get("index", 1) + 2)


def connected(port: int) -> socket.socket | None:
    """Return an idle connection, if it was accepted."""
    try:
        return socket.create_connection(("127.0.0.1", port), timeout=0.5)
    except OSError:
        return None

"""Options of the verbs that hear controllers: the same everywhere, and a router that passes on."""

from __future__ import annotations

import json
import signal
import socket
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest
import typer.main
from ports_fixture import free_port
from postgres_fixture import server
from processes_fixture import Process

from ilc_rt.cli import application
from ilc_rt.fleet import Collector, FleetLibrary

zenoh = pytest.importorskip("zenoh")

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

pytestmark = pytest.mark.xdist_group("postgres")

VERBS = (
    ("monitor",), ("dashboard",), ("bridge", "plotjuggler"), ("bridge", "foxglove"),
    ("library", "collect"),
)  # fmt: skip
SHARED = ("connect", "scouting", "router", "timeout")
START = {
    "event": "start", "cell": "gantry", "campaign": "c1", "n_samples": 50, "n_axes": 1,
    "axis_names": ["x"], "cycle_s": 0.002, "first_index": 0, "iterations": 1, "measure": "encoder",
    "law": "pd", "bus": "loopback:", "mode": "realtime", "input_units": ["m"],
}  # fmt: skip
RUN = {
    "event": "iteration", "id": 1, "index": 0, "digest": "d", "tracking_inf_m": 1e-3,
    "tracking_rms_m": 1e-3,
}  # fmt: skip


def test_every_verb_that_hears_has_the_same_options() -> None:
    app: Any = typer.main.get_command(application())
    told = []
    for words in VERBS:
        command = app
        for word in words:
            command = command.commands[word]
        options = {one.name: one for one in command.params}
        told.append([(options[n].opts, options[n].help, options[n].default) for n in SHARED])
    assert all(one == told[0] for one in told)


class Routed:
    """A router, and a cell that reaches nothing but it."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        self._router = self._open("router", listen=[self.endpoint])
        self._cell = self._open("client", connect=[self.endpoint])
        self._token = self._cell.liveliness().declare_token("ilc/gantry/alive")

    def _open(self, mode: str, **ends: list[str]) -> Any:
        config = zenoh.Config()
        config.insert_json5("mode", json.dumps(mode))
        config.insert_json5("scouting/multicast/enabled", "false")
        for end, endpoints in ends.items():
            config.insert_json5(f"{end}/endpoints", json.dumps(endpoints))
        return zenoh.open(config)

    def put(self, topic: str, payload: dict[str, Any]) -> None:
        """Publish as the cell."""
        self._cell.put(f"ilc/gantry/{topic}", json.dumps(payload))

    def watch(self, folder: Path, *words: str) -> Process:
        """Start a verb that hears through the router."""
        argv = [sys.executable, "-m", "ilc_rt.cli", *words, "--no-scouting", "--router",
                "--connect", self.endpoint]  # fmt: skip
        return Process(argv, folder)

    def close(self) -> None:
        """End both."""
        self._cell.close()
        self._router.close()


@pytest.fixture
def routed() -> Iterator[Routed]:
    routed = Routed()
    yield routed
    routed.close()


def until(happened: Callable[[], object], again: Callable[[], object], process: Process) -> None:
    """Publish again until something has happened; a subscription takes effect at some time."""
    end_s = time.monotonic() + 60.0
    while time.monotonic() < end_s:
        again()
        if happened():
            return
        time.sleep(0.05)
    pytest.fail(f"nothing was heard through the router: {process.errors}")


def test_a_bridge_hears_through_a_router(routed: Routed, tmp_path: Path) -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as reader:
        reader.bind(("127.0.0.1", 0))
        reader.settimeout(0.1)
        to = f"127.0.0.1:{reader.getsockname()[1]}"
        process = routed.watch(tmp_path, "bridge", "plotjuggler", "gantry", "--to", to)
        got: list[Any] = []

        def heard() -> bool:
            try:
                got.append(json.loads(reader.recv(65536)))
            except TimeoutError:
                return False
            return True

        try:
            until(heard, lambda: routed.put("iteration", RUN), process)
            process.signal(signal.SIGINT)
            assert process.end() == 130, process.errors
        finally:
            process.close()
    assert got[0]["gantry"]["iteration"]["tracking_rms_m"] == 1e-3
    assert not any("Traceback" in line for line in process.errors)


def test_a_collector_hears_through_a_router_and_keeps_what_it_stored(
    routed: Routed, tmp_path: Path
) -> None:
    """Ctrl-C ends it with its tally; nothing that was heard is lost."""
    with server() as postgres:
        address = postgres.database()
        # The tables are made by the first writer.
        Collector(address).close()
        file = tmp_path / "stored.json"
        process = routed.watch(
            tmp_path, "library", "collect", address, "--json", str(file), "--timeout", "120"
        )
        try:
            with FleetLibrary(address) as fleet:

                def publish() -> None:
                    routed.put("state", START)
                    routed.put("iteration", RUN)

                until(lambda: len(fleet), publish, process)
            process.signal(signal.SIGINT)
            assert process.end() == 130, process.errors
        finally:
            process.close()
    assert "1 run stored" in process.said
    assert json.loads(file.read_text()) == {"stored": 1}
    assert not any("Traceback" in line for line in process.errors)

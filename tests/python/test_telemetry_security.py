"""Telemetry through a router with TLS and access rights, as its document describes it."""

from __future__ import annotations

import json
import re
import shutil
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from ports_fixture import free_port
from processes_fixture import Bench

from ilc_rt.errors import CampaignError
from ilc_rt.events import EndEvent, IterationEvent
from ilc_rt.monitor import Monitor

zenoh = pytest.importorskip("zenoh")

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [
    pytest.mark.xdist_group("security"),
    pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl is installed"),
]

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs/telemetry-security.md").read_text(encoding="utf-8")
ROUTER = (ROOT / "examples/telemetry_router.json5").read_text(encoding="utf-8")
COMMAND = re.search(r"--connect '([^']*)'", DOCUMENT)


class Router:
    """The router of the example on free ports, with the certificates of the document."""

    def __init__(self, folder: Path) -> None:
        block = re.search(r"```sh\n(openssl.*?)```", DOCUMENT, re.DOTALL)
        assert block is not None
        subprocess.run(["bash", "-ec", block[1]], cwd=folder, check=True, capture_output=True)
        ports = {name: free_port(socket.SOCK_STREAM) for name in ("7447", "7448")}
        text = re.sub("|".join(ports), lambda found: str(ports[found[0]]), ROUTER)
        for file in ("ca.pem", "router.pem", "router.key"):
            text = text.replace(f'"{file}"', json.dumps(str(folder / file)))
        self._folder, self._port = folder, ports["7447"]
        self.within = f"tcp/127.0.0.1:{ports['7448']}"
        (folder / "router.json5").write_text(text)
        self.session = zenoh.open(zenoh.Config.from_file(str(folder / "router.json5")))

    def endpoint(self, name: str) -> str:
        """Return the endpoint of the document, with the certificate of a name."""
        assert COMMAND is not None
        text = COMMAND[1].replace("7447", str(self._port)).replace("monitor.", f"{name}.")
        return re.sub(r"(\w+\.(?:pem|key))", lambda file: str(self._folder / file[0]), text)


@pytest.fixture(scope="module")
def router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Router]:
    router = Router(tmp_path_factory.mktemp("router"))
    yield router
    router.session.close()


class Heard:
    """Messages that a monitor hears, collected beside the test until the controller has gone."""

    def __init__(self, monitor: Monitor) -> None:
        self.topics: list[str] = []
        self.events: list[Any] = []
        self._stop = threading.Event()
        self._monitor = monitor
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        while not self._stop.is_set() and "gone" not in self.topics:
            for message in self._monitor.messages(0.2):
                self.topics.append(message.topic)
                self.events.append(message.event)

    def wait(self, timeout_s: float | None) -> None:
        """Wait until the controller has gone; without a time, end at once."""
        if timeout_s is not None:
            self._thread.join(timeout_s)
        self._stop.set()
        self._thread.join()


def test_only_who_has_the_right_hears_a_cell(router: Router, tmp_path: Path) -> None:
    """The monitor hears the campaign to its end; a guest with a valid certificate hears nothing."""
    telemetry = f'\n[telemetry]\nconnect = ["{router.within}"]\nscouting = false\n'
    with (
        Bench(tmp_path) as bench,
        Monitor("gantry", [router.endpoint("monitor")], scouting=False, router=True) as monitor,
        Monitor("gantry", [router.endpoint("guest")], scouting=False, router=True) as guest,
    ):
        seen, unseen = Heard(monitor), Heard(guest)
        cell = bench.cell(short=True, more=telemetry)
        bench.drives(cell, "--lockstep")
        controller = bench.start(
            "ilc-rt", "run", cell, "--bus", bench.bus, "--iterations", "3", "--library",
            bench.library, "--events", "--lockstep",
        )  # fmt: skip
        assert controller.end() == 0
        seen.wait(60.0)
        # Everything that the monitor got was routed before; nothing is under way to the guest.
        unseen.wait(None)
    assert {"alive", "state", "iteration", "gone"} <= set(seen.topics)
    runs = [event.index for event in seen.events if isinstance(event, IterationEvent)]
    assert runs == [0, 1, 2]
    assert any(isinstance(event, EndEvent) for event in seen.events)
    assert unseen.topics == []


def test_a_monitor_cannot_pass_itself_off_as_a_cell(router: Router) -> None:
    """Its own messages reach no other monitor; those of a cell do."""
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([router.within]))
    config.insert_json5("scouting/multicast/enabled", "false")
    forged = {"event": "fault", "reason": "forged"}
    with (
        Monitor("press", [router.endpoint("monitor")], scouting=False, router=True) as reader,
        Monitor("press", [router.endpoint("monitor")], scouting=False, router=True) as forger,
        zenoh.open(config) as cell,
    ):
        heard: list[Any] = []
        for _ in range(200):
            forger._session.put("ilc/press/fault", json.dumps(forged))
            cell.put("ilc/press/fault", json.dumps({**forged, "reason": "real"}))
            heard += [message.payload["reason"] for message in reader.messages(0.2)]
            if len(heard) > 5:
                break
    assert set(heard) == {"real"}


def test_without_a_certificate_there_is_no_connection(router: Router, tmp_path: Path) -> None:
    """Neither without one, nor with one of another authority."""
    bare = re.sub(r";connect_.*", "", router.endpoint("monitor"))
    with (
        pytest.raises(CampaignError, match="no Zenoh session"),
        Monitor("x", [bare], scouting=False, router=True),
    ):
        pass
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256",
         "-nodes", "-subj", "/CN=monitor", "-keyout", "own.key", "-out", "own.pem"],
        cwd=tmp_path, check=True, capture_output=True,
    )  # fmt: skip
    own = re.sub(r"=[^=;]*monitor\.", f"={tmp_path}/own.", router.endpoint("monitor"))
    with (
        pytest.raises(CampaignError, match="no Zenoh session"),
        Monitor("x", [own], scouting=False, router=True),
    ):
        pass


def test_the_command_of_the_document_watches_through_the_router(router: Router) -> None:
    """`ilc monitor` with the endpoint as it is written there."""
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([router.within]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with (
        zenoh.open(config) as cell,
        cell.declare_publisher("ilc/gantry/iteration") as runs,
        cell.liveliness().declare_token("ilc/gantry/alive"),
        subprocess.Popen(
            [sys.executable, "-m", "ilc_rt.cli", "monitor", "gantry", "--no-scouting",
             "--router", "--connect",
             router.endpoint("monitor"), "--timeout", "60", "--iterations", "1"],
            stdout=subprocess.PIPE, text=True,
        ) as process,
    ):  # fmt: skip
        assert process.stdout is not None
        assert process.stdout.readline() == "gantry: controller alive\n"
        run = {"event": "iteration", "id": 1, "index": 0, "tracking_inf_m": 1e-3,
               "tracking_rms_m": 1e-3}  # fmt: skip
        # The token may be routed back before the subscription has reached this session.
        listener = runs.declare_matching_listener()
        while not runs.matching_status.matching:
            listener.recv()
        runs.put(json.dumps(run))
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "1000" in out

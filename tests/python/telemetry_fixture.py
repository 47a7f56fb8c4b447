"""A Zenoh subscriber that keeps what it hears of a cell, and a controller that publishes."""

from __future__ import annotations

import json
import socket
import threading
from typing import TYPE_CHECKING, Any

import zenoh
from ports_fixture import free_port
from processes_fixture import DEADLINE_S

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from processes_fixture import Bench, Process


def endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"


def telemetry(*, listen: Sequence[str] = (), connect: Sequence[str] = ()) -> str:
    """Return the section of a cell whose telemetry stays on this computer."""
    ends = f"listen = {json.dumps(list(listen))}\nconnect = {json.dumps(list(connect))}\n"
    return f"\n[telemetry]\nscouting = false\n{ends}"


def direct(callback: Callable[[Any], object]) -> zenoh.handlers.Callback:
    """Let a callback run in the order of arrival: by default each has a thread of its own."""
    return zenoh.handlers.Callback(callback, indirect=False)


class Watcher:
    """A session that keeps everything it receives."""

    def __init__(self, *, listen: Sequence[str] = (), connect: Sequence[str] = ()) -> None:
        config = zenoh.Config()
        config.insert_json5("listen/endpoints", json.dumps(list(listen)))
        config.insert_json5("connect/endpoints", json.dumps(list(connect)))
        config.insert_json5("scouting/multicast/enabled", "false")
        self.heard: dict[str, list[dict[str, Any]]] = {}
        self.tokens: list[str] = []
        self._news = threading.Condition()
        self.session = zenoh.open(config)
        self.session.liveliness().declare_subscriber(
            "ilc/gantry/alive", direct(self._on_token), history=True
        )
        self.session.declare_subscriber("ilc/gantry/*", direct(self._on_value))
        # The controller waits for the answer, which comes after what was sent before.
        self.session.declare_queryable(
            "ilc/gantry/heard", direct(lambda query: query.reply(query.key_expr, b""))
        )

    def _on_token(self, sample: zenoh.Sample) -> None:
        with self._news:
            self.tokens.append("gone" if str(sample.kind).endswith("DELETE") else "alive")
            self._news.notify_all()

    def _on_value(self, sample: zenoh.Sample) -> None:
        with self._news:
            key = str(sample.key_expr).rpartition("/")[2]
            self.heard.setdefault(key, []).append(json.loads(sample.payload.to_bytes()))
            self._news.notify_all()

    def wait_for_tokens(self, *tokens: str) -> None:
        """Wait until exactly these have arrived."""
        with self._news:
            assert self._news.wait_for(lambda: self.tokens == list(tokens), DEADLINE_S), self.tokens

    def history_asked(self) -> list[dict[str, Any]]:
        """Query the campaign so far."""
        replies = self.session.get(
            "ilc/gantry/history/*",
            timeout=DEADLINE_S,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        return [json.loads(reply.ok.payload.to_bytes()) for reply in replies if reply.ok]

    def states_asked(self) -> list[dict[str, Any]]:
        """Query the state, as a late joiner does."""
        replies = self.session.get("ilc/gantry/state", timeout=DEADLINE_S)
        return [json.loads(reply.ok.payload.to_bytes()) for reply in replies if reply.ok]


def start(bench: Bench, cell: Path, *options: str, runs: int) -> Process:
    """Start the controller with telemetry."""
    return bench.start(
        "ilc-rt", "run", cell, "--bus", bench.bus, "--iterations", str(runs),
        "--library", bench.library, "--events", *options,
    )  # fmt: skip

"""Foxglove: the WebSocket server that the Foxglove app opens by address.

Topics: ``/CELL/AXIS`` (signals of each servo cycle), ``/CELL/iteration`` (figures of each run) and
``/CELL/log`` (states and faults in words, as `foxglove.Log`). The package `foxglove-sdk` speaks the
protocol.
"""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Any

from ilc_rt.addresses import reached, unusable
from ilc_rt.bridge.signals import Cells
from ilc_rt.closing import Closing
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import EndEvent, FaultEvent, IterationEvent, StartEvent, StateEvent
from ilc_rt.misfit import is_number
from ilc_rt.wording import WORDS, describe

if TYPE_CHECKING:
    from ilc_rt import Cell
    from ilc_rt.bridge.signals import Recall
    from ilc_rt.monitor import Message

PORT = 8765
"""Port that Foxglove proposes."""
NUMBER = {"type": "number"}


class Foxglove(Closing):
    """Server of the signals of cells for Foxglove.

    Parameters
    ----------
    host, port : str, int
        Address to listen on; the default is reached from this computer only. Port 0 takes a free
        one.
    described : Cell, optional
        Description of the cell, for the names of its axes before it starts.
    recall : callable, optional
        Returns the stored runs of a cell, which name its axes after its start.

    Raises
    ------
    CampaignError
        If `foxglove-sdk` is not installed.
    BadInputError
        If the address cannot be listened on.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        described: Cell | None = None,
        recall: Recall | None = None,
    ) -> None:
        try:
            import foxglove
        except ImportError as error:
            message = "this bridge needs foxglove-sdk: pip install 'ilc-rt[foxglove]'"
            raise CampaignError(message) from error
        self._sdk = foxglove
        self._context = foxglove.Context()
        try:
            self._server = foxglove.start_server(
                name="ilc-rt", host=host, port=port, context=self._context
            )
        except RuntimeError as error:
            # As "FoxgloveError: Failed to bind port: Address already in use (os error 98)".
            reason = str(error).rpartition(": ")[2].partition(" (os error")[0]
            raise BadInputError(unusable(host, port, reason)) from error
        self._host = host
        self._channels: dict[str, foxglove.Channel] = {}
        self._cells = Cells(described, recall)

    def close(self) -> None:
        """End the server."""
        self._server.stop()

    @property
    def address(self) -> str:
        """Address to type in Foxglove, as ``ws://127.0.0.1:8765``."""
        return f"ws://{reached(self._host, self._server.port)}"

    def show(self, message: Message) -> None:
        """Send on what a message has."""
        for row in self._cells.rows(message):
            run = {} if row.iteration is None else {"run": row.iteration}
            for axis, signals in row.axes.items():
                self._log(f"/{message.cell}/{axis}", {**run, **signals}, row.time_s)
        event = message.event
        if isinstance(event, IterationEvent):
            figures = {key: value for key, value in message.payload.items() if is_number(value)}
            self._log(f"/{message.cell}/iteration", figures, time.time())
        words = _words(event)
        if words is not None:
            level = 4 if isinstance(event, FaultEvent) else 2
            self._say(f"/{message.cell}/log", message.cell, words, level)

    def _log(self, topic: str, values: dict[str, Any], time_s: float) -> None:
        if topic not in self._channels:
            properties = dict.fromkeys(values, NUMBER)
            schema = {"type": "object", "title": "Signals", "properties": properties}
            self._channels[topic] = self._sdk.Channel(topic, schema=schema, context=self._context)
        self._channels[topic].log(values, log_time=round(time_s * 1e9))

    def _say(self, topic: str, cell: str, words: str, level: int) -> None:
        if topic not in self._channels:
            schema = self._sdk.Schema(
                name="foxglove.Log", encoding="jsonschema", data=json.dumps(LOG).encode()
            )
            self._channels[topic] = self._sdk.Channel(
                topic, schema=schema, message_encoding="json", context=self._context
            )
        second, part = divmod(time.time_ns(), 10**9)
        said = {
            "timestamp": {"sec": second, "nsec": part},
            "level": level,
            "message": words,
            "name": cell,
            "file": "",
            "line": 0,
        }
        self._channels[topic].log(said)


LOG = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "title": "time",
                      "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "level": {"type": "integer"},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer"},
    },
}  # fmt: skip
"""Schema of a line of Foxglove's log panel."""


def _words(event: object) -> str | None:
    """Return the sentence of an event that has one."""
    if isinstance(event, StartEvent):
        return describe(event)
    if isinstance(event, StateEvent):
        run = "" if event.iteration is None else f" (run {event.iteration})"
        return f"{WORDS.get(event.state, event.state)}{run}"
    if isinstance(event, FaultEvent):
        return event.reason
    if isinstance(event, EndEvent):
        return f"{event.status}: {event.reason}" if event.reason else event.status
    return None


def layout(cell: Cell) -> str:
    """Return a Foxglove layout for a cell: errors, learned inputs, error by run, log."""
    prefix = f"/{cell.name}"
    axes = list(zip(cell.axis_names, cell.axis_units, strict=True))

    def plot(title: str, paths: list[str]) -> dict[str, Any]:
        return {
            "title": title,
            "paths": [
                {"value": path, "enabled": True, "timestampMethod": "receiveTime"} for path in paths
            ],
            "xAxisVal": "timestamp",
            "showLegend": True,
            "followingViewWidth": 10,
        }

    def signal(name: str) -> list[str]:
        return [f"{prefix}/{axis}.{name}_{unit}" for axis, unit in axes]

    panels = {
        "Plot!encoder": plot("error at the encoder", signal("encoder_error")),
        "Plot!tool": plot("error at the tool", signal("tool_error")),
        "Plot!input": plot("learned input", [f"{prefix}/{name}.input" for name in cell.axis_names]),
        "Plot!runs": plot("RMS error of each run", [f"{prefix}/iteration.tracking_rms_m"]),
        "RosOut!log": {"topicToRender": f"{prefix}/log"},
    }
    column = {
        "first": {"first": "Plot!encoder", "second": "Plot!tool", "direction": "column"},
        "second": "Plot!input",
        "direction": "column",
        "splitPercentage": 66,
    }
    side = {"first": "Plot!runs", "second": "RosOut!log", "direction": "column"}
    return json.dumps(
        {
            "configById": panels,
            "globalVariables": {},
            "userNodes": {},
            "playbackConfig": {"speed": 1},
            "layout": {"first": column, "second": side, "direction": "row", "splitPercentage": 66},
        },
        indent=2,
    )

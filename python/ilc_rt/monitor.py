"""Monitoring of a controller from anywhere on the network, through Zenoh.

Under ``ilc/<cell>/`` the controller publishes ``state``, ``iteration``, ``fault``, ``servo`` and
``latency``: the JSON objects of its event stream. A monitor cannot command anything, and the loop
never waits for one; at the end of a campaign the controller queries ``heard`` to confirm that all
messages have arrived.

Any program on the network can publish under these keys, so all input is untrusted: control
characters are removed from texts, and wrong types cause one warning.
"""

from __future__ import annotations

import json
import math
import queue
import re
import socket
import time
from dataclasses import dataclass, replace
from itertools import islice
from typing import TYPE_CHECKING, Any, TypeVar

from ilc_rt.closing import Closing
from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import SCHEMA, EventError, StartEvent, parse_event
from ilc_rt.misfit import misfit
from ilc_rt.patience import Patience

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import zenoh
    from zenoh import handlers

    from ilc_rt.events import Event

_T = TypeVar("_T")

POLL_S = 0.2
QUEUE_MAX = 10_000
PAYLOAD_MAX_BYTES = 1 << 20
#: Of a question to a cell; a controller gives 1,000 events and a few states, anyone may answer.
REPLIES_MAX = 5_000
# Topic under which an event of the history was published.
PAST_TOPICS = {
    "start": "state", "iteration": "iteration", "judged": "iteration", "drift": "iteration",
    "fault": "fault", "inputs": "inputs", "drives": "drives",
}  # fmt: skip
TEXT_MAX = 2_000
EVERY_CELL = "*"
#: As cell descriptions allow them.
CELL_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


@dataclass(frozen=True, slots=True)
class Message:
    """A published message.

    Attributes
    ----------
    cell : str
        Name of the cell.
    topic : str
        ``state`` (start, states, progress and end of a campaign),
        ``iteration``, ``fault``, ``servo`` or ``latency``; or ``alive`` and
        ``gone`` when a controller appears and disappears.
    payload : dict
        The JSON object; empty for ``alive`` and ``gone``.
    event : Event or None
        The same as a typed event, if it is one.
    warning : str or None
        Defect of the message, if it is invalid.
    is_past : bool
        True if it was published before the monitor listened.
    """

    cell: str
    topic: str
    payload: dict[str, Any]
    event: Event | None = None
    warning: str | None = None
    is_past: bool = False


class Monitor(Closing):
    """A subscriber to one cell, or to all of them.

    Parameters
    ----------
    cell : str
        Name of a cell, ``"*"`` for all.
    connect : sequence of str
        Zenoh endpoints to connect to, e.g. ``tcp/192.168.1.5:7447``.
    scouting : bool
        Discover controllers on the network by multicast.
    router : bool
        Hear everything through a router, the first endpoint that answers. Without it a router
        passes nothing on, as it expects a monitor to reach the controllers directly.

    Raises
    ------
    BadInputError
        If an endpoint is invalid, or no cell can have this name.
    CampaignError
        If no Zenoh session can be opened.

    Examples
    --------
    >>> with Monitor("press-7") as monitor:
    ...     for message in monitor.messages(timeout_s=1.0):
    ...         print(message.topic, message.payload)
    """

    def __init__(
        self,
        cell: str = "*",
        connect: Sequence[str] = (),
        *,
        scouting: bool = True,
        router: bool = False,
    ) -> None:
        self._cell = checked_name(cell)
        self._queue: queue.Queue[Message] = queue.Queue(QUEUE_MAX)
        self._lost = 0
        # A stranger may come and go, and never answer: others are heard meanwhile.
        self._patience = Patience()
        # Messages of the past that may still arrive once more.
        self._past: list[Message] = []
        if router and not connect:
            message = "router = True: connect has to name its endpoint, as tls/host:7447"
            raise BadInputError(message)
        self._session = _open(connect, scouting=scouting, router=router)
        # The token first: the state of a live controller is queried at once.
        self._tokens = self._session.liveliness().declare_subscriber(
            f"ilc/{cell}/alive", _direct(self._on_token), history=True
        )
        self._values = self._session.declare_subscriber(f"ilc/{cell}/*", _direct(self._on_value))
        self._heard = self._session.declare_queryable(f"ilc/{cell}/heard", _direct(_answer))

    @property
    def lost(self) -> int:
        """Number of messages dropped because the reader was too slow."""
        return self._lost

    def messages(self, timeout_s: float | None = None) -> Iterator[Message]:
        """Yield messages as they arrive.

        Ends after `timeout_s` in total, if given.
        """
        until = None if timeout_s is None else time.monotonic() + timeout_s
        while until is None or time.monotonic() < until:
            try:
                message = self._queue.get(timeout=POLL_S)
            except queue.Empty:
                continue
            if replace(message, is_past=True) in self._past:
                # Published between the question for the past and its answer.
                self._past.remove(replace(message, is_past=True))
                continue
            yield message
            if message.topic == "alive" and self._patience.is_left:
                with self._patience.spent():
                    self._past = self.ask_history(message.cell)
                    states = self.ask_state(message.cell)
                yield from self._past
                yield from states

    def ask_history(self, cell: str | None = None) -> list[Message]:
        """Query the start of the campaign that is running, its runs and faults, oldest first.

        Digital inputs and the states of the drives, as they are now, come last.
        """
        from zenoh import ConsolidationMode

        replies = self._session.get(
            f"ilc/{cell or self._cell}/history/*",
            timeout=2.0,
            consolidation=ConsolidationMode.NONE,
        )
        found: list[tuple[float, Message]] = []
        for reply in islice(replies, REPLIES_MAX):
            message = None if reply.ok is None else _message(reply.ok)
            if reply.ok is not None and message is not None:
                number = str(reply.ok.key_expr).rpartition("/")[2]
                # First the start, last what is of now.
                last = -1.0 if number == "start" else math.inf
                place = int(number) if number.isdecimal() else last
                found.append((place, replace(message, is_past=True)))
        return [message for _, message in sorted(found, key=lambda pair: pair[0])]

    def ask_state(self, cell: str | None = None) -> list[Message]:
        """Query the current state, for late joiners.

        Every reply of a controller is a message, in their order: the newest event of the topic
        ``state``, after the start of the campaign if the controller also answers with that.
        """
        import zenoh

        replies = self._session.get(
            f"ilc/{cell or self._cell}/state",
            timeout=2.0,
            # Otherwise one reply for each key is left.
            consolidation=zenoh.ConsolidationMode.NONE,
        )
        first = islice(replies, REPLIES_MAX)
        messages = [_message(reply.ok) for reply in first if reply.ok is not None]
        return [message for message in messages if message is not None]

    def close(self) -> None:
        """Leave the network."""
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]

    def _on_token(self, sample: zenoh.Sample) -> None:
        topic = "gone" if str(sample.kind).endswith("DELETE") else "alive"
        self._put(Message(_clean(str(sample.key_expr).split("/")[1]), topic, {}))

    def _on_value(self, sample: zenoh.Sample) -> None:
        self._put(_message(sample))

    def _put(self, message: Message | None) -> None:
        if message is None:
            return
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self._lost += 1


def checked_name(cell: str) -> str:
    """Return a name that a cell can have, or ``*`` for every cell.

    Raises
    ------
    BadInputError
        If no cell can have it.

    Examples
    --------
    >>> checked_name("press-7")
    'press-7'
    """
    if cell != EVERY_CELL and CELL_NAME.fullmatch(cell) is None:
        message = (
            f"cell = {_clean(cell)!r}: 1 to 64 letters, digits, - and _, the TOML file of a cell, "
            "or * for every cell"
        )
        raise BadInputError(message)
    return cell


def _open(connect: Sequence[str], *, scouting: bool, router: bool) -> zenoh.Session:
    try:
        import zenoh
    except ImportError as error:
        message = "the monitor needs the package eclipse-zenoh: pip install eclipse-zenoh"
        raise CampaignError(message) from error
    config = zenoh.Config()
    try:
        config.insert_json5("mode", json.dumps("client" if router else "peer"))
        config.insert_json5("connect/endpoints", json.dumps(list(connect)))
        config.insert_json5("scouting/multicast/enabled", json.dumps(scouting))
        config.insert_json5("listen/endpoints", "[]")
        # A controller that starts again is heard from its start on, or nearly.
        retry = {"period_init_ms": 200, "period_max_ms": 1000}
        config.insert_json5("connect/retry", json.dumps(retry))
        # By default Zenoh skips the loopback interface, which controllers use.
        interfaces = ",".join(name for _, name in socket.if_nameindex())
        config.insert_json5("scouting/multicast/interface", json.dumps(interfaces))
    except zenoh.ZError as error:
        message = f"connect = {', '.join(connect)}: not an endpoint, as tcp/192.168.1.5:7447"
        raise BadInputError(message) from error
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reached = f" to {', '.join(connect)}" if connect else ""
        message = f"no Zenoh session{reached}: {error}"
        raise CampaignError(message) from error


def _direct(callback: Callable[[_T], None]) -> handlers.Callback[_T]:
    """Return a callback that runs in the order of arrival with all others.

    By default each subscriber has its own thread, and the end of a controller could overtake its
    last messages.
    """
    from zenoh.handlers import Callback

    return Callback(callback, indirect=False)


def _answer(query: zenoh.Query) -> None:
    """Confirm to a controller that everything published before has arrived."""
    query.reply(query.key_expr, b"")


def _message(sample: zenoh.Sample) -> Message | None:
    _, cell, topic = (_clean(part) for part in str(sample.key_expr).split("/", 2))
    if topic == "heard":
        return None
    raw = sample.payload.to_bytes()
    if len(raw) > PAYLOAD_MAX_BYTES:
        return None
    try:
        payload = _clean_all(json.loads(raw))
    except (ValueError, RecursionError):
        return None
    if not isinstance(payload, dict):
        return None
    if topic.startswith("history/"):
        topic = PAST_TOPICS.get(str(payload.get("event")), "")
        if not topic:
            return None
    if topic == "servo":
        # Servo cycles are no event, and much data: they are not written and read again.
        return Message(cell, topic, payload)
    try:
        event = parse_event(json.dumps({"event": topic, **payload}))
    except EventError as error:
        return Message(cell, topic, payload, warning=_clean(f"a message left out: {error}"))
    found = None if event is None else misfit(event)
    if found is not None:
        return Message(cell, topic, payload, warning=_clean(f"a message left out: {found}"))
    warning = None
    if isinstance(event, StartEvent) and event.schema > SCHEMA:
        warning = (
            f"schema {event.schema} of a newer version; {SCHEMA} is known here, and shown as far "
            "as it is understood: pip install --upgrade ilc-rt"
        )
    return Message(cell, topic, payload, event, warning)


def _clean(text: str) -> str:
    """Return a text printable and of bounded length."""
    kept = "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape", "surrogatepass").decode()
        for sign in text[:TEXT_MAX]
    )
    return kept if len(text) <= TEXT_MAX else f"{kept} ..."


def _clean_all(value: object) -> object:
    """Return the same with every text in it cleaned."""
    if isinstance(value, str):
        return _clean(value)
    if isinstance(value, dict):
        return {_clean(key): _clean_all(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_clean_all(item) for item in value]
    return value

"""Watch a controller from anywhere on the network, through Zenoh.

Under ``ilc/<cell>/`` the controller publishes ``state``, ``iteration``,
``fault``, ``servo`` and ``latency``: the JSON objects of its event stream. A
monitor can command nothing, and the controller never waits for one.
"""

from __future__ import annotations

import json
import queue
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ilc_rt.errors import BadInputError, CampaignError
from ilc_rt.events import EventError, parse_event

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from types import TracebackType

    import zenoh
    from typing_extensions import Self

    from ilc_rt.events import Event

POLL_S = 0.2
QUEUE_MAX = 10_000


@dataclass(frozen=True, slots=True)
class Message:
    """Something a controller published.

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
        The same as a typed event, where it is one.
    """

    cell: str
    topic: str
    payload: dict[str, Any]
    event: Event | None = None


class Monitor:
    """A subscriber to one cell, or to all of them.

    Parameters
    ----------
    cell : str
        Name of a cell, ``"*"`` for every one.
    connect : sequence of str
        Zenoh endpoints to connect to, as ``tcp/192.168.1.5:7447``.
    scouting : bool
        Whether to look for controllers on the network by multicast.

    Raises
    ------
    BadInputError
        If an endpoint is not understood.
    CampaignError
        If no Zenoh session can be opened.

    Examples
    --------
    >>> with Monitor("press-7") as monitor:
    ...     for message in monitor.messages(timeout_s=1.0):
    ...         print(message.topic, message.payload)
    """

    def __init__(
        self, cell: str = "*", connect: Sequence[str] = (), *, scouting: bool = True
    ) -> None:
        if not cell or any(sign in cell for sign in "/#?$ "):
            message = f"cell = {cell!r}: a name without / # ? $, or * for every cell"
            raise BadInputError(message)
        self._cell = cell
        self._queue: queue.Queue[Message] = queue.Queue(QUEUE_MAX)
        self._lost = 0
        self._session = _open(connect, scouting=scouting)
        # The token first: a controller seen alive is asked for its state at once.
        self._tokens = self._session.liveliness().declare_subscriber(
            f"ilc/{cell}/alive", self._on_token, history=True
        )
        self._values = self._session.declare_subscriber(f"ilc/{cell}/*", self._on_value)

    def __enter__(self) -> Self:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the network."""
        self.close()

    @property
    def lost(self) -> int:
        """Messages dropped because nobody took them."""
        return self._lost

    def messages(self, timeout_s: float | None = None) -> Iterator[Message]:
        """Yield messages as they come.

        Parameters
        ----------
        timeout_s : float or None
            End when this long has passed in all; None for never.
        """
        until = None if timeout_s is None else time.monotonic() + timeout_s
        while until is None or time.monotonic() < until:
            try:
                message = self._queue.get(timeout=POLL_S)
            except queue.Empty:
                continue
            yield message
            if message.topic == "alive":
                yield from self.ask_state(message.cell)

    def ask_state(self, cell: str | None = None) -> list[Message]:
        """Ask for the present state; for those who join late.

        Returns
        -------
        list of Message
            One a controller that answered.
        """
        replies = self._session.get(f"ilc/{cell or self._cell}/state", timeout=2.0)
        messages = [_message(reply.ok) for reply in replies if reply.ok is not None]
        return [message for message in messages if message is not None]

    def close(self) -> None:
        """Leave the network."""
        if not self._session.is_closed():
            self._session.close()  # type: ignore[no-untyped-call]

    def _on_token(self, sample: zenoh.Sample) -> None:
        topic = "gone" if str(sample.kind).endswith("DELETE") else "alive"
        self._put(Message(str(sample.key_expr).split("/")[1], topic, {}))

    def _on_value(self, sample: zenoh.Sample) -> None:
        self._put(_message(sample))

    def _put(self, message: Message | None) -> None:
        if message is None:
            return
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self._lost += 1


def _open(connect: Sequence[str], *, scouting: bool) -> zenoh.Session:
    try:
        import zenoh
    except ImportError as error:
        message = "the monitor needs the package eclipse-zenoh: pip install eclipse-zenoh"
        raise CampaignError(message) from error
    config = zenoh.Config()
    try:
        config.insert_json5("connect/endpoints", json.dumps(list(connect)))
        config.insert_json5("scouting/multicast/enabled", json.dumps(scouting))
        config.insert_json5("listen/endpoints", "[]")
    except zenoh.ZError as error:
        message = f"connect = {', '.join(connect)}: not an endpoint, as tcp/192.168.1.5:7447"
        raise BadInputError(message) from error
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reached = f" to {', '.join(connect)}" if connect else ""
        message = f"no Zenoh session{reached}: {error}"
        raise CampaignError(message) from error


def _message(sample: zenoh.Sample) -> Message | None:
    _, cell, topic = str(sample.key_expr).split("/", 2)
    try:
        payload = json.loads(sample.payload.to_bytes())
    except ValueError:
        return None
    if not isinstance(payload, dict):
        return None
    try:
        event = parse_event(json.dumps({"event": topic, **payload}))
    except EventError:
        event = None
    return Message(cell, topic, payload, event)

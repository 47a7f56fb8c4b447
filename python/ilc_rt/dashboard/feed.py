"""The thread that fills the model from Zenoh, and with the history of libraries."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from ilc_rt.errors import BadInputError
from ilc_rt.monitor import Monitor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from typing_extensions import Self

    from ilc_rt.dashboard.archive import Archive
    from ilc_rt.dashboard.fleet import Fleet
    from ilc_rt.events import Event

TURN_S = 0.5


class Feed:
    """Follower of the cells of a fleet, in a thread of its own.

    Parameters
    ----------
    fleet : Fleet
        The cells.
    archive : Archive
        Libraries, from which a late joiner takes the runs that it has not heard.
    connect : sequence of str
        Zenoh endpoints, as for `Monitor`.
    scouting : bool
        Discover controllers by multicast.
    router : bool
        Hear everything through a router, the first endpoint that answers.
    """

    def __init__(
        self,
        fleet: Fleet,
        archive: Archive,
        connect: Sequence[str] = (),
        *,
        scouting: bool = True,
        router: bool = False,
    ) -> None:
        self._fleet, self._archive = fleet, archive
        name = fleet.wanted[0] if len(fleet.wanted) == 1 else "*"
        self._monitor = Monitor(name, connect, scouting=scouting, router=router)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="feed", daemon=True)

    def __enter__(self) -> Self:
        """Begin to follow."""
        for name in self._fleet.wanted:
            self._recall(name)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the network."""
        self._stop.set()
        self._thread.join()
        self._monitor.close()

    def _follow(self) -> None:
        while not self._stop.is_set():
            for message in self._monitor.messages(TURN_S):
                known = message.cell in self._fleet.cells
                self._fleet.apply(message, time.monotonic(), time.time())
                cell = self._fleet.cells.get(message.cell)
                if cell is not None and (not known or cell.lacks(message)):
                    self._recall(message.cell, message.event)
            self._fleet.lost = self._monitor.lost

    def _recall(self, name: str, event: Event | None = None) -> None:
        """Give a cell the earlier runs of its campaign, as far as libraries have them.

        A campaign whose start was not heard is known by the event of one of its runs.
        """
        cell = self._fleet.cells.get(name)
        if cell is None:
            return
        campaign, digest = cell.named_by(event)
        try:
            rows = self._archive.campaign(name, campaign, digest)
        except (BadInputError, OSError):
            # A library that is being made or replaced; the page of the library tells why.
            return
        flight = self._archive.flight(name, rows)
        with self._fleet.lock:
            cell.remember(rows, "")
            if flight is not None:
                cell.remember_flight(flight)

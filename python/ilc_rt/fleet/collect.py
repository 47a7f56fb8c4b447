"""Runs as they happen, from the events of cells on Zenoh to a fleet database.

`ilc_rt.fleet` offers it. The event of a run has its figures, and no arrays: those stay in the
library of the cell until `push` brings them. The run that a collector stored has the same key, so
that it is completed, not doubled.
"""

from __future__ import annotations

import json
from collections import deque
from dataclasses import asdict
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any

from ilc_rt.closing import Closing
from ilc_rt.events import IterationEvent, JudgedEvent, StartEvent
from ilc_rt.fleet.database import connect, driver
from ilc_rt.library_file import FIGURES

if TYPE_CHECKING:
    import psycopg

    from ilc_rt.monitor import Message

#: Statements that wait while the database cannot be reached; the oldest are left to sync.
WAITING_MAX = 10_000
#: Cells at most; any program on the network can publish under any name.
CELLS_MAX = 10_000

INSERT = """
INSERT INTO run (cell, campaign, iteration, digest, created_utc, law, measure, cycle_s, n_axes,
    axis_names, input_units, n_samples, figures)
VALUES (%(cell)s, %(campaign)s, %(iteration)s, %(digest)s, %(created_utc)s, %(law)s, %(measure)s,
    %(cycle_s)s, %(n_axes)s, %(axis_names)s, %(input_units)s, %(n_samples)s, %(figures)s)
ON CONFLICT DO NOTHING
"""
# The decision of a law on a run that was stored before; a library that was synced later has it too.
JUDGE = """
UPDATE run SET figures = (figures::jsonb || %(judged)s::jsonb)::json
WHERE cell = %(cell)s AND campaign = %(campaign)s AND iteration = %(iteration)s
    AND fingerprint IS NULL
"""


class Collector(Closing):
    """Stores the runs of messages in a fleet database.

    Parameters
    ----------
    address : str
        ``postgresql://USER@HOST/NAME``.

    Attributes
    ----------
    stored : int
        Runs stored so far.
    unknown : set of str
        Cells whose runs were left out, as their campaign had begun before: sync brings them.
    refused : str or None
        Newest event that the database refuses, and why: none of a controller.

    Raises
    ------
    BadInputError
        If the database cannot be used.
    """

    def __init__(self, address: str) -> None:
        self.stored = 0
        self.unknown: set[str] = set()
        self.refused: str | None = None
        self._address = address
        self._connection: psycopg.Connection[Any] = connect(address)
        self._started: dict[str, StartEvent] = {}
        self._waiting: deque[tuple[str, dict[str, Any]]] = deque(maxlen=WAITING_MAX)

    def close(self) -> None:
        """Store what waits, and close the connection."""
        self.flush()
        self._connection.close()

    @property
    def n_waiting(self) -> int:
        """Number of statements that wait for the database."""
        return len(self._waiting)

    def take(self, message: Message) -> None:
        """Store what a message tells of a run; other messages change nothing."""
        event = message.event
        is_known = message.cell in self._started or message.cell in self.unknown
        if not is_known and len(self._started) + len(self.unknown) >= CELLS_MAX:
            return
        if isinstance(event, StartEvent):
            self._started[message.cell] = event
        if not isinstance(event, (IterationEvent, JudgedEvent)):
            return
        start = self._started.get(message.cell)
        if start is None:
            self.unknown.add(message.cell)
            return
        key = {"cell": message.cell, "campaign": start.campaign, "iteration": event.index}
        if isinstance(event, IterationEvent):
            self._waiting.append((INSERT, key | _values(start, event)))
        else:
            judged = {name: getattr(event, name) for name in ("rolled_back", "learning_off")}
            judged |= {"remark": event.remark}
            self._waiting.append((JUDGE, key | {"judged": json.dumps(judged)}))
        self.flush()

    def flush(self) -> bool:
        """Store what waits; False if the database cannot be reached now."""
        postgres = driver()
        try:
            if self._waiting and self._connection.closed:
                self._connection = postgres.connect(
                    self._address, autocommit=True, connect_timeout=2, application_name="ilc"
                )
            while self._waiting:
                statement, values = self._waiting[0]
                try:
                    done = self._connection.execute(statement.encode(), values)
                    self.stored += statement is INSERT and done.rowcount == 1
                except (postgres.DataError, postgres.IntegrityError) as error:
                    # Any program can publish: the next event must not wait for this one.
                    why = str(error).partition("\n")[0]
                    self.refused = f"run {values['iteration']} of {values['cell']}: {why}"
                self._waiting.popleft()
        except postgres.OperationalError:
            self._connection.close()
            return False
        return True


def _values(start: StartEvent, event: IterationEvent) -> dict[str, Any]:
    figures = asdict(event)
    now = datetime.now(timezone.utc)
    return {
        "digest": event.digest,
        "created_utc": f"{now:%Y-%m-%dT%H:%M:%S}.{now.microsecond // 1000:03}Z",
        "law": start.law,
        "measure": start.measure,
        "cycle_s": start.cycle_s,
        "n_axes": start.n_axes,
        "axis_names": json.dumps(start.axis_names),
        "input_units": json.dumps(start.input_units),
        "n_samples": start.n_samples,
        "figures": json.dumps({name: figures[name] for name in FIGURES}, allow_nan=False),
    }

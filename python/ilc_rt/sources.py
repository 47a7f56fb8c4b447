"""Stored runs to be read by those that watch: a library file, or the fleet database of many cells.

Both are only read. The dashboard shows their runs, and whatever watches a cell takes from them what
it has not heard (`ilc_rt.watched`).
"""

from __future__ import annotations

import contextlib
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ilc_rt.closing import Closing
from ilc_rt.errors import BadInputError
from ilc_rt.fleet.database import SQLITE, file_of, is_database, shown
from ilc_rt.read_only import ReadOnlyLibrary

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from typing import TypeVar

    from ilc_rt.fleet.reader import FleetLibrary

    T = TypeVar("T")

#: Of a fleet database the newest runs; a page of a browser shows a few hundred of them.
RUNS_MAX = 20_000
#: Time for which a database that cannot be reached is not tried again.
RETRY_S = 5.0


class Source(Protocol):
    """Stored runs that are only read.

    Attributes
    ----------
    name : str
        File, or address of a database without its password.
    path : pathlib.Path or None
        The file, beside which others may lie; None for a database.
    """

    name: str
    path: Path | None

    def stamp(self) -> object:
        """Return a mark that changes whenever the runs do; None before the first run."""

    def check(self) -> None:
        """Raise `BadInputError` if it cannot be read."""

    def rows(self) -> list[dict[str, Any]]:
        """Return the runs as `Library.list` does."""

    def load(self, run: int) -> dict[str, Any]:
        """Return a run with its signals, as `Library.load` does."""

    def close(self) -> None:
        """Close a connection, if there is one."""


def source(address: str | Path) -> Source:
    """Return the source of an address: a file, ``sqlite:///PATH``, or ``postgresql://…``.

    Raises
    ------
    BadInputError
        If it has another scheme.

    Examples
    --------
    >>> source("gantry.db").name, source("postgresql://ilc:secret@fleet.local/ilc").name
    ('gantry.db', 'postgresql://ilc@fleet.local/ilc')
    """
    if isinstance(address, str) and is_database(address):
        return FleetSource(address)
    text = str(address)
    return FileSource(Path(file_of(text) if text.startswith(SQLITE) else text))


def campaign_of(
    rows: Iterable[Mapping[str, Any]],
    cell: str,
    campaign: str | None = None,
    digest: str | None = None,
) -> list[Any]:
    """Return the runs of a campaign of a cell, each once, in their order.

    It is the named one, else the newest one with a run of this digest, else the newest one.
    """
    rows = [row for row in rows if row["cell"] == cell]
    if campaign is None:
        chosen = [row for row in rows if not digest or row["digest"] == digest]
        newest = max(chosen, key=lambda row: str(row["created_utc"]), default=None)
        campaign = None if newest is None else newest["campaign"]
    found: dict[int, Any] = {}
    for row in rows:
        # A library and the database that it was synced with have the same run.
        is_better = row.get("has_signals", True) or row["index"] not in found
        if row["campaign"] == campaign and is_better:
            found[row["index"]] = row
    return [found[index] for index in sorted(found)]


class Memory(Closing):
    """Stored runs, for a program that watches and has not heard the start of a campaign.

    Parameters
    ----------
    addresses : iterable of str or pathlib.Path
        Files and databases, as for `source`; none for no memory.
    """

    def __init__(self, addresses: Iterable[str | Path] = ()) -> None:
        self._sources = tuple(map(source, addresses))

    def campaign(
        self, cell: str, campaign: str | None = None, digest: str | None = None
    ) -> list[Any]:
        """Return the runs of a campaign of a cell, chosen as by `campaign_of`.

        Empty if there is none, or if nothing can be read now: to watch is what matters.
        """
        rows: list[Any] = []
        for one in self._sources:
            with contextlib.suppress(BadInputError):
                rows += one.rows() if one.stamp() is not None else []
        return campaign_of(rows, cell, campaign, digest)

    def missing(self) -> list[str]:
        """Return the names of the files that do not exist yet.

        Raises
        ------
        BadInputError
            If a file is not a library, or a database cannot be read.
        """
        names = []
        for one in self._sources:
            if one.stamp() is None:
                names.append(one.name)
            else:
                one.check()
        return names

    def close(self) -> None:
        """Close the connections to databases."""
        for one in self._sources:
            one.close()


class FileSource:
    """A library file; one that does not exist yet has no runs.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    """

    def __init__(self, path: Path) -> None:
        self.name = str(path)
        self.path: Path | None = path
        self._file = path

    def stamp(self) -> object:
        """Return size and time of the file and of its log; None without the file."""
        stamps = [_file_stamp(file) for file in (self._file, Path(f"{self._file}-wal"))]
        return None if stamps[0] is None else tuple(stamps)

    def check(self) -> None:
        """Look whether it is a library, or an empty file.

        Raises
        ------
        BadInputError
            If it is something else.
        """
        try:
            self._opened()
        except OSError as error:
            raise BadInputError(str(error)) from error

    def rows(self) -> list[dict[str, Any]]:
        """Return its runs, oldest first.

        Raises
        ------
        BadInputError
            If it is no library.
        """
        try:
            library = self._opened()
            return [] if library is None else library.list()
        except OSError as error:
            raise BadInputError(str(error)) from error

    def load(self, run: int) -> dict[str, Any]:
        """Return a run with its signals.

        Raises
        ------
        BadInputError
            If there is no such run, or it is damaged.
        """
        try:
            return ReadOnlyLibrary(self._file).load(run)
        except OSError as error:
            raise BadInputError(str(error)) from error

    def close(self) -> None:
        """Leave the file: no call holds it open."""

    def _opened(self) -> ReadOnlyLibrary | None:
        """Return the library; None if the file has gone, or is empty: it has no runs yet."""
        try:
            if self._file.is_file() and not self._file.stat().st_size:
                return None
            library = ReadOnlyLibrary(self._file)
            len(library)
        except FileNotFoundError:
            return None
        return library


class FleetSource:
    """A fleet database, connected when it is first read, and again after a loss.

    Parameters
    ----------
    address : str
        ``postgresql://USER@HOST/NAME``.
    clock : callable
        Returns the time in seconds; only differences count.
    """

    def __init__(self, address: str, clock: Callable[[], float] = time.monotonic) -> None:
        self.name = shown(address)
        self.path: Path | None = None
        self._address, self._clock = address, clock
        self._library: FleetLibrary | None = None
        self._lost: tuple[float, BadInputError] | None = None

    def stamp(self) -> object:
        """Return numbers that change with every stored or changed run.

        Raises
        ------
        BadInputError
            If the database cannot be read.
        """
        return self._asked(lambda library: library.stamp())

    def check(self) -> None:
        """Look whether the database can be read.

        Raises
        ------
        BadInputError
            If it cannot.
        """
        self.stamp()

    def rows(self) -> list[dict[str, Any]]:
        """Return its newest runs, at most `RUNS_MAX`, in the order of their arrival.

        Raises
        ------
        BadInputError
            If the database cannot be read.
        """
        return self._asked(
            lambda library: library.page(limit=RUNS_MAX, offset=max(0, len(library) - RUNS_MAX))
        )

    def load(self, run: int) -> dict[str, Any]:
        """Return a run with its signals.

        Raises
        ------
        BadInputError
            If there is no such run, its signals have not been brought yet, or the database cannot
            be read.
        """
        return self._asked(lambda library: library.load(run))

    def close(self) -> None:
        """Close the connection."""
        if self._library is not None:
            self._library.close()
            self._library = None

    def _asked(self, ask: Callable[[FleetLibrary], T]) -> T:
        """Return an answer of the database; a lost connection is opened again by the next call."""
        from ilc_rt.fleet.reader import FleetLibrary

        if self._lost is not None and self._clock() - self._lost[0] < RETRY_S:
            raise self._lost[1]
        try:
            if self._library is None:
                self._library = FleetLibrary(self._address)
            answer = ask(self._library)
        except BadInputError as error:
            # A missing run is no reason to wait.
            if self._library is None or not self._library.is_open:
                self.close()
                self._lost = self._clock(), error
            raise
        self._lost = None
        return answer


def _file_stamp(file: Path) -> tuple[int, int, int] | None:
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino

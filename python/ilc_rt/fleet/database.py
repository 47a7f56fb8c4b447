"""The connection to a fleet database, its addresses and its migrations.

Only `ilc_rt.fleet` and its verbs import it.
"""

from __future__ import annotations

import contextlib
import re
from importlib import import_module, resources
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    import psycopg

#: Addresses of a database begin with one of these.
SCHEMES = ("postgresql://", "postgres://")
SQLITE = "sqlite:///"
#: Key of the advisory lock that is held while tables are made or changed: "ILCF".
LOCK = 0x494C4346
CONNECT_S = 10


def is_database(address: str) -> bool:
    """Return whether an address names a database, not a file.

    Examples
    --------
    >>> is_database("postgresql://host/fleet"), is_database("sqlite:///cell.db")
    (True, False)
    """
    return address.startswith(SCHEMES)


def file_of(address: str) -> str:
    """Return the path of a library file, given as ``sqlite:///path`` or as the path itself.

    Examples
    --------
    >>> file_of("sqlite:///cell.db"), file_of("sqlite:////var/lib/ilc/cell.db"), file_of("cell.db")
    ('cell.db', '/var/lib/ilc/cell.db', 'cell.db')
    """
    path = unquote(address.removeprefix(SQLITE)) if address.startswith(SQLITE) else address
    if not path or "://" in path:
        message = f"{address}: {SQLITE}PATH or the path of a library, or {SCHEMES[0]}HOST/NAME"
        raise BadInputError(message)
    return path


def shown(address: str) -> str:
    """Return the address of a database without its password.

    Examples
    --------
    >>> shown("postgresql://ilc:secret@host:5433/fleet")
    'postgresql://ilc@host:5433/fleet'
    """
    parts = urlsplit(address)
    user = f"{parts.username}@" if parts.username else ""
    place = parts.netloc.rpartition("@")[2]
    return f"{parts.scheme}://{user}{place}{parts.path}"


def driver() -> Any:  # noqa: ANN401 (psycopg is optional)
    """Return the module psycopg.

    Raises
    ------
    BadInputError
        If it is not installed.
    """
    try:
        return import_module("psycopg")
    except ImportError as error:
        message = f"PostgreSQL needs psycopg ({error}): pip install ilc-rt[fleet]"
        raise BadInputError(message) from error


def connect(address: str, *, read_only: bool = False) -> psycopg.Connection[Any]:
    """Connect to a fleet database whose tables are of this version; a writer brings them there.

    Raises
    ------
    BadInputError
        If it cannot be reached, has no tables yet and is only to be read, or tables of a later
        version.
    """
    postgres = driver()
    if not is_database(address):
        message = f"{address}: {SCHEMES[0]}USER@HOST/NAME is the address of a database"
        raise BadInputError(message)
    try:
        connection: psycopg.Connection[Any] = postgres.connect(
            address, autocommit=True, connect_timeout=CONNECT_S, application_name="ilc"
        )
    except postgres.Error as error:
        raise _failure(address, error) from error
    try:
        if read_only:
            connection.execute("SET default_transaction_read_only = on")
            _require_newest(connection, address)
        elif version(connection) != newest():
            migrate(connection, address)
    except postgres.Error as error:
        connection.close()
        raise _failure(address, error) from error
    except BaseException:
        connection.close()
        raise
    return connection


@contextlib.contextmanager
def told(address: str) -> Iterator[None]:
    """Turn errors of the database into one line that names it."""
    postgres = driver()
    try:
        yield
    except postgres.Error as error:
        raise _failure(address, error) from error


def steps() -> list[tuple[int, str]]:
    """Return number and SQL of every migration, in order."""
    folder = resources.files("ilc_rt.fleet.migrations")
    found = []
    for entry in folder.iterdir():
        number = re.fullmatch(r"(\d{4})_\w+\.sql", entry.name)
        if number:
            found.append((int(number[1]), entry.read_text(encoding="utf-8")))
    return sorted(found)


def newest() -> int:
    """Return the version of the tables that this program reads and writes."""
    return steps()[-1][0]


def version(connection: psycopg.Connection[Any]) -> int:
    """Return the version of the tables; 0 for an empty database."""
    query = "SELECT to_regclass('fleet_version') IS NOT NULL"
    if not _one(connection, query):
        return 0
    return int(_one(connection, "SELECT coalesce(max(version), 0) FROM fleet_version"))


def migrate(connection: psycopg.Connection[Any], address: str) -> None:
    """Make or change the tables, all steps or none; other programs that would do the same wait."""
    with connection.transaction():
        connection.execute("SELECT pg_advisory_xact_lock(%s)", [LOCK])
        # Before the version is read: a program that waited for the lock still remembers that there
        # was no such table, and only this makes PostgreSQL look again.
        connection.execute(
            "CREATE TABLE IF NOT EXISTS fleet_version "
            "(version integer PRIMARY KEY, applied_at timestamptz NOT NULL DEFAULT now())"
        )
        found = version(connection)
        if found > newest():
            _refuse(address, found)
        for number, sql in steps():
            if number > found:
                connection.execute(sql.encode())
                connection.execute("INSERT INTO fleet_version (version) VALUES (%s)", [number])


def _require_newest(connection: psycopg.Connection[Any], address: str) -> None:
    found = version(connection)
    if found != newest():
        _refuse(address, found)


def _refuse(address: str, found: int) -> None:
    what = f"tables of version {found}" if found else "no tables of a fleet"
    hint = "an update of this program" if found > newest() else "ilc library sync by a writer"
    message = f"{shown(address)}: {what}; version {newest()} is needed: {hint}"
    raise BadInputError(message)


def _one(connection: psycopg.Connection[Any], query: str) -> Any:  # noqa: ANN401 (any column)
    row = connection.execute(query.encode()).fetchone()
    return row[0] if row else None


def _failure(address: str, error: Exception) -> BadInputError:
    return BadInputError(f"{shown(address)}: {_line(error)}")


def _line(error: Exception) -> str:
    """Return the first line of an error; the rest of psycopg's repeats it for each address."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]

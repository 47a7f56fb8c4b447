"""Runs between a library file and a fleet database, both ways; `ilc_rt.fleet` offers it.

A run is known by cell, campaign, number and digest. So sync may be repeated, interrupted at any
point, and made by several programs at once: each batch is one transaction, and what is there is not
stored again.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ilc_rt import library_file
from ilc_rt.errors import BadInputError
from ilc_rt.fleet.database import connect, told
from ilc_rt.library import ALL, Library
from ilc_rt.library_file import ARRAYS, FIGURES
from ilc_rt.read_only import ReadOnlyLibrary

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import psycopg

#: Runs of a transaction: few enough for the memory, and for a campaign that waits for the file.
BATCH = 50
#: Columns of a run that both sides have under the same name, as texts and numbers.
SHARED = (
    "cell", "campaign", "iteration", "digest", "created_utc", "law", "measure", "cycle_s", "n_axes",
    "axis_names", "input_units", "n_samples", "disturbance", "fingerprint",
)  # fmt: skip
JSON = ("axis_names", "input_units", "disturbance")

_PLACES = ", ".join(f"%({name})s" for name in (*SHARED, "figures", "provenance"))
INSERT = f"""
INSERT INTO run ({", ".join(SHARED)}, figures, provenance) VALUES ({_PLACES})
ON CONFLICT (cell, campaign, iteration, digest) DO UPDATE SET created_utc = excluded.created_utc,
    disturbance = excluded.disturbance, figures = excluded.figures,
    fingerprint = excluded.fingerprint, provenance = excluded.provenance
RETURNING id
""".encode()
INSERT_SIGNALS = f"""
INSERT INTO signals (run, {", ".join(ARRAYS)})
VALUES (%(run)s, {", ".join(f"%({name})s" for name in ARRAYS)}) ON CONFLICT DO NOTHING
""".encode()
_TEXTS = ", ".join(f"{name}::text AS {name}" if name in JSON else name for name in SHARED)
SELECT = f"""
SELECT run.id, {_TEXTS}, figures::text AS figures, program, law_parameters, {", ".join(ARRAYS)}
FROM run JOIN signals ON signals.run = run.id
    JOIN provenance ON provenance.digest = run.provenance WHERE run.id = ANY(%s) ORDER BY run.id
""".replace("digest,", "run.digest AS digest,", 1).encode()


@dataclass(frozen=True, slots=True)
class Synced:
    """Outcome of a sync: runs stored, runs whose figures were renewed, runs that were there.

    `damaged` has the keys of runs that were left out: their arrays do not match their digest.
    """

    stored: int
    renewed: int
    present: int
    damaged: tuple[int, ...] = ()


def push(
    library: str,
    address: str,
    cell: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Synced:
    """Store the runs of a library file in a database; the file is only read.

    Figures that the controller changed later, as a law decided on a run, are renewed. `progress` is
    called with the number of new runs that are stored, and of all new ones.

    Raises
    ------
    BadInputError
        If the library or the database cannot be used.
    """
    try:
        runs = ReadOnlyLibrary(library).list(cell)
    except OSError as error:
        raise BadInputError(str(error)) from error
    tell = progress or (lambda _done, _total: None)
    with told(address), contextlib.closing(connect(address)) as connection:
        there = _there(connection, sorted({run["campaign"] for run in runs}))
        new = [run for run in runs if not there.get(_key(run), (False, ""))[0]]
        differ = [
            run for run in runs
            if there.get(_key(run), (False, ""))[0] and there[_key(run)][1] != _sum(run)
        ]  # fmt: skip
        damaged: list[int] = []
        for number, batch in enumerate(_batches(new)):
            tell(BATCH * number, len(new))
            damaged += _push(connection, library, {run["id"]: _figures(run) for run in batch})
        for number, run in enumerate(differ):
            tell(number, len(differ))
            key = [*_key(run), _figures(run)]
            connection.execute(
                "UPDATE run SET figures = %s WHERE (cell, campaign, iteration, digest) "
                "= (%s, %s, %s, %s)",
                [key[-1], *key[:-1]],
            )
    present = len(runs) - len(new) - len(differ)
    return Synced(len(new) - len(damaged), len(differ), present, tuple(damaged))


def pull(
    address: str,
    library: str,
    cell: str,
    progress: Callable[[int, int], object] | None = None,
) -> Synced:
    """Store the runs of a cell that a database has with their arrays in a library file.

    `progress` is called with the number of runs that are stored, and of all that are missing.

    Raises
    ------
    BadInputError
        If the database or the library cannot be used, or its campaign has another run of a number.
    """
    with told(address), contextlib.closing(connect(address, read_only=True)) as connection:
        query = (
            "SELECT id, campaign, iteration, digest FROM run WHERE cell = %s "
            "AND fingerprint IS NOT NULL ORDER BY created_utc, iteration, id"
        )
        found = connection.execute(query, [cell]).fetchall()
        if not found:
            message = f"cell = {cell}: no run of it is in the database"
            raise BadInputError(message)
        prepare(library)
        local = {(run["campaign"], run["index"], run["digest"]) for run in Library(library)}
        wanted = [row[0] for row in found if tuple(row[1:]) not in local]
        stored, damaged = 0, []
        for number, batch in enumerate(_batches(wanted)):
            if progress is not None:
                progress(BATCH * number, len(wanted))
            rows = stored_rows(connection, batch)
            damaged += [row["id"] for row in rows if not is_intact(row)]
            stored += store(library, [row for row in rows if is_intact(row)])
    return Synced(stored, 0, len(found) - len(wanted), tuple(damaged))


def prepare(library: str) -> None:
    """Create a library file, or bring it to the newest version, by the native library."""
    try:
        Library(library).trim(ALL)
    except OSError as error:
        raise BadInputError(str(error)) from error


def stored_rows(connection: psycopg.Connection[Any], ids: list[int]) -> list[dict[str, Any]]:
    """Return runs of a database as rows of a library file, in the order of their keys here."""
    from psycopg.rows import dict_row

    with connection.cursor(row_factory=dict_row) as cursor:
        found = {row["id"]: row for row in cursor.execute(SELECT, [ids])}
    return [_as_row(found[id_]) for id_ in ids if id_ in found]


def is_intact(row: Mapping[str, Any]) -> bool:
    """Return whether arrays match their digest."""
    return library_file.digest(row) == str(row["digest"])


def store(library: str, rows: list[dict[str, Any]]) -> int:
    """Insert rows in one transaction, and return how many were not there."""
    try:
        return library_file.insert(Library(library), rows)
    except OSError as error:
        raise BadInputError(str(error)) from error


def _push(
    connection: psycopg.Connection[Any], library: str, figures: Mapping[int, str]
) -> list[int]:
    """Store runs in one transaction, and return the keys of those left out as damaged."""
    rows = library_file.rows(ReadOnlyLibrary(library), list(figures))
    intact = [row for row in rows if is_intact(row)]
    provenance = {}
    for row in intact:
        texts = (row["program"], row["law_parameters"])
        row["provenance"] = hashlib.sha256(json.dumps(texts).encode()).hexdigest()
        provenance[row["provenance"]] = texts
    # Before the transaction, in a fixed order: cells with the same law never wait for each other.
    for digest in sorted(provenance):
        connection.execute(
            "INSERT INTO provenance VALUES (%s, %s, %s) ON CONFLICT DO NOTHING",
            [digest, *provenance[digest]],
        )
    with connection.transaction(), connection.cursor() as cursor:
        for row in intact:
            values = {name: row[name] for name in (*SHARED, "provenance")}
            found = cursor.execute(INSERT, values | {"figures": figures[row["id"]]}).fetchone()
            signals = {name: row[name] for name in ARRAYS}
            cursor.execute(INSERT_SIGNALS, signals | {"run": found[0] if found else None})
    return [row["id"] for row in rows if not is_intact(row)]


def _there(
    connection: psycopg.Connection[Any], campaigns: list[str]
) -> dict[tuple[Any, ...], tuple[bool, str]]:
    """Return of each stored run of campaigns if it is complete, and a sum of its figures."""
    query = (
        "SELECT cell, campaign, iteration, digest, fingerprint IS NOT NULL, md5(figures::text) "
        "FROM run WHERE campaign = ANY(%s)"
    )
    rows = connection.execute(query, [campaigns])
    return {tuple(row[:4]): (row[4], row[5]) for row in rows}


def _as_row(found: Mapping[str, Any]) -> dict[str, Any]:
    row = {name: found[name] for name in ("id", *SHARED, "program", "law_parameters", *ARRAYS)}
    figures: dict[str, Any] = json.loads(found["figures"])
    return row | figures


def _key(run: Mapping[str, Any]) -> tuple[Any, ...]:
    return run["cell"], run["campaign"], run["index"], run["digest"]


def _figures(run: Mapping[str, Any]) -> str:
    return json.dumps({name: run[name] for name in FIGURES}, allow_nan=False)


def _sum(run: Mapping[str, Any]) -> str:
    return hashlib.md5(_figures(run).encode(), usedforsecurity=False).hexdigest()


def _batches(items: list[Any]) -> list[list[Any]]:
    return [items[start : start + BATCH] for start in range(0, len(items), BATCH)]

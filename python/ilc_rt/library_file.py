"""All SQL that Python has for a library file: pages of runs, and rows read, moved or deleted.

`ilc_rt.library` and `ilc_rt.fleet` may import it. Tables and their upgrades belong to the
controller alone: a file is created, and brought to its newest version, by the native library before
a row is inserted or deleted here.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import sqlite3
import struct
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from ilc_rt.figures import Figures

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

#: Columns of a run beside its figures and arrays.
COLUMNS = (
    "id", "created_utc", "cell", "campaign", "fingerprint", "iteration", "program", "law",
    "law_parameters", "measure", "cycle_s", "n_axes", "axis_names", "input_units", "n_samples",
    "disturbance", "digest",
)  # fmt: skip
#: Arrays, as little-endian float64; the digest of a run is taken over them in this order.
ARRAYS = ("reference_m", "input", "encoder_m", "tool_m", "error_m", "contour_m")
#: Figures, as the controller describes them.
FIGURES = tuple(field.name for field in fields(Figures))
#: Longest wait for another program that is writing.
BUSY_S = 5.0
#: Pages returned to the system at a time, so that a campaign need not wait for all of them.
STEP_PAGES = 1024


@contextlib.contextmanager
def reading(path: str | Path) -> Iterator[sqlite3.Connection]:
    """Open an existing library read-only; nothing is created or changed, also beside the file."""
    place = Path(path).absolute()
    log = Path(f"{place}-wal")
    # Without a log only the file is needed: an archive without write permission can be read.
    at_rest = not (log.exists() and log.stat().st_size > 0)
    mode = "immutable=1" if at_rest else "mode=ro"
    address = f"file://{quote(str(place))}?{mode}"
    with contextlib.closing(sqlite3.connect(address, uri=True, timeout=BUSY_S)) as connection:
        connection.row_factory = sqlite3.Row
        yield connection


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[sqlite3.Connection]:
    """Open a library of the newest version for one transaction: all of it is stored, or nothing."""
    place = quote(str(Path(path).absolute()))
    address = f"file://{place}?mode=rw"
    with contextlib.closing(
        sqlite3.connect(address, uri=True, timeout=BUSY_S, isolation_level=None)
    ) as connection:
        connection.row_factory = sqlite3.Row
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("BEGIN IMMEDIATE")
        try:
            yield connection
        except BaseException:
            connection.execute("ROLLBACK")
            raise
        connection.execute("COMMIT")


def count(connection: sqlite3.Connection, cell: str | None = None) -> int:
    """Return the number of stored runs, of one cell or of all."""
    query = "SELECT count(*) FROM iteration WHERE ?1 IS NULL OR cell = ?1"
    return int(connection.execute(query, [cell]).fetchone()[0])


def page(
    connection: sqlite3.Connection,
    cell: str | None = None,
    campaign: str | None = None,
    limit: int | None = None,
    offset: int = 0,
) -> list[dict[str, Any]] | None:
    """Return runs without their arrays, oldest first, as the native library lists them.

    `campaign` is the beginning of its name. None if a run was stored before there were figures of
    each axis: the native library computes them from the arrays.
    """
    chosen = (
        "SELECT id FROM iteration WHERE (?1 IS NULL OR cell = ?1) "
        "AND (?2 IS NULL OR substr(campaign, 1, length(?2)) = ?2) ORDER BY id LIMIT ?3 OFFSET ?4"
    )
    there = _there(connection)
    names = [name for name in (*COLUMNS, *FIGURES) if name in there]
    # The keys are chosen first: figures are stored behind the arrays, which are long.
    query = f"SELECT {', '.join(names)} FROM iteration WHERE id IN ({chosen}) ORDER BY id"
    rows = connection.execute(query, [cell, campaign, -1 if limit is None else limit, offset])
    runs = [described(dict(row)) for row in rows]
    is_old = any(run["n_axes"] and not run["axes_tracking_inf_m"] for run in runs)
    return None if is_old else runs


def described(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return a stored row without arrays in the form of `Library.list`."""
    run: dict[str, Any] = {key: row[key] for key in ("id", "created_utc", "cell", "campaign")} | {
        "index": row["iteration"]
    }
    run |= {key: row[key] for key in ("law", "measure", "n_samples", "n_axes", "cycle_s")}
    run |= {key: _list(row[key]) for key in ("axis_names", "input_units")}
    return (
        run
        | {"disturbance": _list(row["disturbance"]) or None}
        | figures(row)
        | {"digest": row["digest"]}
    )


def figures(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a stored row; those that an older file lacks have their defaults."""
    read: dict[str, Any] = {}
    for field in fields(Figures):
        value = row.get(field.name)
        if value is None:
            value = None if field.default is MISSING else field.default
            read[field.name] = list(value) if isinstance(value, tuple) else value
        elif field.type == "bool":
            read[field.name] = bool(value)
        elif str(field.type).startswith("tuple"):
            read[field.name] = _list(value)
        else:
            read[field.name] = value
    return read


def stored_figures(described: Mapping[str, Any]) -> dict[str, Any]:
    """Return figures as columns: the reverse of `figures`."""
    return {
        name: json.dumps(value, separators=(",", ":")) if isinstance(value, list) else value
        for name, value in described.items()
        if name in FIGURES
    }


def keys(connection: sqlite3.Connection) -> list[sqlite3.Row]:
    """Return key, cell, campaign, number, digest and figures of every run, oldest first."""
    there = _there(connection)
    names = ["id", "cell", "campaign", "iteration", "digest"]
    names += [name for name in FIGURES if name in there]
    return connection.execute(f"SELECT {', '.join(names)} FROM iteration ORDER BY id").fetchall()


def rows(connection: sqlite3.Connection, ids: Sequence[int]) -> list[dict[str, Any]]:
    """Return runs with their arrays, column by column as they are stored."""
    places = ", ".join("?" * len(ids))
    query = f"SELECT * FROM iteration WHERE id IN ({places}) ORDER BY id"
    return [dict(row) for row in connection.execute(query, list(ids))]


def insert(connection: sqlite3.Connection, row: Mapping[str, Any]) -> bool:
    """Insert a row of another library unchanged, under a new key; False if this very run is there.

    Raises
    ------
    sqlite3.IntegrityError
        If its campaign has another run of this number.
    """
    there = _there(connection)
    kept = {name: value for name, value in row.items() if name in there and name != "id"}
    found = connection.execute(
        "SELECT digest FROM iteration WHERE campaign = ? AND iteration = ?",
        [row["campaign"], row["iteration"]],
    ).fetchone()
    if found is not None and found[0] == row["digest"]:
        return False
    places = ", ".join("?" * len(kept))
    connection.execute(
        f"INSERT INTO iteration ({', '.join(kept)}) VALUES ({places})", list(kept.values())
    )
    return True


def delete(connection: sqlite3.Connection, ids: Iterable[int]) -> None:
    """Delete runs."""
    connection.executemany("DELETE FROM iteration WHERE id = ?", [(id_,) for id_ in ids])


def shrink(
    path: str | Path,
    progress: Callable[[int, int], object] | None = None,
    *,
    step_pages: int = STEP_PAGES,
) -> int:
    """Return the space of deleted runs to the system, in small steps, and return their number.

    `progress` is called with the number of pages that were returned and of all. May be interrupted
    between two steps: the next one goes on.
    """
    n_steps = 0
    address = f"file://{quote(str(Path(path).absolute()))}?mode=rw"
    with contextlib.closing(
        sqlite3.connect(address, uri=True, timeout=BUSY_S, isolation_level=None)
    ) as connection:
        has_vacuum = bool(connection.execute("PRAGMA auto_vacuum").fetchone()[0])
        total = left = connection.execute("PRAGMA freelist_count").fetchone()[0]
        while left and has_vacuum:
            if progress is not None:
                progress(total - left, total)
            # The pragma has a row without columns for each page, after the first of which `execute`
            # would stop.
            connection.executescript(f"PRAGMA incremental_vacuum({step_pages})")
            left = connection.execute("PRAGMA freelist_count").fetchone()[0]
            n_steps += 1
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
    return n_steps


def digest(row: Mapping[str, Any]) -> str:
    """Return the SHA-256 of number, arrays and disturbance: the digest of a row that is intact."""
    hashed = hashlib.sha256(struct.pack("<I", row["iteration"]))
    for name in ARRAYS:
        array = row[name] or b""
        hashed.update(struct.pack("<Q", len(array) // 8))
        hashed.update(array)
    disturbance = _list(row["disturbance"])
    hashed.update(struct.pack(f"<{len(disturbance)}d", *disturbance))
    return hashed.hexdigest()


def _there(connection: sqlite3.Connection) -> set[str]:
    return {row[0] for row in connection.execute("SELECT name FROM pragma_table_info('iteration')")}


def _list(text: str | None) -> list[Any]:
    """Return a list of JSON; a text that is not one is an empty list, as in the native library."""
    try:
        found = json.loads(text or "[]")
    except ValueError:
        return []
    return found if isinstance(found, list) else []

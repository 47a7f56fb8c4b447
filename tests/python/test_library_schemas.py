"""Library files of every earlier schema: listed without a change, upgraded by the first write."""

from __future__ import annotations

import json
import signal
import sqlite3
import subprocess
import sys
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ilc_rt import Library, ReadOnlyLibrary, library_file
from ilc_rt.figures import Figures

if TYPE_CHECKING:
    from pathlib import Path

# Versions 1 to 3 had one table, with the arrays of a run before its figures. Version 1 had no index
# of disturbances; version 2 still a contour error for every run. Neither had figures of individual
# axes, nor a status of the learning; version 3 may lack later figures.
LATER = ("scaled_cycles", "phase", "frozen_ratio")
NEW_IN_3 = ("axes_tracking_inf_m", "axes_tracking_rms_m", "learning_off", "remark")
LATER_FIGURES = {1: LATER + NEW_IN_3, 2: LATER + NEW_IN_3, 3: LATER}
MARK = 0x494C434C
VERSION = 4

COLUMNS = """
    id INTEGER PRIMARY KEY,
    created_utc TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now')),
    cell TEXT NOT NULL, campaign TEXT NOT NULL, fingerprint TEXT NOT NULL,
    iteration INTEGER NOT NULL, program TEXT NOT NULL, law TEXT NOT NULL,
    law_parameters TEXT NOT NULL, measure TEXT NOT NULL, cycle_s REAL NOT NULL,
    n_axes INTEGER NOT NULL, axis_names TEXT NOT NULL, input_units TEXT NOT NULL,
    n_samples INTEGER NOT NULL, disturbance TEXT, digest TEXT NOT NULL,
    reference_m BLOB NOT NULL, input BLOB NOT NULL, encoder_m BLOB NOT NULL, tool_m BLOB,
    error_m BLOB NOT NULL, contour_m BLOB NOT NULL
"""


def runs(library: Library) -> list[dict[str, Any]]:
    """Return the runs without the figures that only a newer schema stores."""
    return [{key: run[key] for key in run if key != "update_ms"} for run in library.list()]


def as_of(version: int, path: Path, n_runs: int = 3) -> list[dict[str, Any]]:
    """Write a library of an earlier version; return its runs, as this version lists them."""
    library = Library(path.with_suffix(".new"))
    for number in range(n_runs):
        ramp = np.outer(np.arange(5.0) + number, [1e-3, 2e-3])
        library.append(ramp * 0.1, ramp * 1e-2, 0.01, reference_m=ramp, cell="press", law="pd")
    before = runs(library)
    rows = library_file.rows(library, [run["id"] for run in before])
    path.with_suffix(".new").unlink()
    as_file(version, path, rows)
    return before


def as_file(version: int, path: Path, rows: list[dict[str, Any]]) -> None:
    """Write rows to a file of an earlier version."""
    figures = [name for name in library_file.FIGURES if name not in LATER_FIGURES[version]]
    described = {field.name: field for field in fields(Figures)}
    kinds = {"float": "REAL NOT NULL", "int": "INTEGER", "bool": "INTEGER"}
    columns = {name: kinds.get(str(described[name].type), "TEXT") for name in figures}
    for name in figures:
        if name.startswith(("contour", "tool")):
            is_given = version < 3 and name.startswith("contour")
            columns[name] = "REAL NOT NULL" if is_given else "REAL"
    table = ", ".join(f"{name} {kind}" for name, kind in columns.items())
    connection = sqlite3.connect(path, isolation_level=None)
    connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute(f"CREATE TABLE iteration ({COLUMNS}, {table}, UNIQUE (campaign, iteration))")
    connection.execute("CREATE INDEX iteration_by_fingerprint ON iteration (fingerprint, id)")
    if version > 1:
        connection.execute(
            "CREATE INDEX iteration_by_disturbance ON iteration (cell, disturbance) "
            "WHERE disturbance IS NOT NULL"
        )
    there = [
        row[0] for row in connection.execute("SELECT name FROM pragma_table_info('iteration')")
    ]
    for row in rows:
        values = [
            json.dumps(row[name]) if isinstance(row[name], list) else row[name] for name in there
        ]
        places = ", ".join("?" * len(there))
        connection.execute(f"INSERT INTO iteration ({', '.join(there)}) VALUES ({places})", values)
    connection.execute(f"PRAGMA application_id = {MARK}")
    connection.execute(f"PRAGMA user_version = {version}")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()


def pragma(path: Path, name: str) -> Any:
    """Return a value that SQLite has for a file."""
    connection = sqlite3.connect(path)
    try:
        return connection.execute(f"PRAGMA {name}").fetchone()[0]
    finally:
        connection.close()


@pytest.mark.parametrize("version", LATER_FIGURES)
def test_an_earlier_file_is_read_unchanged_and_upgraded_by_a_write(
    version: int, tmp_path: Path
) -> None:
    path = tmp_path / "l.db"
    before = as_of(version, path)
    content = path.read_bytes()
    reader = ReadOnlyLibrary(path)
    assert runs(reader) == before
    assert [run["id"] for run in reader.page(limit=2, offset=1)] == [2, 3]
    assert reader.page(limit=2, offset=1) == reader.list()[1:]
    assert reader.load(2)["digest"] == before[1]["digest"]
    assert len(reader) == 3
    assert path.read_bytes() == content
    assert [entry.name for entry in tmp_path.iterdir()] == ["l.db"]

    library = Library(path)
    library.append(np.zeros(4), np.ones(4), 0.01, 20.0)
    assert runs(library)[:3] == before
    assert library.recall(20.0)[0]["id"] == 4
    assert pragma(path, "user_version") == VERSION
    assert pragma(path, "application_id") == MARK
    assert pragma(path, "integrity_check") == "ok"
    assert library.retain(newest=2) == 2


@pytest.mark.parametrize("version", LATER_FIGURES)
def test_rules_upgrade_an_earlier_file_first(version: int, tmp_path: Path) -> None:
    as_of(version, tmp_path / "l.db")
    assert Library(tmp_path / "l.db").retain(best=1) == 1


#: Opens a library for writing under a limit of its files' size, or is killed at a write.
UPGRADER = """
import resource, signal, sys
from ilc_rt import Library

path, limit, is_killed = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "killed"
# Beyond the limit a signal ends the process; if it is ignored, the write fails as on a full disk.
signal.signal(signal.SIGXFSZ, signal.SIG_DFL if is_killed else signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
try:
    Library(path)._remove([])
except OSError as error:
    sys.exit(str(error))
"""


@pytest.mark.parametrize("end", ["killed", "full"])
def test_an_upgrade_that_ends_at_any_write_leaves_the_file_as_it_was(
    end: str, tmp_path: Path
) -> None:
    path = tmp_path / "l.db"
    before = as_of(2, path, n_runs=40)
    content = path.read_bytes()
    outcomes = set()
    for limit in range(1, 65 + len(content) // 4096, 4):
        done = subprocess.run(
            [sys.executable, "-c", UPGRADER, path, str(4096 * limit), end],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        outcomes.add(done.returncode)
        assert done.returncode in (0, 1 if end == "full" else -signal.SIGXFSZ), done.stderr
        if done.returncode == 0:
            break
        if end == "full":
            assert len(done.stderr.splitlines()) == 1, done.stderr
            assert "l.db" in done.stderr
        assert runs(ReadOnlyLibrary(path)) == before
        assert pragma(path, "user_version") == 2
        assert pragma(path, "integrity_check") == "ok"
    assert len(outcomes) == 2, "some ended, and the last one went through"
    assert runs(ReadOnlyLibrary(path)) == before
    assert pragma(path, "user_version") == VERSION
    assert pragma(path, "integrity_check") == "ok"

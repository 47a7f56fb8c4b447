"""Library files of every earlier schema: listed without a change, upgraded by the first write."""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from ilc_rt import Library, ReadOnlyLibrary, library_file

if TYPE_CHECKING:
    from pathlib import Path

# Version 1 had no index of disturbances; version 2 still a contour error for every run. Neither
# had figures of individual axes, nor a status of the learning; version 3 may lack later figures.
LATER = ("scaled_cycles", "phase", "frozen_ratio")
NEW_IN_3 = ("axes_tracking_inf_m", "axes_tracking_rms_m", "learning_off", "remark")
LATER_FIGURES = {1: LATER + NEW_IN_3, 2: LATER + NEW_IN_3, 3: LATER}
MARK = 0x494C434C


def runs(library: Library) -> list[dict[str, Any]]:
    """Return the runs without the figures that only a newer schema stores."""
    return [{key: run[key] for key in run if key != "update_ms"} for run in library.list()]


def as_of(version: int, path: Path) -> list[dict[str, Any]]:
    """Turn a library into one of an earlier version; return its runs before."""
    library = Library(path)
    for number in range(3):
        ramp = np.outer(np.arange(5.0) + number, [1e-3, 2e-3])
        library.append(ramp * 0.1, ramp * 1e-2, 0.01, reference_m=ramp, cell="press", law="pd")
    before = runs(library)
    with sqlite3.connect(path) as connection:
        for name in LATER_FIGURES[version]:
            connection.execute(f"ALTER TABLE iteration DROP COLUMN {name}")
        if version < 3:
            (sql,) = connection.execute(
                "SELECT sql FROM sqlite_schema WHERE name = 'iteration'"
            ).fetchone()
            old = sql
            for name in ("contour_inf_m", "contour_rms_m"):
                old = old.replace(f"{name:<24}REAL", f"{name}           REAL NOT NULL")
            assert old != sql
            connection.execute("PRAGMA writable_schema = ON")
            connection.execute("UPDATE sqlite_schema SET sql = ? WHERE name = 'iteration'", [old])
            connection.execute("PRAGMA writable_schema = RESET")
        if version == 1:
            connection.execute("DROP INDEX iteration_by_disturbance")
        connection.execute(f"PRAGMA user_version = {version}")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    return before


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
    with library_file.reading(path) as connection:
        assert connection.execute("PRAGMA user_version").fetchone()[0] == 3
        assert connection.execute("PRAGMA application_id").fetchone()[0] == MARK
        assert connection.execute("PRAGMA integrity_check").fetchone()[0] == "ok"
    assert library.retain(newest=2) == 2


@pytest.mark.parametrize("version", LATER_FIGURES)
def test_rules_upgrade_an_earlier_file_first(version: int, tmp_path: Path) -> None:
    as_of(version, tmp_path / "l.db")
    assert Library(tmp_path / "l.db").retain(best=1) == 1

"""Small libraries of many cells, made of the runs of one campaign; tests of the fleet import it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from ilc_rt import Library, ReadOnlyLibrary, library_file

if TYPE_CHECKING:
    from pathlib import Path


def template(library: str | Path) -> list[dict[str, Any]]:
    """Return the rows of a library."""
    runs = ReadOnlyLibrary(library)
    return library_file.rows(runs, [run["id"] for run in runs])


def make_cell(path: Path, rows: list[dict[str, Any]], number: int, n_samples: int = 20) -> None:
    """Write a library of one cell, whose numbers are its own."""
    library_file.insert(Library(path), (of_cell(row, number, n_samples) for row in rows))


def of_cell(row: dict[str, Any], number: int, n_samples: int) -> dict[str, Any]:
    """Return a row with the numbers of a cell, shortened."""
    kept = 16 * n_samples
    own = {
        name: row[name][: kept // 2 if name == "contour_m" else kept]
        for name in library_file.ARRAYS
    }
    own |= {"cell": f"cell-{number:03}", "campaign": f"c-{number:03}"}
    own |= {"n_samples": n_samples, "disturbance": json.dumps([20.0 + number / 7])}
    own |= {"tracking_rms_m": row["tracking_rms_m"] * (1 + number / 3)}
    changed = row | own
    return changed | {"digest": library_file.digest(changed)}


def content(path: str | Path) -> list[dict[str, Any]]:
    """Return all that a library holds, without the keys of the file."""
    return [{name: row[name] for name in row if name != "id"} for row in template(path)]

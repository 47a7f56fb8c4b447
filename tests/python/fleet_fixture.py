"""Small libraries of many cells, made of the runs of one campaign; tests of the fleet import it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from ilc_rt import Library, library_file

if TYPE_CHECKING:
    from pathlib import Path


def template(library: str | Path) -> list[dict[str, Any]]:
    """Return the rows of a library."""
    with library_file.reading(library) as file:
        rows = library_file.rows(file, [row["id"] for row in library_file.keys(file)])
    return rows


def make_cell(path: Path, rows: list[dict[str, Any]], number: int, n_samples: int = 20) -> None:
    """Write a library of one cell, whose numbers are its own."""
    Library(path)
    with library_file.writing(path) as file:
        for row in rows:
            kept = 16 * n_samples
            own = {
                name: row[name][: kept // 2 if name == "contour_m" else kept]
                for name in library_file.ARRAYS
            }
            own |= {"cell": f"cell-{number:03}", "campaign": f"c-{number:03}"}
            own |= {"n_samples": n_samples, "disturbance": json.dumps([20.0 + number / 7])}
            own |= {"tracking_rms_m": row["tracking_rms_m"] * (1 + number / 3)}
            changed = row | own
            library_file.insert(file, changed | {"digest": library_file.digest(changed)})


def content(path: str | Path) -> list[dict[str, Any]]:
    """Return all that a library holds, without the keys of the file."""
    with library_file.reading(path) as file:
        rows = library_file.rows(file, [row["id"] for row in library_file.keys(file)])
    return [{name: row[name] for name in row if name != "id"} for row in rows]

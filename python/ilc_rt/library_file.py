"""Rows of a library as other stores hold them, and their digests; `ilc_rt.fleet` imports it.

The native library alone knows the tables of the file. Here a row has the texts of lists and of the
disturbance as JSON, its arrays as little-endian float64, and its figures by name.
"""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from ilc_rt.figures import Figures

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from ilc_rt.library import Library

#: Arrays, as little-endian float64; the digest of a run is taken over them in this order.
ARRAYS = ("reference_m", "input", "encoder_m", "tool_m", "error_m", "contour_m")
#: Figures, as the controller describes them.
FIGURES = tuple(field.name for field in fields(Figures))


def rows(library: Library, ids: Sequence[int]) -> list[dict[str, Any]]:
    """Return runs with their arrays, unchecked.

    Raises
    ------
    OSError
        If there is no such run, or the file cannot be read.
    """
    return [row | json.loads(row.pop("figures")) for row in library._rows(list(ids))]


def insert(library: Library, rows: Iterable[Mapping[str, Any]]) -> int:
    """Store rows under new keys in one transaction, and return how many were not there.

    Raises
    ------
    OSError
        If a campaign has another run of the same number, the arrays of one do not match their
        digest, or the file cannot be written; nothing is stored then.
    """
    return library._insert(
        dict(row) | {"figures": json.dumps({name: row[name] for name in FIGURES if name in row})}
        for row in rows
    )


def digest(row: Mapping[str, Any]) -> str:
    """Return the SHA-256 of number, arrays and disturbance: the digest of a row that is intact."""
    hashed = hashlib.sha256(struct.pack("<I", row["iteration"]))
    for name in ARRAYS:
        array = row[name] or b""
        hashed.update(struct.pack("<Q", len(array) // 8))
        hashed.update(array)
    disturbance = json.loads(row["disturbance"] or "[]")
    hashed.update(struct.pack(f"<{len(disturbance)}d", *disturbance))
    return hashed.hexdigest()

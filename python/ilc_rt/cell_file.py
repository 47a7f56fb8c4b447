"""Edits of a cell description that preserve the rest of the file."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import InlineTable, Item

from ilc_rt._native import Cell
from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Mapping

BOM = "\ufeff"


def write_values(path: str | Path, tables: Mapping[str, Mapping[str, float]]) -> bool:
    """Set numbers in tables of a cell description, atomically.

    Comments, order and spelling of everything else are preserved. The file is only replaced by one
    that the controller accepts.

    `tables` has the numbers by key, by table, e.g. ``learning.norm_optimal``; a missing table is
    created. Returns True if anything changed.
    """
    # A link stays a link: its target is replaced.
    place = Path(path).resolve()
    try:
        text = place.read_bytes().decode("utf-8")
    except OSError as error:
        message = f"{path}: {error.strerror}"
        raise BadInputError(message) from error
    except UnicodeDecodeError as error:
        message = f"{path}: not UTF-8 at byte {error.start}"
        raise BadInputError(message) from error
    mark, text = (BOM, text[1:]) if text.startswith(BOM) else ("", text)
    changed = text
    for section, values in tables.items():
        changed = changed_text(changed, section, values, str(path))
    changed = mark + changed
    if changed == mark + text:
        return False
    _replace(place, changed, str(path))
    return True


def changed_text(text: str, section: str, values: Mapping[str, float], name: str) -> str:
    """Return a TOML text with numbers set in a table.

    A name in use for something else than a table is refused.
    """
    try:
        document = tomlkit.parse(text)
        table: Any = document
        for part in section.split("."):
            if part not in table:
                table[part] = (
                    tomlkit.inline_table() if isinstance(table, InlineTable) else tomlkit.table()
                )
            table = table[part]
            if not hasattr(table, "items"):
                message = f"{name}: {section}: {part} is not a table"
                raise BadInputError(message)
        for key, value in values.items():
            if key in table and _is_equal(table[key], value):
                continue
            table[key] = float(value)
        return tomlkit.dumps(document)
    except TOMLKitError as error:
        message = f"{name}: {' '.join(str(error).split())}"
        raise BadInputError(message) from error


def _is_equal(found: object, value: float) -> bool:
    plain = found.unwrap() if isinstance(found, Item) else found
    return isinstance(plain, (int, float)) and float(plain) == float(value)


def _replace(place: Path, text: str, name: str) -> None:
    """Replace a file by one that the controller accepts, or leave it unchanged."""
    try:
        Cell._check(text, name)
    except ValueError as error:
        message = f"{name}: left as it was: {' '.join(str(error).split())}"
        raise BadInputError(message) from error
    draft: str | None = None
    try:
        # In the same folder: a rename within a folder is atomic.
        handle, draft = tempfile.mkstemp(prefix=f".{place.stem}-", suffix=".toml", dir=place.parent)
        with os.fdopen(handle, "wb") as file:
            file.write(text.encode("utf-8"))
            file.flush()
            os.fsync(file.fileno())
        Path(draft).chmod(place.stat().st_mode & 0o7777)
        Path(draft).replace(place)
        draft = None
    except OSError as error:
        message = f"{name}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error
    finally:
        if draft is not None:
            Path(draft).unlink(missing_ok=True)

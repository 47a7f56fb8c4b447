"""Notes on runs, in a file beside their library: ``ilc-library.db.notes.json``.

The library has no place for them, and stays as the controller wrote it.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import tempfile
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from ilc_rt.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

NOTE_MAX = 2_000
FILE_MAX_BYTES = 16 << 20
_lock = Lock()


def notes_file(library: Path) -> Path:
    """Return the file of the notes on the runs of a library.

    Examples
    --------
    >>> notes_file(Path("ilc-library.db")).name
    'ilc-library.db.notes.json'
    """
    return library.with_name(f"{library.name}.notes.json")


def name_of(row: Mapping[str, object]) -> str:
    """Return the name under which a run has its note: campaign and number.

    Examples
    --------
    >>> name_of({"campaign": "20261129-074100-7aad", "index": 3})
    '20261129-074100-7aad/3'
    """
    return f"{row['campaign']}/{row['index']}"


def read_notes(library: Path) -> dict[str, str]:
    """Return the notes by the names of their runs; empty without a file.

    Raises
    ------
    BadInputError
        If the file is no such file.
    """
    file = notes_file(library)
    try:
        if file.stat().st_size > FILE_MAX_BYTES:
            message = f"{file}: larger than {FILE_MAX_BYTES >> 20} MiB"
            raise BadInputError(message)
        notes = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, RecursionError) as error:
        message = f"{file}: no notes: {error}"
        raise BadInputError(message) from error
    if not isinstance(notes, dict) or not all(isinstance(text, str) for text in notes.values()):
        message = f"{file}: no notes: an object of texts is needed"
        raise BadInputError(message)
    return notes


def write_note(library: Path, run: str, text: str) -> None:
    """Set the note on a run; an empty text deletes it. The file is replaced as a whole.

    Raises
    ------
    BadInputError
        If the note is too long, or the file cannot be read or written.
    """
    text = text.strip()
    if len(text) > NOTE_MAX:
        message = f"note of {len(text)} characters: at most {NOTE_MAX}"
        raise BadInputError(message)
    file = notes_file(library)
    try:
        with _lock, _alone_in(file.parent):
            notes = read_notes(library)
            notes.pop(run, None)
            if text:
                notes[run] = text
            written = json.dumps(notes, indent=1, ensure_ascii=False, sort_keys=True)
            _replace(file, written + "\n")
    except OSError as error:
        message = f"{file}: cannot be written: {error.strerror}"
        raise BadInputError(message) from error


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Keep other dashboards from writing notes in a folder; no file is left behind."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        # The lock ends with the handle.
        os.close(handle)


def _replace(file: Path, text: str) -> None:
    handle, name = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as temporary:
            temporary.write(text)
            temporary.flush()
            os.fsync(temporary.fileno())
        if file.exists():
            Path(name).chmod(file.stat().st_mode & 0o777)
        Path(name).replace(file)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise

"""The programs that a process has started."""

from __future__ import annotations

import contextlib
from pathlib import Path


def children(pid: int) -> dict[str, int]:
    """Return the process ids of the children of a process by the name of their program."""
    found = {}
    for number in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        with contextlib.suppress(OSError):
            found[Path(f"/proc/{number}/comm").read_text().strip()] = int(number)
    return found

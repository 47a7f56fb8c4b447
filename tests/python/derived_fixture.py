"""Files that derive from the source: compared, or rewritten with ``ILC_DERIVE=1``, as in Rust."""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def hold_derived_file(document: str, text: str) -> None:
    """Hold a whole derived file against ``text``."""
    path = ROOT / document
    if path.exists() and path.read_text(encoding="utf-8") == text:
        return
    assert "ILC_DERIVE" in os.environ, (
        f"{document} is not what the source says; `make derived` writes it"
    )
    path.write_text(text, encoding="utf-8")

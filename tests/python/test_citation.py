"""The citation file and the page on citing name this version."""

from __future__ import annotations

import re
from pathlib import Path

import ilc_rt

ROOT = Path(__file__).resolve().parents[2]


def test_the_version_is_the_one_of_the_package() -> None:
    cff = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    assert re.findall(r"^version: (\S+)$", cff, re.MULTILINE) == [ilc_rt.__version__]
    assert re.findall(r"version += \{(\S+)\}", page) == [ilc_rt.__version__]


def test_the_citation_file_has_what_its_format_needs() -> None:
    """The keys that version 1.2.0 of the format requires, and the licence of the package."""
    cff = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    keys = re.findall(r"^([a-z-]+):", cff, re.MULTILINE)
    assert {"cff-version", "message", "title", "authors"} <= set(keys)
    assert len(keys) == len(set(keys))
    title = re.search(r"^title: \"(.+)\"$", cff, re.MULTILINE)
    assert title
    assert title[1] in (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    assert "license: MIT" in cff
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("MIT License")

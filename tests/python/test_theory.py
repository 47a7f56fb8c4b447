"""Every law has a page of theory, whose names derive from the package and the cell description."""

from __future__ import annotations

import inspect
import json
import os
import re

import pytest
from derived_fixture import ROOT

import ilc_rt
from ilc_rt import NormOptimalIlc, laws

THEORY = ROOT / "docs" / "theory"
INDEX = THEORY / "index.md"
BLOCK = re.compile(r"(<!-- derived: (?:names|laws) -->\n).*?(<!-- end -->)", re.DOTALL)

#: Pages of laws that are called otherwise in Python.
PAGE_IN_A_CELL = {"repetitive": "position-domain"}


def page_of(name: str) -> str:
    """Return the name of a law's page: `PdIlc`, `pd` and `error_feedforward` in words."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", name.removesuffix("Ilc")).lower()
    words = words.replace("_", "-")
    return PAGE_IN_A_CELL.get(words, words)


def in_python() -> dict[str, str]:
    """Return the Python name of every law by its page."""
    classes = [
        name for name in laws.__all__
        if inspect.isclass(getattr(laws, name)) and hasattr(getattr(laws, name), "update")
    ]  # fmt: skip
    made = [name for name, one in vars(NormOptimalIlc).items() if isinstance(one, classmethod)]
    names = {page_of(name): name for name in classes}
    return names | {page_of(name): f"NormOptimalIlc.{name}" for name in made}


def in_cells() -> dict[str, str]:
    """Return what selects a law in a cell description, by its page."""
    schema = json.loads((ROOT / "docs" / "cell.schema.json").read_text(encoding="utf-8"))
    known = schema["definitions"]
    names = [one.get("const") for one in known["LawName"]["oneOf"]]
    names += [name for one in known["LawName"]["oneOf"] for name in one.get("enum", [])]
    found = {}
    for law in (name for name in names if name and name != "none"):
        found[page_of(law)] = f'`law = "{law}"`, {table(f"learning.{law}")}'
    # A table without a law of its name is a wrapper of any law, or a part of norm-optimal ILC.
    for key, value in known["Learning"]["properties"].items():
        is_table = "$ref" in json.dumps(value) and page_of(key) in in_python()
        if is_table and key not in names:
            found[page_of(key)] = table(f"learning.{key}")
    found["contour"] = table("learning.norm_optimal.contour", "learningnorm_optimal")
    return found


def table(name: str, anchor: str = "") -> str:
    """Return the link to a table of the cell description."""
    heading = anchor or name.replace(".", "")
    headings = (ROOT / "docs" / "cell.md").read_text(encoding="utf-8")
    if f"### `[{name}]`, around any law" in headings:
        heading += "-around-any-law"
    return f"[`[{name}]`](../cell.md#{heading})"


PAGES = sorted(in_python() | in_cells())


def names(page: str) -> str:
    """Return the line that says what a law is called."""
    python, cell = in_python().get(page), in_cells().get(page)
    parts = [f"Python: [`{python}`](../python/laws.md)"] if python else []
    parts += [f"cell: {cell}"] if cell else ["in a cell: `Campaign(cell, law=…)` from Python"]
    return " · ".join(parts)


def overview() -> str:
    """Return the table of all pages."""
    lines = ["| law | in Python | in a cell description |", "|---|---|---|"]
    for page in PAGES:
        title = (THEORY / f"{page}.md").read_text(encoding="utf-8").splitlines()[0]
        python, cell = in_python().get(page, ""), in_cells().get(page, "")
        shown = f"`{python}`" if python else ""
        lines.append(f"| [{title.removeprefix('# ')}]({page}.md) | {shown} | {cell} |")
    return "\n".join(lines)


@pytest.mark.parametrize("page", PAGES)
def test_a_law_has_a_page(page: str) -> None:
    """With its equation, its convergence, its use and its source."""
    path = THEORY / f"{page}.md"
    assert path.exists(), f"docs/theory/{page}.md: a law needs its page, see CONTRIBUTING.md"
    text = path.read_text(encoding="utf-8")
    for part in ("$$", "## Convergence", "## Use", "\nSource: "):
        assert part in text, f"{path.name} lacks {part!r}"
    keys = (ROOT / "docs" / "sources.md").read_text(encoding="utf-8")
    for key in re.findall(r"\[([^\]`]+)\]\(\.\./sources\.md\)", text):
        assert f"| {key} |" in keys, f"{path.name}: [{key}] is not in sources.md"


def test_there_is_no_page_without_a_law() -> None:
    found = {path.stem for path in THEORY.glob("*.md")} - {"index"}
    assert found == set(PAGES)
    assert all(name.split(".")[0] in ilc_rt.__all__ for name in in_python().values())


@pytest.mark.parametrize("page", ["index", *PAGES])
def test_names_are_those_of_the_package_and_of_the_cell_description(page: str) -> None:
    path = THEORY / f"{page}.md"
    text = path.read_text(encoding="utf-8")
    made = overview() if page == "index" else names(page)
    derived, count = BLOCK.subn(lambda block: f"{block[1]}{made}\n{block[2]}", text)
    assert count == 1, f"{path.name} lacks its derived block"
    if derived != text:
        assert "ILC_DERIVE" in os.environ, f"{path.name} is out of date; `make derived` writes it"
        path.write_text(derived, encoding="utf-8")

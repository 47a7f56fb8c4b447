"""Links of every document lead to a file of the tree, and to a heading of that file.

The site has a test of its own; this one covers all documents as the forge shows them, also those
outside the site, without building anything.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Text in brackets, which may hold one more pair, and the target in parentheses.
LINK = re.compile(r"(?<!\\)\[(?:[^\[\]]|\[[^\[\]]*\])*\]\(<?([^()\s<>]+)>?(?: \"[^\"]*\")?\)")
HTML = re.compile(r"<(?:a|img)\b[^>]*\b(?:href|src)=\"([^\"]+)\"")
#: Made by `make docs` beside the pages.
MADE = ("../rust/",)


def documents() -> list[Path]:
    """Return every document of the tree; what is built or installed is in other folders."""
    found = [*ROOT.glob("*.md")]
    for folder in ("benchmarks", "crates", "docs", "examples", "papers", "python", "sim", "tests"):
        for ending in ("*.md", "*.ipynb"):
            found += (ROOT / folder).rglob(ending)
    # Copies that editors of notebooks keep are in hidden folders.
    return sorted(one for one in found if "/." not in str(one.relative_to(ROOT)))


def markdown(document: Path) -> str:
    """Return the text of a document without its code."""
    text = document.read_text(encoding="utf-8")
    if document.suffix == ".ipynb":
        cells = json.loads(text)["cells"]
        kept = ["".join(one["source"]) for one in cells if one["cell_type"] == "markdown"]
        text = "\n\n".join(kept)
    return re.sub(r"^( *)(```+).*?^\1\2 *$", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(document: Path) -> set[str]:
    """Return the anchors of a document's headings, as GitHub makes them."""
    found: dict[str, int] = {}
    for heading in re.findall(r"^#{1,6} +(.+?) *#*$", markdown(document), re.MULTILINE):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        count = found.get(slug, 0)
        found[slug] = count + 1
        if count:
            found[f"{slug}-{count}"] = 1
    return set(found)


def links(document: Path) -> list[str]:
    """Return the targets of a document's links within the tree."""
    text = re.sub(r"(`+)(?:(?!\1).)+?\1(?!\()", "`", markdown(document))
    found = [*LINK.findall(text), *HTML.findall(text)]
    return [link for link in found if not re.match(r"[a-z][a-z0-9+.-]*:", link)]


def dead(document: Path) -> list[str]:
    """Return the links of a document that lead nowhere."""
    wrong = []
    for link in links(document):
        if link.startswith(MADE):
            continue
        path, _, anchor = link.partition("#")
        target = (document.parent / unquote(path)).resolve() if path else document
        is_file = target.exists() and target.is_relative_to(ROOT)
        if not is_file or (anchor and unquote(anchor) not in anchors(target)):
            wrong.append(link)
    return wrong


DOCUMENTS = documents()


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_link_has_a_target(document: Path) -> None:
    assert not dead(document)


def test_documents_and_links_are_found() -> None:
    assert len(DOCUMENTS) > 40
    assert {".md", ".ipynb"} == {document.suffix for document in DOCUMENTS}
    assert sum(len(links(document)) for document in DOCUMENTS) > 200


def test_a_dead_link_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing file, a missing heading, a link out of the tree; code is no link."""
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    (tmp_path / "there.md").write_text("# A `[key]`, of two\n\n## Twice\n\n## Twice\n", "utf-8")
    page = tmp_path / "page.md"
    page.write_text(
        "[a](there.md) [b](there.md#a-key-of-two) [c](there.md#twice-1) [d](#own)\n"
        "[e](https://example.org/x)\n"
        "[`code`](there.md#twice) `[f](nowhere.md)`\n\n## Own\n\n```text\n[g](nowhere.md)\n```\n",
        "utf-8",
    )
    assert dead(page) == []
    page.write_text("[a](gone.md) [b](there.md#twice-2) [c](../out.md) [d](#other)\n", "utf-8")
    assert dead(page) == ["gone.md", "there.md#twice-2", "../out.md", "#other"]

"""The documentation site has no dead internal link; `make docs` runs this after building it."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import ilc_rt

ROOT = Path(__file__).parents[2]
#: `make docs` puts the pages of rustdoc there, whose links rustdoc itself checks.
RUST = "rust/"


class Page(HTMLParser):
    """The links and anchors of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, _tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect what a tag links to and what it names."""
        for name, value in attrs:
            if name in {"href", "src"} and value:
                self.links.append(value)
            if name in {"id", "name"} and value:
                self.anchors.add(value)


@pytest.fixture(scope="module")
def site() -> Path:
    """Return the site that `make docs` has just built."""
    assert (ROOT / "build/docs/index.html").exists(), "run `make docs`"
    return ROOT / "build/docs"


def test_every_internal_link_has_a_target(site: Path) -> None:
    pages = {path.resolve(): Page(path) for path in site.rglob("*.html")}
    dead, crates = [], set()
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            inside = target.relative_to(site.resolve()).as_posix()
            if inside.startswith(RUST):
                crates.add(inside.split("/")[1])
            elif not target.exists() or (
                parts.fragment
                and target in pages
                and unquote(parts.fragment) not in pages[target].anchors
            ):
                dead.append(f"{path.relative_to(site.resolve())}: {link}")
    assert not dead, "\n".join(dead)
    members = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    known = {
        name.replace("-", "_") for name in re.findall(r"^(ilc-[a-z]+) = ", members, re.MULTILINE)
    }
    assert crates
    assert crates <= known, "a link to a crate that this workspace lacks"


def test_the_site_needs_no_network(site: Path) -> None:
    """Scripts, styles and pictures are its own, and equations are MathML."""
    for path in site.rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        assert not re.findall(r"<(?:script|link|img)[^>]*(?:src|href)=\"https?:[^\"]*", text), path
    theory = [path.read_text(encoding="utf-8") for path in (site / "docs/theory").glob("*.html")]
    equations = re.findall(r"<math .*?</math>", "\n".join(theory), re.DOTALL)
    assert len(equations) > 100
    # A command that the converter does not know is left as it is.
    assert not [one for one in equations if "\\" in one]


def test_everything_public_is_on_a_page(site: Path) -> None:
    shown = {
        anchor.rsplit(".", 1)[-1]
        for path in (site / "docs" / "python").glob("*.html")
        for anchor in Page(path).anchors
        if anchor.startswith(("ilc_rt.", "module-ilc_rt."))
    }
    missing = [name for name in ilc_rt.__all__ if not name.startswith("_") and name not in shown]
    assert not missing

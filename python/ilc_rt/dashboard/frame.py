"""Parts that all pages have: head, way between pages, panels, charts."""

from __future__ import annotations

import inspect
import json
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from nicegui import ui

from ilc_rt.dashboard.look import STUB

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterator

    from nicegui import Client
    from nicegui.element import Element

PAGES = {"/": "Cells", "/library": "Library"}
#: Seconds after which a browser that does not answer, as one in the background, is sent more.
SHOWN_S = 5.0


@contextmanager
def page_frame(here: str, name: str = "") -> Iterator[None]:
    """Build the head of a page, `name` in its title; the block builds the rest."""
    title = name or PAGES.get(here, "")
    ui.page_title(f"{title} - ilc-rt")
    ui.add_head_html(STUB)
    with tag("header", "bar"):
        text("ilc-rt", "brand")
        with tag("nav", aria_label="Pages"):
            for path, page in PAGES.items():
                link = ui.link(page, path)
                if path == here:
                    link.props["aria-current"] = "page"
        with tag("div", "end"):
            text("read-only", "quiet").props["title"] = "This page cannot command a machine."
            switch = button("Theme: auto", "")
            switch.props["data-theme-switch"] = ""
            switch.on("click", js_handler="() => window.ilc.theme()")
    with tag("div", "body"):
        if not name:
            # The page of a cell has its own heading.
            with tag("h1", "unseen"):
                text(title)
        yield


def tag(name: str, classes: str = "", **attributes: object) -> Element:
    """Return an element of HTML; ``_`` in the name of an attribute is a hyphen."""
    element = ui.element(name).classes(classes)
    for key, value in attributes.items():
        element.props[key.replace("_", "-")] = value
    return element


def text(content: str, classes: str = "", name: str = "") -> ui.label:
    """Return a text that may change, never markup; `name` marks it for tests and scripts."""
    label = ui.label(content).classes(classes)
    if name:
        label.props["data-name"] = name
    return label


def say(label: ui.label, content: str) -> None:
    """Change a text; nothing is sent if it is the same."""
    if label.text != content:
        label.set_text(content)


def button(content: str, classes: str) -> ui.label:
    """Return a button with a text that may change."""
    label = ui.label(content).classes(f"plain {classes}")
    label.tag = "button"
    label.props["type"] = "button"
    return label


@contextmanager
def panel(title: str, width: str = "") -> Iterator[Element]:
    """Build a panel with a heading; yields the row of the heading, for controls."""
    with tag("section", f"panel {width}", aria_label=title):
        with tag("div", "head") as head, tag("h2"):
            text(title)
        yield head


def fact(what: str, name: str) -> ui.label:
    """Build a figure with its name above it, and return the label of its value."""
    with tag("div"):
        text(what, "what")
        return text("-", "value", name)


def chart(name: str, label: str, size: str = "") -> Element:
    """Return the place of a chart, which `draw` fills under its name."""
    return tag("div", f"chart {size}", data_chart=name, role="img", aria_label=label)


def draw(client: Client, name: str, option: dict[str, Any]) -> None:
    """Draw a chart in a browser."""
    call(client, "draw", name, option)


def call(client: Client, method: str, *values: object) -> None:
    """Call a function of the page's script, without waiting for it."""
    arguments = ", ".join(json.dumps(value, separators=(",", ":")) for value in values)
    client.run_javascript(f"window.ilc.{method}({arguments})")


def every(interval_s: float, work: Callable[[], bool | Awaitable[None] | None]) -> None:
    """Do some work for this page again and again, at the pace of its browser.

    The next turn waits until the browser has shown what was sent: a slow one gets fewer points and
    texts instead of a growing queue. Work that returns false has sent nothing.
    """
    client = ui.context.client

    async def turn() -> None:
        done = work()
        if inspect.isawaitable(done):
            await done
        elif done is False:
            return
        with suppress(TimeoutError):
            await client.run_javascript("window.ilc.shown()", timeout=SHOWN_S)

    ui.timer(interval_s, turn)


def level(element: Element, name: str) -> None:
    """Mark an element with a level of `status.SYMBOLS`."""
    wanted = f"level-{name}"
    others = [one for one in element.classes if one.startswith("level-") and one != wanted]
    if others or wanted not in element.classes:
        element.classes(add=wanted, remove=" ".join(others))

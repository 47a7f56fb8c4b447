"""Figures of a report: inline SVG in the colours of the page, with what a reader points at.

The script of the page (``data/report.js``) computes values from the lines as drawn; it is given the
place and the range of each axis. Imported by the report alone.
"""

from __future__ import annotations

import html
import io
import json
import re
import warnings
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np

from ilc_rt.pictures.themes import THEMES, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ilc_rt.pictures.themes import Theme

POINTS_PER_INCH = 72.0


def theme_css() -> str:
    """Return the colours of all pictures as variables: light, dark, and as the system says."""
    light, dark = (_variables(THEMES[name]) for name in ("light", "dark"))
    return (
        f":root {{ color-scheme: light; {light} }}\n"
        "@media (prefers-color-scheme: dark) {\n"
        f':root:not([data-theme="light"]) {{ color-scheme: dark; {dark} }}\n}}\n'
        f':root[data-theme="dark"] {{ color-scheme: dark; {dark} }}\n'
        # Paper is white.
        f"@media print {{ :root, :root:not([data-theme]), :root[data-theme] {{ {light} }} }}\n"
    )


def svg(figure: Figure, name: str) -> str:
    """Return a figure as inline SVG, without links and with unique ids.

    `name` begins the ids, and is unique to each figure of a page.
    """
    buffer = io.StringIO()
    with mpl.rc_context({**style(), "svg.hashsalt": name}), warnings.catch_warnings():
        # A name may contain glyphs that the font lacks; the reader's browser has them.
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r"\sxmlns(:xlink)?=\"[^\"]*\"", "", text)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", text)
    text = re.sub(r'<svg (height|width)="[^"]*"', "<svg", text, count=1)
    text = re.sub(r'(<svg[^>]*?) (?:width|height)="[^"]*"', r"\1", text, count=2)
    text = text.replace("xlink:href", "href")
    # The style sheet of the page has the fonts; a thousandth of a point is not seen.
    text = re.sub(r" font-family: [^;\"]*;", "", text)
    text = re.sub(r"(\.\d{3})\d+", r"\1", text)
    text = re.sub(r"#[0-9a-f]{6}\b", _as_variable, text)
    return re.sub(r"\n\s*", "\n", text).strip()


def plot_card(figure: Figure, name: str, heading: str, caption: str) -> str:
    """Return a figure as a card with its heading, caption, tools and readout.

    `heading` and `caption` are HTML.
    """
    series = _series(figure)
    drawn = svg(figure, name)
    # Known after drawing, when the layout is made.
    facts = {
        "axes": [_place(axes, figure) for axes in figure.axes],
        "series": [{**one, "id": f"{name}-{one['id']}"} for one in series],
    }
    drawn = drawn.replace(
        "<svg ",
        f'<svg role="img" tabindex="0" aria-labelledby="{name}-title {name}-caption" ',
        1,
    )
    buttons = "".join(
        f'<button type="button" data-act="{act}" aria-label="{words}" title="{words}">'
        f"{sign}</button>"
        for act, sign, words in (
            ("in", "+", "Zoom in"), ("out", "&#8722;", "Zoom out"), ("whole", "&#8634;", "Show all")
        )
    )  # fmt: skip
    return (
        f'<figure class="card" id="{name}" data-plot="{html.escape(json.dumps(facts))}">\n'
        f'<h2 id="{name}-title">{heading}</h2>\n'
        f'<figcaption id="{name}-caption">{caption} '
        f'<a class="how" href="#read-{name}">How to read it</a></figcaption>\n'
        f'<div class="tools" hidden>{buttons}</div>\n'
        f'<div class="stage">{drawn}<i class="mark" hidden></i></div>\n'
        '<output aria-live="polite"></output></figure>\n'
    )


def _series(figure: Figure) -> list[dict[str, Any]]:
    """Name the lines that can be read, and return their ids, labels and places."""
    found = []
    for place, axes in enumerate(figure.axes):
        for number, line in enumerate(axes.lines):
            label = str(line.get_label())
            # Lines across an axis, e.g. of a limit, have no values; others may have no points.
            if label.startswith("_") or line.get_transform() != axes.transData:
                continue
            if np.isfinite(np.asarray(line.get_xydata(), dtype=np.float64)).all(axis=1).any():
                line.set_gid(f"line-{place}-{number}")
                found.append({"id": line.get_gid(), "label": _plain(label), "axes": place})
    return found


def _place(axes: Axes, figure: Figure) -> dict[str, list[Any]]:
    """Return start and end of both axes in the picture, their values, scales and labels."""
    scale = POINTS_PER_INCH / figure.dpi
    box = axes.get_window_extent()
    height = figure.bbox.height * scale
    across = axes.get_xlabel() or figure.axes[-1].get_xlabel()
    return {
        "x": [box.x0 * scale, box.x1 * scale, *map(float, axes.get_xlim()), axes.get_xscale(),
              _plain(across)],
        "y": [height - box.y0 * scale, height - box.y1 * scale, *map(float, axes.get_ylim()),
              axes.get_yscale(), _plain(axes.get_ylabel())],
    }  # fmt: skip


def _plain(label: str) -> str:
    return label.replace(r"\$", "$")


def _roles(theme: Theme) -> dict[str, str]:
    roles = {
        role: getattr(theme, role) for role in ("ground", "ink", "ticks", "edge", "grid", "path")
    }
    return roles | {f"series-{k}": colour for k, colour in enumerate(theme.series)}


def _variables(theme: Theme) -> str:
    return " ".join(f"--{role}: {colour};" for role, colour in _roles(theme).items())


def _as_variable(colour: re.Match[str]) -> str:
    """Return a colour of the light theme as its variable, and any other as it is."""
    for role, light in _roles(THEMES["light"]).items():
        if light.lower() == colour[0]:
            return f"var(--{role})"
    return colour[0]

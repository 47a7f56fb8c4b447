"""Colours of all pictures, on a light or a dark ground.

Imported by every module that draws. Names of colours are roles: what the last run has in one theme,
it has in the other.
"""

from __future__ import annotations

from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib as mpl

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["WIDTH_IN", "Theme", "current", "style", "theme"]

WIDTH_IN = 5.6
"""Width of a figure in inches, which suits a phone."""


@dataclass(frozen=True)
class Theme:
    """Colours of a picture, as ``#RRGGBB``.

    Attributes
    ----------
    ground : str
        Background of figure and axes.
    ink, ticks : str
        Text and marks; numbers at the axes.
    edge, grid, path : str
        Frame of the axes, its grid, and what lies behind the lines, e.g. a programmed path.
    series : tuple of str
        Lines, distinct for colour-blind readers: the first one is the last run or the first of
        several results, the second one the first run or the second result.
    """

    ground: str
    ink: str
    ticks: str
    edge: str
    grid: str
    path: str
    series: tuple[str, ...]

    @property
    def last(self) -> str:
        """Colour of a last run, of a model, of what converges."""
        return self.series[0]

    @property
    def first(self) -> str:
        """Colour of a first run, of a measurement, of what does not converge."""
        return self.series[1]

    @property
    def third(self) -> str:
        """Colour of a third quantity beside them, e.g. a contour error or a coherence."""
        return self.series[2]


# After Okabe and Ito; yellow and sky blue are darker than theirs, to be seen on white.
THEMES = {
    "light": Theme(
        ground="#FFFFFF", ink="#30343B", ticks="#5A6068", edge="#9AA0A8", grid="#E6E8EB",
        path="#DADDE2",
        series=("#0072B2", "#D55E00", "#009E73", "#C2649C", "#A87400", "#7B52AB", "#30343B"),
    ),
    "dark": Theme(
        ground="#14171C", ink="#E6E9EE", ticks="#AEB6C2", edge="#5C6470", grid="#2B3038",
        path="#3A414C",
        series=("#4FB3F6", "#FF8A3D", "#2FC79A", "#E18CC0", "#E6B23C", "#C3A6F0", "#E6E9EE"),
    ),
}  # fmt: skip

_current: ContextVar[Theme] = ContextVar("theme", default=THEMES["light"])


def current() -> Theme:
    """Return the colours that are drawn with now."""
    return _current.get()


def style() -> dict[Any, Any]:
    """Return the settings of matplotlib for the colours that are drawn with now."""
    now = current()
    return {
        "axes.axisbelow": True,
        "axes.edgecolor": now.edge,
        "axes.facecolor": now.ground,
        "axes.grid": True,
        "axes.labelcolor": now.ink,
        "axes.labelsize": 10,
        "axes.spines.right": False,
        "axes.spines.top": False,
        "axes.titlecolor": now.ink,
        "axes.titlelocation": "left",
        "axes.titlesize": 10,
        "figure.constrained_layout.use": True,
        "figure.dpi": 150,
        "figure.edgecolor": now.ground,
        "figure.facecolor": now.ground,
        "font.family": "sans-serif",
        "font.size": 10,
        "grid.color": now.grid,
        "grid.linewidth": 0.8,
        "legend.fontsize": 9,
        "legend.edgecolor": "none",
        "legend.facecolor": now.ground,
        "legend.framealpha": 0.75,
        "legend.handlelength": 1.6,
        "lines.linewidth": 1.6,
        "path.simplify_threshold": 0.4,
        "svg.fonttype": "none",
        "text.color": now.ink,
        "xtick.color": now.ticks,
        "xtick.labelsize": 9,
        "ytick.color": now.ticks,
        "ytick.labelsize": 9,
    }


@contextmanager
def theme(name: str) -> Iterator[Theme]:
    """Draw on another ground within a block: ``with theme("dark"):``.

    Parameters
    ----------
    name : {"light", "dark"}
        Colours. Axes that are given to a picture are made within the block too, with any function
        of matplotlib: their ground and their labels are set when they are made.

    Yields
    ------
    Theme
        The colours.

    Raises
    ------
    ValueError
        If there is no theme of this name.

    Examples
    --------
    >>> from ilc_rt import pictures
    >>> with pictures.theme("dark") as colours:
    ...     print(colours.ground)
    #14171C
    """
    if name not in THEMES:
        message = f"theme = {name!r}: allowed {', '.join(map(repr, THEMES))}"
        raise ValueError(message)
    token = _current.set(THEMES[name])
    try:
        with mpl.rc_context(style()):
            yield current()
    finally:
        _current.reset(token)

"""Map of a library: a figure of the kept runs against the disturbance that they were made under."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, TypeAlias

import matplotlib as mpl
import numpy as np

from ilc_rt.pictures.given import axes_or_new, logarithmic, suitable_unit, with_unit
from ilc_rt.pictures.themes import current, style
from ilc_rt.quantity import axis_unit
from ilc_rt.result import library_rows
from ilc_rt.text import label

if TYPE_CHECKING:
    from typing import Any

    from matplotlib.axes import Axes

__all__ = ["library_map"]

Libraries: TypeAlias = (
    "str | PathLike[str] | Sequence[str | PathLike[str]] | Mapping[str, str | PathLike[str]]"
)

# Campaigns that get a colour and a label of their own; those before them are drawn together.
NAMED_MAX = 6
MARKERS = ("o", "s", "^", "D", "v", "P", "X")


def library_map(
    libraries: Libraries,
    *,
    disturbance: int = 0,
    figure: str = "tracking_rms_m",
    cell: str | None = None,
    xlabel: str = "disturbance",
    ax: Axes | None = None,
) -> Axes:
    """Draw a figure of every kept run against the disturbance that it was made under.

    Runs near the bottom and near today's disturbance are those that `RelevanceIlc` learns from;
    a range of disturbances without a run is one in which nothing is known yet.

    Parameters
    ----------
    libraries : path, or sequence or mapping of paths
        Library files. Of one the newest campaigns have a colour each, of several each library; the
        keys of a mapping are the labels.
    disturbance : int
        Number of the disturbance.
    figure : str
        Figure of merit, of `ilc_rt.figures.Figures`.
    cell : str or None
        Only runs of the cell of this name.
    xlabel : str
        Name of the disturbance with its unit, e.g. ``"temperature in °C"``.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If no run has this disturbance and this figure.
    BadInputError
        If a file is not a library.
    """
    groups, unit_of, without = _groups(libraries, disturbance, figure, cell)
    if not groups:
        message = (
            f"no run has disturbance {disturbance} and the figure {figure!r}; "
            f"{without} runs have no such disturbance or figure"
        )
        raise ValueError(message)
    values = np.concatenate([np.array(points)[:, 1] for _, points in groups])
    unit = suitable_unit(unit_of, values.tolist())
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for number, (name, points) in enumerate(groups):
            at, merit = np.array(points).T
            axes.plot(
                at, np.where(merit > 0.0, merit, np.nan) * unit.scale,
                MARKERS[number % len(MARKERS)], markersize=5.0, alpha=0.85,
                color=current().series[number % len(current().series)], label=name,
            )  # fmt: skip
        if (values > 0.0).any():
            logarithmic(axes)
        axes.set_xlabel(xlabel)
        axes.set_ylabel(with_unit(figure.removesuffix("_m").replace("_", " "), unit))
        axes.legend()
        if without:
            axes.set_title(f"{without} more runs without this disturbance or figure", fontsize=9)
    return axes


def _groups(
    libraries: Libraries, disturbance: int, figure: str, cell: str | None
) -> tuple[list[tuple[str, list[tuple[float, float]]]], str, int]:
    """Return points by label, the unit of the figure, and the number of runs that have no point."""
    if isinstance(libraries, Mapping):
        files = list(libraries.items())
    elif isinstance(libraries, (str, PathLike)):
        files = [("", libraries)]
    else:
        files = [(str(path), path) for path in libraries]
    found: dict[str, list[tuple[float, float]]] = {}
    unit, without = "m", 0
    for name, path in files:
        rows = library_rows(fspath(path), cell)
        campaigns = list(dict.fromkeys(str(row["campaign"]) for row in rows))
        newest = set(campaigns[-NAMED_MAX:])
        for row in rows:
            point = _point(row, disturbance, figure)
            if point is None:
                without += 1
                continue
            unit = axis_unit(next(iter(row.get("input_units") or ()), "m"))
            campaign = str(row["campaign"])
            of = campaign if campaign in newest else "earlier campaigns"
            found.setdefault(name if len(files) > 1 else of, []).append(point)
    return [(label(name), points) for name, points in found.items()], unit, without


def _point(row: dict[str, Any], disturbance: int, figure: str) -> tuple[float, float] | None:
    under, merit = row.get("disturbance"), row.get(figure)
    if under is None or not isinstance(merit, float) or not 0 <= disturbance < len(under):
        return None
    return float(under[disturbance]), merit

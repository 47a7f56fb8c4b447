"""Picture of a robustness map: one panel per parameter, and one for the first two together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from ilc_rt.pictures.given import panels_or_new
from ilc_rt.pictures.themes import current, style
from ilc_rt.quantity import unit_for
from ilc_rt.text import label

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from ilc_rt.quantity import Unit
    from ilc_rt.robustness import RobustnessMap, Variation


def robustness(found: RobustnessMap, *, ax: Axes | Sequence[Axes] | None = None) -> list[Axes]:
    """Draw the last error of each case over each parameter.

    Blue circles converge, orange crosses do not; the line is the worst error of each part of the
    range. With two parameters or more, a last panel shows the first two against each other.

    Parameters
    ----------
    found : RobustnessMap
        At least one case.
    ax : sequence of matplotlib.axes.Axes or None
        One per panel; None for new ones.

    Returns
    -------
    list of matplotlib.axes.Axes
        The axes drawn into.

    Raises
    ------
    ValueError
        If there is no case, or another number of axes.
    """
    if not found.cases:
        message = "a map needs at least one case"
        raise ValueError(message)
    count = len(found.variations) + (len(found.variations) > 1)
    with mpl.rc_context(style()):
        # Each parameter has a scale of its own below its panel.
        panels = panels_or_new(ax, count, 0.4 + 2.8 * count, [1.0] * count, share=False)
        unit = unit_for("m", float(np.nanmax(np.append(found.last_m, 0.0))))
        for axes_of_one, variation, row in zip(
            panels, found.variations, found.by_parameter(), strict=False
        ):
            _panel(axes_of_one, found, variation, row["parts"], unit)
        if count > 1:
            _pair(panels[-1], found)
        if ax is None:
            panels[0].set_title(found.sentence(), fontsize=9)
        panels[0].legend()
    return panels


def _panel(
    axes: Axes,
    found: RobustnessMap,
    variation: Variation,
    parts: list[dict[str, float]],
    unit: Unit,
) -> None:
    values, last = found.values(variation.key), found.last_m * unit.scale
    for is_one, colour, marker, name in _kinds():
        chosen = found.converged == is_one
        axes.plot(values[chosen], last[chosen], marker, color=colour, markersize=4.5, label=name)
    known = [part for part in parts if part["worst_error_m"] is not None]
    for part in known:
        axes.plot(
            [part["from"], part["to"]], [part["worst_error_m"] * unit.scale] * 2,
            color=current().ink, linewidth=1.2,
        )  # fmt: skip
    axes.set_xscale(variation.scale)
    if (last[np.isfinite(last)] > 0.0).any():
        axes.set_yscale("log")
    axes.set_xlabel(label(variation.key))
    axes.set_ylabel(f"last error in {unit.symbol}")


def _pair(axes: Axes, found: RobustnessMap) -> None:
    across, up = found.variations[:2]
    for is_one, colour, marker, _ in _kinds():
        chosen = found.converged == is_one
        axes.plot(
            found.values(across.key)[chosen], found.values(up.key)[chosen], marker, color=colour,
            markersize=4.5,
        )  # fmt: skip
    axes.set_xscale(across.scale)
    axes.set_yscale(up.scale)
    axes.set_xlabel(label(across.key))
    axes.set_ylabel(label(up.key))


def _kinds() -> tuple[tuple[bool, str, str, str], ...]:
    return (
        (True, current().last, "o", "converges"),
        (False, current().first, "x", "does not converge"),
    )

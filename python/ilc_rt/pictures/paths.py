"""Picture of a path with its deviations magnified."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from ilc_rt.deviation import magnification, path_deviation
from ilc_rt.pictures.given import Results, Runs, axes_or_new, colours, shown_runs
from ilc_rt.pictures.themes import current, style
from ilc_rt.quantity import unit_for
from ilc_rt.text import label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ilc_rt.record import IterationRecord
    from ilc_rt.result import CampaignResult

    Array = NDArray[np.float64]

__all__ = ["contour", "contour_axes"]

# Smallest range of a coordinate that counts as motion, and distance that counts as rounding.
MOVES_M = 1e-9
ROUNDING_M = 1e-12


def contour(
    results: Results,
    *,
    run: Runs = -1,
    factor: int | None = None,
    ax: Axes | None = None,
    palette: tuple[str, ...] | None = None,
) -> Axes:
    """Draw a path true to scale, and the deviations from it magnified.

    Lag along the path is no deviation. Only the first two linear axes that move are drawn.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn, each on its own reference; the grey path is that of the first one.
    run : int or sequence of int
        Number of the run, or of several; negative ones count from the last.
    factor : int or None
        Magnification; None for one by which the largest deviation of the first run is visible.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.
    palette : tuple of str or None
        Colours of the runs; None for those of the theme.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into; the title says the magnification.

    Raises
    ------
    ValueError
        If a path has no contour, there is no such run, or the factor is below 1.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, pictures, simulate
    >>> path = np.column_stack((np.linspace(0.0, 0.1, 50), 0.02 * np.hanning(50)))
    >>> result = simulate(lambda u: u, PdIlc(kp=0.5, lead_samples=0), path, trials=3)
    >>> pictures.contour(result, run=(1, 2)).get_xlabel()
    'axis 1 in mm'
    """
    runs = shown_runs(results, run)
    shown = {id(record): _paths(result, record) for _, result, record in runs}
    _, first_result, first = runs[0]
    reference, deviation = shown[id(first)]
    extent_m = float(np.ptp(reference, axis=0).max())
    largest_m = float(np.linalg.norm(deviation, axis=1).max())
    largest_m = 0.0 if largest_m < ROUNDING_M else largest_m
    chosen = magnification(largest_m, extent_m) if factor is None else factor
    if chosen < 1:
        message = f"factor = {factor}: 1 or more is needed"
        raise ValueError(message)
    unit = unit_for("m", 10.0 * extent_m)
    names = [label(first_result.axis_names[axis]) for axis in contour_axes(first_result)]
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        axes.plot(*(reference.T * unit.scale), color=current().path, linewidth=5.0,
                  label="programmed", solid_capstyle="round")  # fmt: skip
        order = iter(palette) if palette is not None else colours()
        for (name, _, record), colour in zip(runs, order, strict=False):
            path, moved = shown[id(record)]
            axes.plot(*((path + chosen * moved).T * unit.scale), color=colour, linewidth=1.3,
                      label=name if len(runs) > 1 else f"run {record.index}")  # fmt: skip
        axes.set_aspect("equal")
        round_m = _round_down(largest_m)
        own = unit_for("m", round_m)
        axes.set_title(
            "no deviation" if round_m == 0.0
            else "deviation true to scale" if chosen == 1
            else f"deviation shown {chosen:,} times: {round_m * own.scale:g} {own.symbol} as "
            f"{round_m * chosen * unit.scale:.2g} {unit.symbol}"
        )  # fmt: skip
        axes.set_xlabel(f"{names[0]} in {unit.symbol}")
        axes.set_ylabel(f"{names[1]} in {unit.symbol}")
        axes.legend(loc="best")
    return axes


def contour_axes(result: CampaignResult) -> list[int]:
    """Return the two linear axes in which a contour is drawn; fewer if there is no contour."""
    first = result.records[0]
    if first.contour_inf_m is None:
        return []
    reference = first.reference_m
    linear = [axis for axis in range(reference.shape[1]) if result.axis_unit(axis) == "m"]
    return [axis for axis in linear if np.ptp(reference[:, axis]) > MOVES_M][:2]


def _paths(result: CampaignResult, record: IterationRecord) -> tuple[Array, Array]:
    """Return path and deviation in the two axes drawn, of shape (n_samples, 2)."""
    shown = contour_axes(result)
    if len(shown) < 2 or record.contour_inf_m is None:
        message = (
            f"run {record.index} has no contour: at least two linear axes that move are needed"
        )
        raise ValueError(message)
    linear = [axis for axis in range(result.n_axes) if result.axis_unit(axis) == "m"]
    moved = path_deviation(record.reference_m[:, linear], record.tool_or_encoder_m[:, linear])
    return record.reference_m[:, shown], moved[:, [linear.index(axis) for axis in shown]]


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10 ... that is not above."""
    if value <= 0.0:
        return 0.0
    decade = 10.0 ** float(np.floor(np.log10(value)))
    return float(max(s * decade for s in (1.0, 2.0, 5.0) if s * decade <= value * 1.0001))

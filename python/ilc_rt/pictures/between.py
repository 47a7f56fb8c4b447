"""Picture of the error between the samples of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import matplotlib as mpl
import numpy as np

from ilc_rt.intersample import error_between_samples
from ilc_rt.pictures.given import (
    Results,
    Runs,
    axes_or_new,
    colours,
    largest,
    shown_runs,
    suitable_unit,
    values_of,
    with_unit,
)
from ilc_rt.pictures.themes import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ilc_rt.laws.arguments import Model

__all__ = ["between_samples"]


def between_samples(
    results: Results,
    plant: Model,
    *,
    run: Runs = -1,
    axis: int = 0,
    ratio: int = 16,
    delay_s: float = 0.0,
    command: Literal["input", "sum"] = "input",
    ax: Axes | None = None,
) -> Axes:
    """Draw the error of runs between their samples, and the samples as dots.

    A law sees the samples alone: where the line swings between dots near zero, the input rings.

    Parameters
    ----------
    results : result, sequence or mapping of results
        What is drawn; the keys of a mapping are the labels, otherwise the laws.
    plant : StateSpace or compatible
        Continuous-time plant that made the runs, from rest.
    run : int or sequence of int
        Number of the run, or of several; negative ones count from the last.
    axis : int
        Channel.
    ratio, delay_s, command
        As for `ilc_rt.intersample.error_between_samples`.
    ax : matplotlib.axes.Axes or None
        Axes to draw into; None for new ones.

    Returns
    -------
    matplotlib.axes.Axes
        The axes drawn into; the labels have the largest error at and between the samples.

    Raises
    ------
    ValueError
        If the plant is sampled or does not suit the runs, or there is no such run or channel.

    Examples
    --------
    >>> import numpy as np
    >>> from ilc_rt import PdIlc, discretize, pictures, second_order, simulate
    >>> plant = second_order(94.0, 0.7)
    >>> result = simulate(discretize(plant, 0.002), PdIlc(kp=0.5), np.hanning(100))
    >>> pictures.between_samples(result, plant).get_xlabel()
    'time in s'
    """
    shown = []
    for name, result, record in shown_runs(results, run):
        samples = values_of(record, "error", axis)
        time_s, error = error_between_samples(
            record, plant, result.cycle_s, ratio=ratio, delay_s=delay_s, command=command
        )
        shown.append((name, result, samples, time_s, error[:, axis]))
    unit = suitable_unit(shown[0][1].axis_unit(axis), [largest(part[4]) for part in shown])
    with mpl.rc_context(style()):
        axes = axes_or_new(ax)
        for (name, result, samples, time_s, error), colour in zip(shown, colours(), strict=False):
            told = f"{name}: {unit.text(largest(samples))} at, {unit.text(largest(error))} between"
            axes.plot(time_s, error * unit.scale, color=colour, linewidth=1.0, label=told)
            axes.plot(
                np.arange(len(samples)) * result.cycle_s, samples * unit.scale, ".",
                color=colour, markersize=3.0,
            )  # fmt: skip
        axes.set_xlabel("time in s")
        axes.set_ylabel(with_unit("error", unit))
        axes.legend()
    return axes

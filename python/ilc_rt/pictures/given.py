"""Arguments of every picture of results: their labels, one signal of a run, axes, a unit.

Imported by the pictures of this package alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from ilc_rt.pictures.themes import WIDTH_IN, current
from ilc_rt.quantity import Unit, unit_for
from ilc_rt.result import CampaignResult
from ilc_rt.text import label

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ilc_rt.record import IterationRecord

    Array = NDArray[np.float64]

Results: TypeAlias = CampaignResult | Sequence[CampaignResult] | Mapping[str, CampaignResult]
Runs: TypeAlias = int | Sequence[int]

HEIGHT_IN = 3.4
SIGNALS = {"error": "error_m", "input": "input", "output": "encoder_m"}


def named(results: Results) -> list[tuple[str, CampaignResult]]:
    """Return results with their labels: keys of a mapping, or the names of the laws.

    Raises
    ------
    ValueError
        If there is no result, or one has no run.
    """
    if isinstance(results, Mapping):
        found = [(label(name), result) for name, result in results.items()]
    else:
        every: list[Any] = [results] if hasattr(results, "records") else list(results)
        laws = [result.law or result.cell or "result" for result in every]
        found = [
            (label(law if laws.count(law) == 1 else f"{law} {number + 1}"), result)
            for number, (law, result) in enumerate(zip(laws, every, strict=True))
        ]
    if not found or not all(result.records for _, result in found):
        message = "results: at least one result, each with at least one run, is needed"
        raise ValueError(message)
    return found


def shown_runs(results: Results, run: Runs) -> list[tuple[str, CampaignResult, IterationRecord]]:
    """Return the runs that are drawn, with their labels: of one result several may be.

    Raises
    ------
    ValueError
        As `named`, and if there is no such run.
    """
    found = []
    several = named(results)
    wanted = [run] if isinstance(run, (int, np.integer)) else list(run)
    for name, result in several:
        for number in wanted:
            record = record_of(result, int(number))
            if len(wanted) == 1:
                text = name
            elif len(several) == 1:
                text = f"run {record.index}"
            else:
                text = f"{name}, run {record.index}"
            found.append((text, result, record))
    return found


def record_of(result: CampaignResult, run: int) -> IterationRecord:
    """Return a run by its number; negative ones count from the last.

    Raises
    ------
    ValueError
        If there is no such run.
    """
    if not -len(result.records) <= run < len(result.records):
        message = f"run = {run}: there are {len(result.records)} runs"
        raise ValueError(message)
    return result.records[run]


def values_of(record: IterationRecord, what: str, axis: int) -> Array:
    """Return error, input or output of a channel of a run.

    Raises
    ------
    ValueError
        If there is no such signal or channel.
    """
    if what not in SIGNALS:
        message = f"what = {what!r}: allowed {', '.join(map(repr, SIGNALS))}"
        raise ValueError(message)
    values: Array = getattr(record, SIGNALS[what])
    if not 0 <= axis < values.shape[1]:
        message = f"axis = {axis}: allowed 0 to {values.shape[1] - 1}"
        raise ValueError(message)
    return values[:, axis]


def base_unit(result: CampaignResult, what: str, axis: int) -> str:
    """Return the unit of a signal of a channel."""
    return result.input_unit(axis) if what == "input" else result.axis_unit(axis)


def suitable_unit(base: str, sizes: Sequence[float]) -> Unit:
    """Return the unit with the prefix that suits the largest of the sizes."""
    finite = [value for value in sizes if np.isfinite(value)]
    return unit_for(base, max(finite, default=0.0))


def largest(values: Array) -> float:
    """Return the largest magnitude; 0 if there is no value."""
    return float(np.abs(values).max(initial=0.0))


def with_unit(what: str, unit: Unit) -> str:
    """Return the label of a quantity with its unit."""
    return f"{what} in {unit.symbol}" if unit.symbol else what


def axes_or_new(ax: Axes | None) -> Axes:
    """Return the axes given, or those of a new figure."""
    if ax is not None:
        return ax
    return Figure(figsize=(WIDTH_IN, HEIGHT_IN)).subplots()


def panels_or_new(
    ax: Axes | Sequence[Axes] | None,
    count: int,
    height_in: float,
    ratios: Sequence[float],
    *,
    share: bool = True,
) -> list[Axes]:
    """Return the axes given, or those of a new figure, one above the other.

    Raises
    ------
    ValueError
        If another number of axes is given.
    """
    if ax is None:
        figure = Figure(figsize=(WIDTH_IN, height_in))
        grid = figure.subplots(count, 1, sharex=share, squeeze=False, height_ratios=ratios)
        return list(grid[:, 0])
    panels: list[Axes] = list(np.atleast_1d(np.asarray(ax, dtype=object)).ravel())
    if len(panels) != count:
        message = f"ax: {len(panels)} axes; {count} are needed"
        raise ValueError(message)
    return panels


def logarithmic(axes: Axes) -> None:
    """Scale the left axis logarithmically, with plain numbers at 1, 2 and 5."""
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(_minor_label))


def _minor_label(value: float, _position: int | None) -> str:
    if value <= 0.0:
        return ""
    exponent = np.floor(np.log10(value))
    return f"{value:g}" if round(value / 10.0**exponent) in {2, 5} else ""


def colours() -> Iterator[str]:
    """Return the colours of the lines, again and again."""
    return cycle(current().series)

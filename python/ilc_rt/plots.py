"""The pictures of a campaign, each a matplotlib figure.

Every figure is drawn without a display, in colours for colour-blind readers (Okabe and Ito), at a
width that suits a phone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

from ilc_rt.deviation import magnification, path_deviation
from ilc_rt.quantity import Unit, unit_for
from ilc_rt.text import label

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from ilc_rt.comparison import Column
    from ilc_rt.events import Histogram
    from ilc_rt.record import IterationRecord
    from ilc_rt.result import CampaignResult

    Array = NDArray[np.float64]

FIRST = "#D55E00"
LAST = "#0072B2"
CONTOUR = "#009E73"
PATH = "#DADDE2"
INK = "#30343B"
WIDTH_IN = 5.6
FIRST_BIN_RATIO = 1.5
# Smallest range of a coordinate that counts as motion, and distance that counts as rounding.
MOVES_M = 1e-9
ROUNDING_M = 1e-12

STYLE: dict[Any, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#9AA0A8",
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 10,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": INK,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "figure.constrained_layout.use": True,
    "figure.dpi": 150,
    "font.family": "sans-serif",
    "font.size": 10,
    "grid.color": "#E6E8EB",
    "grid.linewidth": 0.8,
    "legend.fontsize": 9,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "lines.linewidth": 1.6,
    "path.simplify_threshold": 0.4,
    "svg.fonttype": "none",
    "text.color": INK,
    "xtick.color": "#5A6068",
    "xtick.labelsize": 9,
    "ytick.color": "#5A6068",
    "ytick.labelsize": 9,
}


def convergence(result: CampaignResult) -> Figure:
    """Draw the errors against the number of the run, on a log scale."""
    comparison = result.comparison
    bases = dict.fromkeys(column.unit.base for column in comparison.errors())
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 0.6 + 2.9 * len(bases)))
        panels = figure.subplots(len(bases), 1, sharex=True, squeeze=False)[:, 0]
        for axes, base in zip(panels, bases, strict=True):
            columns = [c for c in comparison.errors() if c.unit.base == base]
            _convergence_panel(axes, result.records, columns, base)
        panels[-1].set_xlabel("run (0 is without learning)")
        shown: dict[str, Artist] = {}
        for axes in panels:
            handles, labels = axes.get_legend_handles_labels()
            shown.update(zip(labels, handles, strict=True))
        figure.legend(list(shown.values()), list(shown), loc="outside upper center", ncols=4,
                      columnspacing=1.2)  # fmt: skip
        figure.align_ylabels()
        return figure


def contour(result: CampaignResult) -> Figure | None:
    """Draw the path with its deviations magnified; None for a path without a contour.

    The upper picture shows first and last run at the same magnification, the
    lower one the last run at its own. Only the first two linear axes that move
    are drawn.
    """
    if not result.records:
        return None
    first, last = result.records[0], result.records[-1]
    if first.contour_inf_m is None or last.contour_inf_m is None:
        return None
    reference = first.reference_m
    linear = [axis for axis in range(reference.shape[1]) if result.axis_unit(axis) == "m"]
    shown = [axis for axis in linear if np.ptp(reference[:, axis]) > MOVES_M][:2]
    if len(shown) < 2:
        return None
    extent_m = float(np.ptp(reference[:, shown], axis=0).max())
    with mpl.rc_context(STYLE):
        aspect = float(np.ptp(reference[:, shown[1]]) / extent_m)
        panels = [[first, last], [last]] if first is not last else [[first]]
        height = 0.6 + max(1.6, (WIDTH_IN - 0.8) * 1.15 * min(aspect, 1.0)) + 0.3
        figure = Figure(figsize=(WIDTH_IN, height * len(panels)))
        grid = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        deviations = {
            record.id: _deviation(record, linear)[:, [linear.index(axis) for axis in shown]]
            for record in (first, last)
        }
        names = tuple(label(result.axis_names[axis]) for axis in shown)
        for axes, records in zip(grid, panels, strict=True):
            colours = [FIRST if record is first else LAST for record in records]
            paths = [(r, r.reference_m[:, shown], deviations[r.id]) for r in records]
            _contour_panel(axes, paths, colours, names, extent_m)
        figure.align_ylabels()
        return figure


def learned_input(result: CampaignResult) -> Figure | None:
    """Draw the learned input of each axis, first and last; None if there is none."""
    learned = [record for record in result.records if np.any(record.input)]
    if not learned:
        return None
    first, last = learned[0], learned[-1]
    shown = [(first, FIRST), (last, LAST)][first is last :]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 1.1 + 1.6 * result.n_axes))
        grid = figure.subplots(result.n_axes, 1, sharex=True, squeeze=False)[:, 0]
        for number, axes in enumerate(grid):
            size = max(_largest(record.input[:, number]) for record, _ in shown)
            unit = unit_for(result.input_unit(number), size)
            for record, colour in shown:
                _over_time(axes, record.input[:, number], result.cycle_s, unit,
                           color=colour, linewidth=1.2, label=f"run {record.index}")  # fmt: skip
            axes.set_title(label(result.axis_names[number]))
            axes.set_ylabel(f"input in {unit.symbol}")
        grid[-1].set_xlabel("time in s")
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        figure.align_ylabels()
        return figure


def tracking(result: CampaignResult) -> Figure | None:
    """Draw the tracking error over time: first against last run, then last alone."""
    if not result.records:
        return None
    first, last = result.records[0], result.records[-1]
    with mpl.rc_context(STYLE):
        panels = 2 if first is not last else 1
        figure = Figure(figsize=(WIDTH_IN, 0.8 + 1.45 * result.n_axes * panels))
        grid = figure.subplots(result.n_axes * panels, 1, sharex=True, squeeze=False)[:, 0]
        for number in range(result.n_axes):
            name, base = label(result.axis_names[number]), result.axis_unit(number)
            errors = [record.error_m[:, number] for record in (first, last)]
            upper = grid[number * panels]
            unit = unit_for(base, max(map(_largest, errors)))
            for record, error, colour in zip((first, last), errors, (FIRST, LAST), strict=True):
                if record is first or panels == 2:
                    _over_time(upper, error, result.cycle_s, unit, color=colour, linewidth=1.2,
                               label=f"run {record.index}")  # fmt: skip
            upper.set_title(name)
            upper.set_ylabel(f"error in {unit.symbol}")
            if panels == 2:
                lower = grid[number * panels + 1]
                unit = unit_for(base, _largest(errors[1]))
                _over_time(lower, errors[1], result.cycle_s, unit, color=LAST, linewidth=1.0)
                lower.set_title(f"{name}, run {last.index} on a scale of its own")
                lower.set_ylabel(f"error in {unit.symbol}")
        grid[-1].set_xlabel("time in s")
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        figure.align_ylabels()
        return figure


def latency(result: CampaignResult) -> Figure | None:
    """Draw latency and execution time of the loop; None in lock-step."""
    if result.latency is None:
        return None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        upper, lower = figure.subplots(2, 1)
        _histogram_panel(upper, result.latency.wake_late_us, LAST, "late wake-up")
        _histogram_panel(lower, result.latency.execution_us, CONTOUR, "computation in a cycle")
        lower.set_xlabel("time in µs")
        return figure


def _convergence_panel(
    axes: Axes, records: Sequence[IterationRecord], columns: list[Column], base: str
) -> None:
    """Draw the errors of one unit; an error of 0 has no place on a logarithmic scale."""
    index = [record.index for record in records]
    rows = [(column, [column.of(record) for record in records]) for column in columns]
    known = [value for _, row in rows for value in row if value]
    unit = unit_for(base, max(known, default=0.0))
    for column, row in rows:
        what, kind = column.name.split(" ", 1)[::-1]
        colour, marker = (CONTOUR, "s") if what == "contour" else (LAST, "o")
        filled = colour if kind == "max" else "white"
        values = [value * unit.scale if value else np.nan for value in row]
        axes.plot(
            index, values, "-" if kind == "max" else ":", color=colour, marker=marker,
            markersize=4.5, markerfacecolor=filled, label=f"{what}, {kind}",
        )  # fmt: skip
    for record in records:
        if record.rolled_back:
            axes.axvline(record.index, color=FIRST, linewidth=1, linestyle="--")
    if known:
        axes.set_yscale("log")
        axes.yaxis.set_minor_formatter(FuncFormatter(_minor_label))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_ylabel(f"error in {unit.symbol}")


def _deviation(record: IterationRecord, linear: list[int]) -> Array:
    return path_deviation(record.reference_m[:, linear], record.tool_or_encoder_m[:, linear])


def _largest(signal: Array) -> float:
    return float(np.abs(signal).max(initial=0.0))


def _over_time(axes: Axes, signal: Array, cycle_s: float, unit: Unit, **style: str | float) -> None:
    look: dict[str, Any] = dict(style)
    axes.plot(np.arange(len(signal)) * cycle_s, signal * unit.scale, **look)


def _contour_panel(
    axes: Axes,
    paths: list[tuple[IterationRecord, Array, Array]],
    colours: list[str],
    names: tuple[str, ...],
    extent_m: float,
) -> None:
    """Draw paths and their deviations; the first one determines the magnification."""
    largest_m = float(np.linalg.norm(paths[0][2], axis=1).max())
    largest_m = 0.0 if largest_m < ROUNDING_M else largest_m
    factor = magnification(largest_m, extent_m)
    unit = unit_for("m", 10.0 * extent_m)
    reference = paths[0][1]
    axes.plot(*(reference.T * unit.scale), color=PATH, linewidth=5.0, label="programmed",
              solid_capstyle="round")  # fmt: skip
    for (record, path, deviation), colour in zip(paths, colours, strict=True):
        shown = path + factor * deviation
        axes.plot(*(shown.T * unit.scale), color=colour, linewidth=1.3, label=f"run {record.index}")
    axes.set_aspect("equal")
    round_m = _round_down(largest_m)
    own = unit_for("m", round_m)
    axes.set_title(
        f"deviation shown {factor:,} times: {round_m * own.scale:g} {own.symbol} as "
        f"{round_m * factor * unit.scale:.2g} {unit.symbol}"
        if round_m > 0.0 else "no deviation"
    )  # fmt: skip
    axes.set_xlabel(f"{names[0]} in {unit.symbol}")
    axes.set_ylabel(f"{names[1]} in {unit.symbol}")
    axes.legend(loc="center")


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10 ... that is not above."""
    if value <= 0.0:
        return 0.0
    decade = 10.0 ** float(np.floor(np.log10(value)))
    return float(max(s * decade for s in (1.0, 2.0, 5.0) if s * decade <= value * 1.0001))


def _histogram_panel(axes: Axes, histogram: Histogram, colour: str, title: str) -> None:
    """Draw the bins as counted: each begins at the end of the previous one."""
    seen = [number for number, (_, count) in enumerate(histogram.bins) if count > 0]
    if seen:
        uppers = np.array([upper for upper, _ in histogram.bins], dtype=np.float64)
        counts = np.array([count for _, count in histogram.bins], dtype=np.float64)
        lowers = np.r_[uppers[0] / FIRST_BIN_RATIO, uppers[:-1]]
        shown = slice(seen[0], seen[-1] + 1)
        axes.bar(lowers[shown], counts[shown], (uppers - lowers)[shown], align="edge",
                 color=colour, edgecolor="white", linewidth=0.5)  # fmt: skip
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.6)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    quantiles = (histogram.p50, histogram.p99, histogram.p999, histogram.max)
    for value in quantiles:
        axes.axvline(value, color=INK, linewidth=0.9, linestyle=(0, (3, 2)))
    half, p99, p999, longest = (f"{v:.3g}" if v < 1000 else f"{v:.0f}" for v in quantiles)
    axes.set_title(
        f"{title}: half within {half} µs, 99 % {p99}, 99.9 % {p999}, all {longest}", fontsize=9
    )
    axes.set_ylabel("cycles")


def _minor_label(value: float, _position: int | None) -> str:
    exponent = np.floor(np.log10(value))
    return f"{value:g}" if round(value / 10.0**exponent) in {2, 5} else ""

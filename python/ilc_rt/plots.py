"""Pages of a report on a campaign: each a matplotlib figure of several panels.

Put together from the pictures of `ilc_rt.pictures`, which draw into given axes. Every figure is
drawn without a display, at a width that suits a phone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ilc_rt.pictures.given import logarithmic
from ilc_rt.pictures.paths import contour as contour_picture
from ilc_rt.pictures.paths import contour_axes
from ilc_rt.pictures.runs import signal
from ilc_rt.pictures.themes import WIDTH_IN, current, style
from ilc_rt.pictures.timing import latency as latency_picture
from ilc_rt.quantity import unit_for
from ilc_rt.text import label

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from ilc_rt.comparison import Column
    from ilc_rt.record import IterationRecord
    from ilc_rt.result import CampaignResult


def convergence(result: CampaignResult) -> Figure:
    """Draw the errors against the number of the run, on a log scale."""
    comparison = result.comparison
    bases = dict.fromkeys(column.unit.base for column in comparison.errors())
    with mpl.rc_context(style()):
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

    The upper picture shows first and last run at the same magnification, the lower one the last run
    at its own.
    """
    if not result.records or len(contour_axes(result)) < 2:
        return None
    shown = contour_axes(result)
    last = _last_learned(result)
    reference = result.records[0].reference_m[:, shown]
    aspect = float(np.ptp(reference[:, 1]) / np.ptp(reference, axis=0).max())
    panels = [(0, last), (last,)] if last else [(0,)]
    height = 0.6 + max(1.6, (WIDTH_IN - 0.8) * 1.15 * min(aspect, 1.0)) + 0.3
    with mpl.rc_context(style()):
        figure = Figure(figsize=(WIDTH_IN, height * len(panels)))
        grid = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
        for axes, runs in zip(grid, panels, strict=True):
            palette = tuple(current().last if run else current().first for run in runs)
            contour_picture(result, run=runs, palette=palette, ax=axes)
            axes.legend(loc="center")
        figure.align_ylabels()
        return figure


def learned_input(result: CampaignResult) -> Figure | None:
    """Draw the learned input of each axis, first and last; None if there is none."""
    learned = [
        number
        for number, record in enumerate(result.records)
        if np.any(record.input) and not record.phase
    ]
    if not learned:
        return None
    runs = tuple(dict.fromkeys((learned[0], learned[-1])))
    with mpl.rc_context(style()):
        figure = Figure(figsize=(WIDTH_IN, 1.1 + 1.6 * result.n_axes))
        grid = figure.subplots(result.n_axes, 1, sharex=True, squeeze=False)[:, 0]
        for number, axes in enumerate(grid):
            _over_time(axes, result, "input", runs, number)
            axes.set_title(label(result.axis_names[number]))
        return _finished(figure, list(grid))


def _last_learned(result: CampaignResult) -> int:
    """Return the place of the last run that was not made to measure something for the law."""
    return max(n for n, record in enumerate(result.records) if n == 0 or not record.phase)


def tracking(result: CampaignResult) -> Figure | None:
    """Draw the tracking error over time: first against last run, then last alone."""
    if not result.records:
        return None
    runs = tuple(dict.fromkeys((0, _last_learned(result))))
    panels = len(runs)
    with mpl.rc_context(style()):
        figure = Figure(figsize=(WIDTH_IN, 0.8 + 1.45 * result.n_axes * panels))
        grid = figure.subplots(result.n_axes * panels, 1, sharex=True, squeeze=False)[:, 0]
        for number in range(result.n_axes):
            name = label(result.axis_names[number])
            upper = grid[number * panels]
            _over_time(upper, result, "error", runs, number)
            upper.set_title(name)
            if panels == 2:
                lower = grid[number * panels + 1]
                _over_time(lower, result, "error", runs[-1:], number)
                index = result.records[runs[-1]].index
                lower.set_title(f"{name}, run {index} on a scale of its own")
        return _finished(figure, list(grid))


def latency(result: CampaignResult) -> Figure | None:
    """Draw latency and execution time of the loop; None in lock-step."""
    if result.latency is None:
        return None
    with mpl.rc_context(style()):
        figure = Figure(figsize=(WIDTH_IN, 4.6))
        for axes, what in zip(figure.subplots(2, 1), ("wake", "execution"), strict=True):
            latency_picture(result, what, ax=axes)
        figure.axes[0].set_xlabel("")
        return figure


def late_cycle(result: CampaignResult) -> Figure | None:
    """Draw the stages of the worst cycle beside a good one; None if no cycle was late."""
    timing = result.latency
    if timing is None or timing.worst is None:
        return None
    rows = [("worst", timing.worst.stages), ("good", timing.good or timing.worst.usual)]
    control, wake, send, _, receive, *_ = current().series
    colours = {"wake": wake, "receive": receive, "control": control, "send": send}
    with mpl.rc_context(style()):
        figure = Figure(figsize=(WIDTH_IN, 2.2))
        axes = figure.subplots()
        for number, (_, stages) in enumerate(rows):
            left = 0.0
            for name, colour in colours.items():
                span_us = getattr(stages, f"{name}_us")
                axes.barh(number, span_us, left=left, height=0.6, color=colour,
                          label=name if number == 0 else None)  # fmt: skip
                left += span_us
        axes.axvline(timing.worst.allowed_us, color=current().ink, linewidth=1, linestyle="--",
                     label="allowed")  # fmt: skip
        axes.set_yticks(range(len(rows)), [name for name, _ in rows])
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("time in the cycle in µs")
        figure.legend(loc="outside upper center", ncols=5)
        return figure


def _over_time(
    axes: Axes, result: CampaignResult, what: str, runs: tuple[int, ...], axis: int
) -> None:
    """Draw a signal of first and last run in their colours; of one run it is the last."""
    signal(result, what, run=runs, axis=axis, ax=axes, legend=False)
    first_and_last = (current().first, current().last)[-len(runs) :]
    for line, run, colour in zip(axes.lines, runs, first_and_last, strict=True):
        line.set_color(colour)
        line.set_label(f"run {result.records[run].index}")
    axes.set_xlabel("")


def _finished(figure: Figure, grid: list[Axes]) -> Figure:
    """Return the figure with one legend and one label of time for all panels."""
    grid[-1].set_xlabel("time in s")
    figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    figure.align_ylabels()
    return figure


def _convergence_panel(
    axes: Axes, records: Sequence[IterationRecord], columns: list[Column], base: str
) -> None:
    """Draw the errors of one unit, of runs that are learned from.

    An error of 0 has no place on a logarithmic scale.
    """
    records = [record for record in records if not record.phase]
    index = [record.index for record in records]
    rows = [(column, [column.of(record) for record in records]) for column in columns]
    known = [value for _, row in rows for value in row if value]
    unit = unit_for(base, max(known, default=0.0))
    for column, row in rows:
        what, kind = column.name.split(" ", 1)[::-1]
        colour, marker = (current().third, "s") if what == "contour" else (current().last, "o")
        filled = colour if kind == "max" else current().ground
        values = [value * unit.scale if value else np.nan for value in row]
        axes.plot(
            index, values, "-" if kind == "max" else ":", color=colour, marker=marker,
            markersize=4.5, markerfacecolor=filled, label=f"{what}, {kind}",
        )  # fmt: skip
    for record in records:
        if record.rolled_back:
            axes.axvline(record.index, color=current().first, linewidth=1, linestyle="--")
    if known:
        logarithmic(axes)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    axes.set_ylabel(f"error in {unit.symbol}")
